//! The bytes of a file, or of memory, for FFmpeg, read by this program.
//!
//! FFmpeg opens nothing itself: no name is taken for a URL, no text inside a file makes another file part of the result, an
//! interrupt reaches every read, and a demuxer that reads in circles is stopped.

use std::ffi::{CStr, OsStr, c_char, c_int, c_void};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use ffmpeg_next::ffi;

use super::AvError;
use plumbline_num::run::Interrupt;

/// Buffer between a file and FFmpeg, bytes; FFmpeg's own default for files.
const BUFFER: usize = 32 << 10;

/// What a read or seek costs beside its bytes, so that reads that give nothing come to an end too.
const CALL_COST: i64 = 512;

/// Bytes that may be read without a packet in excess of four times the file: indices are read twice, damaged ones searched.
const ALLOWANCE: i64 = 64 << 20;

/// Time without a packet after which a playlist counts as endless. Players wait for a live one to grow.
const PLAYLIST_PATIENCE: Duration = Duration::from_secs(20);

/// Files that FFmpeg may open besides the one that was handed over.
#[derive(Debug)]
pub(crate) enum Nested {
    /// None.
    Refused,
    /// The pictures of a sequence: any regular file by its name.
    Pictures,
    /// Files within this folder, which is free of links.
    Folder(PathBuf),
}

/// What watches over the reads of one demuxer.
#[derive(Debug)]
pub(crate) struct Guard {
    interrupt: Interrupt,
    nested: Nested,
    /// Bytes that may be read before the next packet, and what is left of them.
    allowance: i64,
    left: AtomicI64,
    packet_at: Mutex<Option<Instant>>,
    exhausted: AtomicBool,
    refused: Mutex<Option<String>>,
}

impl Guard {
    /// A guard for a file of `length` bytes.
    pub(crate) fn new(interrupt: &Interrupt, nested: Nested, length: u64) -> Arc<Self> {
        // A playlist's or a sequence's own length says nothing of the files that it names.
        let length = if matches!(nested, Nested::Refused) { length } else { length.max(1 << 34) };
        let allowance = i64::try_from(length).unwrap_or(i64::MAX).saturating_mul(4).saturating_add(ALLOWANCE);
        let timed = matches!(nested, Nested::Folder(_));
        Arc::new(Self {
            interrupt: interrupt.clone(),
            nested,
            allowance,
            left: AtomicI64::new(allowance),
            packet_at: Mutex::new(timed.then(Instant::now)),
            exhausted: AtomicBool::new(false),
            refused: Mutex::new(None),
        })
    }

    /// A packet came: the demuxer makes progress.
    pub(super) fn progressed(&self) {
        self.left.store(self.allowance, Ordering::Relaxed);
        if let Ok(mut at) = self.packet_at.lock()
            && at.is_some()
        {
            *at = Some(Instant::now());
        }
    }

    /// Why reading must stop, if it must.
    pub(crate) fn stopped(&self) -> Option<AvError> {
        let late = || self.packet_at.lock().is_ok_and(|at| at.is_some_and(|at| at.elapsed() > PLAYLIST_PATIENCE));
        if self.interrupt.is_stopped() {
            Some(AvError::EXIT)
        } else if self.exhausted.load(Ordering::Relaxed) || late() {
            self.exhausted.store(true, Ordering::Relaxed);
            Some(AvError::NO_PROGRESS)
        } else {
            None
        }
    }

    /// The name of a file that the container tried to open and must not.
    pub(crate) fn refused(&self) -> Option<String> {
        self.refused.lock().ok()?.clone()
    }

    fn pay(&self, bytes: usize) -> Result<(), AvError> {
        let cost = i64::try_from(bytes).unwrap_or(i64::MAX).saturating_add(CALL_COST);
        if self.left.fetch_sub(cost, Ordering::Relaxed) < cost {
            self.exhausted.store(true, Ordering::Relaxed);
        }
        self.stopped().map_or(Ok(()), Err)
    }

    fn open(&self, url: &CStr) -> Result<File, AvError> {
        self.pay(BUFFER)?;
        let path = Path::new(os_str(url));
        let confined = match &self.nested {
            Nested::Pictures => Some(path.to_owned()),
            Nested::Folder(folder) => within(folder, path),
            Nested::Refused => None,
        };
        let opened = confined.ok_or(AvError::FORBIDDEN).and_then(|path| {
            plumbline_num::files::open_regular(&path)
                .map_err(|e| e.raw_os_error().map_or(AvError::FORBIDDEN, |n| AvError(-n)))
        });
        if matches!(opened, Err(AvError::FORBIDDEN))
            && let Ok(mut refused) = self.refused.lock()
        {
            *refused = Some(path.display().to_string());
        }
        opened
    }
}

