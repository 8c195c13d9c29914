//! Texts that name other files: refused as clips, unless playlists are allowed; then confined to their own folder.
//!
//! FFmpeg follows such texts under any name. An HLS playlist called `clip.mp4` can name an absolute path, and its bytes become
//! part of the result. Allowed are the two kinds whose every access can be checked: HLS, whose files FFmpeg asks us to open, and
//! ffconcat lists, whose few directives are read here first. A DASH manifest or an IMF composition opens files past that check.

use std::ffi::{CString, OsStr};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::MediaError;
use super::av::{AvError, Demuxer, Dictionary, Guard, InputFormat, Nested, c_path, within};
use plumbline_num::files::open_regular;
use plumbline_num::run::Interrupt;

/// Longest ffconcat list, bytes.
const MAX_LIST: u64 = 1 << 20;

/// Most files of an ffconcat list; each is opened to see what it is.
const MAX_FILES: usize = 4096;

/// Directives of an ffconcat list that name no file and set no option of a demuxer.
const HARMLESS: [&str; 4] = ["ffconcat", "duration", "inpoint", "outpoint"];

/// A playlist of that format can be read where it is allowed.
pub(super) fn is_readable(format: InputFormat) -> bool {
    matches!(format.name().as_str(), "hls" | "concat")
}

/// Why a file of `format` is no clip.
pub(super) fn refusal(path: &str, format: InputFormat) -> MediaError {
    let name = format.name();
    let problem = match name.as_str() {
        "hls" | "concat" => {
            let kind = if name == "hls" { "an HLS playlist" } else { "an ffconcat list" };
            let help = "allow playlists (--allow-playlist) to read those of its files that are in its own folder";
            format!("is {kind}, not a video: a text that names other files; {help}")
        }
        _ => {
            let kind = match name.as_str() {
                "dash" | "webm_dash_manifest" => "a DASH manifest: a text that names other files".to_owned(),
                "imf" => "an IMF composition: a text that names other files".to_owned(),
                "sdp" | "rtsp" | "rtp" | "sap" => "an SDP session description: a text that names streams".to_owned(),
                "tty" | "bin" | "xbin" | "adf" | "idf" => "text, which FFmpeg would draw".to_owned(),
                "vobsub" => "an index of subtitles in another file".to_owned(),
                _ => format!("{} ({name})", format.long_name()),
            };
            format!("is not a video but {kind}; convert it first, for example to .mp4 or .mkv")
        }
    };
    MediaError::input(path, problem)
}

/// A playlist that may be read.
pub(super) struct Playlist {
    path: PathBuf,
    folder: PathBuf,
    format: InputFormat,
}

impl Playlist {
    /// Checks what can be checked before FFmpeg reads it.
    pub(super) fn new(
        path: &Path,
        name: &str,
        format: InputFormat,
        file: &File,
        interrupt: &Interrupt,
    ) -> Result<Self, MediaError> {
        let failed = |e: std::io::Error| MediaError::input(name, format!("cannot be read: {e}"));
        // Named by where it is without links: its folder is that of the name which the user gave.
        let path = std::path::absolute(path).map_err(failed)?;
        let folder = path.parent().unwrap_or(&path).canonicalize().map_err(failed)?;
        let path = folder.join(path.file_name().unwrap_or_default());
        if format.name() == "concat" {
            let mut text = String::new();
            let mut copy = file.try_clone().map_err(failed)?;
            std::io::Seek::rewind(&mut copy).map_err(failed)?;
            copy.take(MAX_LIST + 1).read_to_string(&mut text).map_err(failed)?;
            check_list(&text, &folder, interrupt).map_err(|problem| MediaError::input(name, problem))?;
        }
        Ok(Self { path, folder, format })
    }

    pub(super) fn guard(&self, interrupt: &Interrupt) -> Arc<Guard> {
        Guard::new(interrupt, Nested::Folder(self.folder.clone()), 0)
    }

