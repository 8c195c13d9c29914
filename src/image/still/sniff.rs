//! What a file is, by its first bytes.

use std::path::Path;

use super::StillError;

/// A format that is read and written here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StillFormat {
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
    /// TIFF.
    Tiff,
    /// WebP.
    WebP,
}

/// Extensions of raw files of cameras. Many of them are TIFF inside, with a small picture first.
pub const RAW_EXTENSIONS: [&str; 28] = [
    "3fr", "arw", "cr2", "cr3", "crw", "dcr", "dng", "erf", "fff", "iiq", "k25", "kdc", "mef", "mos", "mrw", "nef",
    "nrw", "orf", "pef", "raf", "raw", "rw2", "rwl", "sr2", "srf", "srw", "x3f", "gpr",
];

/// Bytes that [`sniff`] reads.
pub(super) const HEAD: usize = 64;

impl StillFormat {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Jpeg => "JPEG",
            Self::Png => "PNG",
            Self::Tiff => "TIFF",
            Self::WebP => "WebP",
        }
    }

    /// The format that a file's name asks for.
    ///
    /// # Errors
    /// [`StillError::Extension`] where it asks for none that is written here.
    pub fn of_name(path: &Path) -> Result<Self, StillError> {
        match extension(path).as_str() {
            "jpg" | "jpeg" | "jpe" | "jfif" => Ok(Self::Jpeg),
            "png" => Ok(Self::Png),
            "tif" | "tiff" => Ok(Self::Tiff),
            "webp" => Ok(Self::WebP),
            _ => Err(StillError::Extension(path.display().to_string())),
        }
    }
}

/// The extension of a name in lower case; empty where there is none.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// The format of a file that begins with `head`.
pub(super) fn sniff(head: &[u8]) -> Result<StillFormat, StillError> {
    let starts = |magic: &[u8]| head.starts_with(magic);
    let at = |offset: usize, magic: &[u8]| head.get(offset..).is_some_and(|rest| rest.starts_with(magic));
    let raw = |name: &str| Err(StillError::Raw(name.to_owned()));
    let unknown = |found| Err(StillError::Unknown { found });
    if starts(b"\xff\xd8\xff") {
        Ok(StillFormat::Jpeg)
    } else if starts(b"\x89PNG\r\n\x1a\n") {
        Ok(StillFormat::Png)
    } else if starts(b"RIFF") && at(8, b"WEBP") {
        Ok(StillFormat::WebP)
    } else if at(8, b"CR\x02") {
        raw("CR2")
    } else if starts(b"IIRO") || starts(b"IIRS") || starts(b"MMOR") {
        raw("ORF")
    } else if starts(b"IIU\0") {
        raw("RW2")
    } else if starts(b"FUJIFILMCCD-RAW") {
        raw("RAF")
    } else if starts(b"FOVb") {
        raw("X3F")
    } else if starts(b"\0MRM") {
        raw("MRW")
    } else if starts(b"II*\0") || starts(b"MM\0*") || starts(b"II+\0") || starts(b"MM\0+") {
        Ok(StillFormat::Tiff)
    } else if at(4, b"ftyp") {
        iso_brand(head)
    } else if starts(b"GIF8") {
        Err(StillError::Unknown { found: "GIF" })
    } else if starts(b"BM") {
        unknown("BMP")
    } else if starts(b"\xff\x0a") || at(4, b"JXL ") {
        unknown("JPEG XL")
    } else if at(4, b"jP  ") || starts(b"\xff\x4f\xff\x51") {
        unknown("JPEG 2000")
    } else if starts(b"v/1\x01") {
        unknown("OpenEXR")
    } else if starts(b"#?RADIANCE") || starts(b"#?RGBE") {
        unknown("Radiance HDR")
    } else if starts(b"8BPS") {
        unknown("a Photoshop document")
    } else if starts(b"%PDF") {
        unknown("PDF")
    } else if head.is_empty() {
        unknown("an empty file")
    } else {
        unknown("a file of unknown kind")
    }
}

/// Files of the ISO family declare by their brands whether they contain a still picture.
fn iso_brand(head: &[u8]) -> Result<StillFormat, StillError> {
    let brands = || head.get(8..).unwrap_or_default().chunks_exact(4);
    if brands().any(|b| b == b"crx ") {
        return Err(StillError::Raw("CR3".to_owned()));
    }
    let still: [&[u8]; 8] = [b"heic", b"heix", b"heim", b"heis", b"mif1", b"avif", b"hevc", b"avis"];
    // The first brand, then (after a version) those that the file is compatible with.
    let is_still = brands().enumerate().any(|(i, b)| i != 1 && still.contains(&b));
    Err(if is_still { StillError::Heif } else { StillError::Unknown { found: "a video" } })
}

/// Refuses names that only raw files have.
pub(super) fn refuse_raw_name(path: &Path) -> Result<(), StillError> {
    let extension = extension(path);
    if RAW_EXTENSIONS.contains(&extension.as_str()) {
        return Err(StillError::Raw(extension.to_ascii_uppercase()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_recognized_by_their_first_bytes() {
        assert_eq!(sniff(b"\xff\xd8\xff\xe0").expect("JPEG"), StillFormat::Jpeg);
        assert_eq!(sniff(b"RIFF\0\0\0\0WEBPVP8 ").expect("WebP"), StillFormat::WebP);
        assert!(matches!(sniff(b"II*\0\x10\0\0\0CR\x02\0"), Err(StillError::Raw(name)) if name == "CR2"));
        assert!(matches!(sniff(b"\0\0\0\x1cftypavif\0\0\0\0avifmif1"), Err(StillError::Heif)));
        assert!(matches!(sniff(b"\0\0\0\x1cftypmif1\0\0\0\0heic"), Err(StillError::Heif)));
        assert!(matches!(sniff(b"\0\0\0\x1cftypcrx \0\0\0\x01"), Err(StillError::Raw(_))));
        assert!(matches!(sniff(b"\0\0\0\x1cftypisom\0\0\x02\0"), Err(StillError::Unknown { found: "a video" })));
        for head in [&b""[..], b"GIF89a", b"hello", b"\0"] {
            assert!(matches!(sniff(head), Err(StillError::Unknown { .. })), "{head:?}");
        }
    }

    #[test]
    fn names_choose_the_format_that_is_written() {
        for (name, format) in
            [("a.JPG", StillFormat::Jpeg), ("b.jpeg", StillFormat::Jpeg), ("c.tif", StillFormat::Tiff)]
        {
            assert_eq!(StillFormat::of_name(Path::new(name)).expect(name), format);
        }
        for name in ["a", "a.heic", "a.gif", ".jpg"] {
            assert!(StillFormat::of_name(Path::new(name)).is_err(), "{name}");
        }
        assert!(refuse_raw_name(Path::new("x.NEF")).is_err() && refuse_raw_name(Path::new("x.tif")).is_ok());
    }
}