/// `path` without links, where it is inside `folder`.
pub(crate) fn within(folder: &Path, path: &Path) -> Option<PathBuf> {
    let bytes = path.as_os_str().as_encoded_bytes();
    // A protocol is no path; absolute names come from FFmpeg, which joins relative ones to the playlist's folder.
    let plain = bytes.strip_prefix(b"file:").map_or(path, |b| Path::new(os_bytes(b)));
    let full = folder.join(plain).canonicalize().ok()?;
    full.starts_with(folder).then_some(full)
}

/// A file as FFmpeg reads it.
pub(crate) struct FileIo(NonNull<ffi::AVIOContext>);

// SAFETY: one owner; an io context may move between threads as long as one at a time uses it.
unsafe impl Send for FileIo {}

/// A file, or bytes in memory.
pub(crate) trait Bytes: Read + Seek + Send {}

impl<T: Read + Seek + Send> Bytes for T {}

/// What stands behind an io context.
struct Source {
    file: Box<dyn Bytes>,
    length: u64,
    at: u64,
    /// Outlives the context: the demuxer owns both, and drops the guard last.
    guard: *const Guard,
}

impl FileIo {
    /// # Safety
    /// `guard` lives as long as the io.
    pub(super) unsafe fn new(mut file: Box<dyn Bytes>, guard: *const Guard) -> Result<Self, AvError> {
        let io = |e: std::io::Error| AvError(-e.raw_os_error().unwrap_or(libc::EIO));
        let length = file.seek(SeekFrom::End(0)).map_err(io)?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let source = Box::into_raw(Box::new(Source { file, length, at: 0, guard }));
        // SAFETY: the buffer is FFmpeg's own memory, as the context may replace it; the callbacks get `source` back, which is
        // freed with the context only. What could not be handed over is freed here.
        unsafe {
            let buffer = ffi::av_malloc(BUFFER).cast::<u8>();
            let opaque = source.cast::<c_void>();
            let raw = if buffer.is_null() {
                ptr::null_mut()
            } else {
                ffi::avio_alloc_context(buffer, BUFFER as c_int, 0, opaque, Some(read), None, Some(seek))
            };
            NonNull::new(raw).map(Self).ok_or_else(|| {
                ffi::av_free(buffer.cast());
                drop(Box::from_raw(source));
                AvError::NO_MEMORY
            })
        }
    }

    pub(super) fn as_ptr(&self) -> *mut ffi::AVIOContext {
        self.0.as_ptr()
    }
}

impl Drop for FileIo {
    fn drop(&mut self) {
        // SAFETY: made in `new`; the buffer is whatever FFmpeg holds now; each part is freed once.
        unsafe {
            let mut raw = self.0.as_ptr();
            drop(Box::from_raw((*raw).opaque.cast::<Source>()));
            ffi::av_free((*raw).buffer.cast());
            ffi::avio_context_free(&raw mut raw);
        }
    }
}

unsafe extern "C" fn read(opaque: *mut c_void, buffer: *mut u8, size: c_int) -> c_int {
    // SAFETY: FFmpeg hands back the `Source` of `FileIo::new`, and memory that is writable for `size` bytes; the guard
    // outlives the io.
    let (source, buffer, guard) = unsafe {
        let source = &mut *opaque.cast::<Source>();
        let guard = &*source.guard;
        (source, std::slice::from_raw_parts_mut(buffer, size.max(0) as usize), guard)
    };
    if let Err(stopped) = guard.pay(buffer.len()) {
        return stopped.0;
    }
    loop {
        match source.file.read(buffer) {
            Ok(0) => return AvError::EOF.0,
            Ok(n) => {
                source.at += n as u64;
                return n as c_int;
            }
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return -e.raw_os_error().unwrap_or(libc::EIO),
        }
    }
}