    pub(super) fn open(&self, file: File, guard: Arc<Guard>) -> Result<Demuxer, AvError> {
        let url: CString = c_path(self.path.as_os_str());
        // HLS: from the beginning also where the end is not marked, and without waiting for more. ffconcat: names were checked.
        let options = match self.format.name().as_str() {
            "hls" => Dictionary::new()
                .with("live_start_index", "0")
                .with("max_reload", "3")
                .with("protocol_whitelist", "file"),
            _ => Dictionary::new().with("safe", "0").with("protocol_whitelist", "file"),
        };
        Demuxer::open_as(Some(Box::new(file)), &url, self.format, options, guard)
    }
}

/// Every file of an ffconcat list is a clip within `folder`, and nothing else is asked for.
fn check_list(text: &str, folder: &Path, interrupt: &Interrupt) -> Result<(), String> {
    if text.len() as u64 > MAX_LIST {
        return Err(format!("the list is longer than {MAX_LIST} bytes"));
    }
    let mut files = 0;
    for (number, line) in text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        if HARMLESS.contains(&word) {
            continue;
        }
        if word != "file" {
            return Err(format!("line {number}: `{word}` is not read here (expected file, {})", HARMLESS.join(", ")));
        }
        files += 1;
        if files > MAX_FILES {
            return Err(format!("line {number}: the list names more than {MAX_FILES} files"));
        }
        let name =
            plain_name(rest.trim()).ok_or_else(|| format!("line {number}: a file name with odd quotes: {rest}"))?;
        check_file(name, folder, interrupt).map_err(|problem| format!("line {number}: {name}: {problem}"))?;
    }
    Ok(())
}

/// The name as FFmpeg reads it, where it is written plainly or in one pair of quotes.
fn plain_name(text: &str) -> Option<&str> {
    let quoted = text.strip_prefix('\'').and_then(|t| t.strip_suffix('\''));
    let name = quoted.unwrap_or(text);
    let odd = |c: char| c == '\'' || (quoted.is_none() && (c == '\\' || c.is_whitespace()));
    (!name.is_empty() && !name.contains(odd)).then_some(name)
}

fn check_file(name: &str, folder: &Path, interrupt: &Interrupt) -> Result<(), String> {
    let path = Some(Path::new(name)).filter(|_| !name.contains(':')).and_then(|name| within(folder, name));
    let path = path.ok_or("it is not there, or not within the folder of the list")?;
    let file = open_regular(&path).map_err(|e| e.to_string())?;
    let length = file.metadata().map_err(|e| e.to_string())?.len();
    let guard = Guard::new(interrupt, Nested::Refused, length);
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default();
    let format = InputFormat::recognize(file, extension, &guard).map_err(|e| e.to_string())?;
    if format.is_container() { Ok(()) } else { Err(format!("it is no clip but {}", format.long_name())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_that_leave_their_folder_or_ask_for_more_are_refused() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let folder = folder.path().canonicalize().expect("a folder");
        std::fs::write(folder.join("notes.txt"), "a text\n").expect("write");
        let gif = b"GIF89a\x01\x00\x01\x00\x80\x00\x00\x00\x00\x00\xff\xff\xff,\x00\x00\x00\x00\x01\x00\x01\x00\x00\x02\x02D\x01\x00;";
        std::fs::write(folder.join("a b.gif"), gif).expect("write");
        let check = |text: &str| check_list(text, &folder, &Interrupt::default());
        assert_eq!(check("ffconcat version 1.0\n# a comment\n\nfile 'a b.gif'\nduration 1\n"), Ok(()));
        for (text, expected) in [
            ("file /etc/passwd", "line 1: /etc/passwd: it is not there, or not within the folder of the list"),
            ("file ../x.mp4", "line 1: ../x.mp4: it is not there"),
            ("file file:a.gif", "line 1: file:a.gif: it is not there"),
            ("ffconcat version 1.0\nfile notes.txt", "line 2: notes.txt: "),
            ("file a' 'b.gif", "line 1: a file name with odd quotes"),
            ("file 'a b.gif'\noption safe 0", "line 2: `option` is not read here"),
        ] {
            let problem = check(text).expect_err(text);
            assert!(problem.starts_with(expected), "{problem}");
        }
        let many = "file 'a b.gif'\n".repeat(3) + &"#".repeat(MAX_LIST as usize);
        assert!(check(&many).expect_err("long").starts_with("the list is longer than"));
    }
}
