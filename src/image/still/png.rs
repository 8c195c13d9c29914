//! PNG: text chunks that the encoder does not write, put behind the header of the file.

use std::io::{self, Write};

/// Length of signature and header chunk, behind which other chunks may come.
const HEADER: usize = 33;

/// A chunk of text in UTF-8 (`iTXt`), uncompressed, as XMP must be.
pub(super) fn international_text(keyword: &str, text: &[u8]) -> Vec<u8> {
    chunk(*b"iTXt", &[keyword.as_bytes(), &[0, 0, 0, 0, 0], text].concat())
}

/// A chunk of text in Latin-1 (`tEXt`).
pub(super) fn text(keyword: &str, text: &[u8]) -> Vec<u8> {
    chunk(*b"tEXt", &[keyword.as_bytes(), &[0], text].concat())
}

fn chunk(kind: [u8; 4], content: &[u8]) -> Vec<u8> {
    let mut out = [&(content.len() as u32).to_be_bytes()[..], &kind, content].concat();
    out.extend(crc32(&out[4..]).to_be_bytes());
    out
}

/// CRC-32 of ISO 3309.
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    let step = |c: u32, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
    !bytes.iter().fold(!0_u32, |c, b| (0..8).fold(c ^ u32::from(*b), step))
}

/// A file to which chunks are added behind the header, whatever writes it.
pub(super) struct WithChunks<W> {
    out: W,
    /// Bytes of the header that are still to come.
    header: usize,
    chunks: Vec<u8>,
}

impl<W: Write> WithChunks<W> {
    pub(super) const fn new(out: W, chunks: Vec<u8>) -> Self {
        Self { out, header: HEADER, chunks }
    }
}

impl<W: Write> Write for WithChunks<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.header == 0 {
            return self.out.write(bytes);
        }
        let written = self.out.write(&bytes[..bytes.len().min(self.header)])?;
        self.header -= written;
        if self.header == 0 {
            self.out.write_all(&self.chunks)?;
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