unsafe extern "C" fn seek(opaque: *mut c_void, offset: i64, whence: c_int) -> i64 {
    // SAFETY: as in `read`.
    let (source, guard) = unsafe {
        let source = &mut *opaque.cast::<Source>();
        let guard = &*source.guard;
        (source, guard)
    };
    if whence & ffi::AVSEEK_SIZE != 0 {
        return i64::try_from(source.length).unwrap_or(i64::MAX);
    }
    if let Err(stopped) = guard.pay(0) {
        return i64::from(stopped.0);
    }
    let whence = whence & !(ffi::AVSEEK_FORCE);
    let base = match whence {
        libc::SEEK_SET => 0,
        libc::SEEK_CUR => source.at as i64,
        libc::SEEK_END => source.length as i64,
        _ => return i64::from(AvError::INVALID.0),
    };
    let Some(target) = base.checked_add(offset).and_then(|t| u64::try_from(t).ok()) else {
        return i64::from(AvError::INVALID.0);
    };
    match source.file.seek(SeekFrom::Start(target)) {
        Ok(at) => {
            source.at = at;
            i64::try_from(at).unwrap_or(i64::MAX)
        }
        Err(e) => i64::from(-e.raw_os_error().unwrap_or(libc::EIO)),
    }
}

/// FFmpeg's question whether to give up.
pub(super) unsafe extern "C" fn interrupted(opaque: *mut c_void) -> c_int {
    // SAFETY: the demuxer's guard, which outlives its context.
    let guard = unsafe { opaque.cast::<Guard>().as_ref() };
    c_int::from(guard.is_some_and(|g| g.stopped().is_some()))
}

/// FFmpeg's request for another file.
pub(super) unsafe extern "C" fn open_nested(
    context: *mut ffi::AVFormatContext,
    pb: *mut *mut ffi::AVIOContext,
    url: *const c_char,
    flags: c_int,
    _options: *mut *mut ffi::AVDictionary,
) -> c_int {
    // SAFETY: a live context, whose `opaque` is null or the guard that its demuxer owns; `url` ends with zero; `pb` takes
    // the io that `close_nested` frees.
    unsafe {
        *pb = ptr::null_mut();
        let guard = (*context).opaque.cast::<Guard>();
        if guard.is_null() || url.is_null() || flags & ffi::AVIO_FLAG_WRITE != 0 {
            return AvError::FORBIDDEN.0;
        }
        let opened = (*guard).open(CStr::from_ptr(url)).and_then(|file| FileIo::new(Box::new(file), guard));
        match opened {
            Ok(io) => {
                *pb = io.as_ptr();
                std::mem::forget(io);
                0
            }
            Err(e) => e.0,
        }
    }
}

/// Closes what `open_nested` opened.
pub(super) unsafe extern "C" fn close_nested(_: *mut ffi::AVFormatContext, pb: *mut ffi::AVIOContext) -> c_int {
    // SAFETY: FFmpeg closes here only what it got from `open_nested`, once.
    drop(NonNull::new(pb).map(FileIo));
    0
}

fn os_str(text: &CStr) -> &OsStr {
    os_bytes(text.to_bytes())
}

#[cfg(unix)]
fn os_bytes(bytes: &[u8]) -> &OsStr {
    std::os::unix::ffi::OsStrExt::from_bytes(bytes)
}

#[cfg(not(unix))]
fn os_bytes(bytes: &[u8]) -> &OsStr {
    OsStr::new(std::str::from_utf8(bytes).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_confined_to_their_folder() {
        let place = tempfile::tempdir().expect("temporary folder");
        let outer = place.path().canonicalize().expect("a folder");
        let folder = outer.join("list");
        std::fs::create_dir_all(folder.join("sub")).expect("folders");
        for file in ["list/a.ts", "list/sub/b.ts", "secret.ts"] {
            std::fs::write(outer.join(file), b"x").expect("write");
        }
        std::os::unix::fs::symlink(outer.join("secret.ts"), folder.join("out.ts")).expect("link");
        std::os::unix::fs::symlink("sub/b.ts", folder.join("in.ts")).expect("link");
        let absolute = folder.join("a.ts");
        let inside = ["a.ts", "sub/b.ts", "in.ts", "file:a.ts", absolute.to_str().expect("UTF-8")];
        assert!(inside.iter().all(|name| within(&folder, Path::new(name)).is_some()));
        let secret = outer.join("secret.ts");
        let outside = ["../secret.ts", "out.ts", "sub/../../secret.ts", "none.ts", secret.to_str().expect("UTF-8")];
        assert!(outside.iter().all(|name| within(&folder, Path::new(name)).is_none()));
        for protocol in ["http://x/a.ts", "concat:a.ts", "crypto+file:a.ts", "subfile,,start,0,end,1,,:a.ts"] {
            assert_eq!(within(&folder, Path::new(protocol)), None, "{protocol}");
        }
    }
}
