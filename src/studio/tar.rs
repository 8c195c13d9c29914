//! Several files as one download: a POSIX archive (ustar).

/// Size of a block.
const BLOCK: usize = 512;

/// An archive of files; `None` for a name of more than 100 bytes, or a file of 8 GiB or more.
pub(crate) fn archive(files: &[(String, Vec<u8>)]) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(files.iter().map(|f| f.1.len() + 2 * BLOCK).sum::<usize>() + 2 * BLOCK);
    for (name, bytes) in files {
        out.extend(header(name, bytes.len())?);
        out.extend_from_slice(bytes);
        out.resize(out.len().next_multiple_of(BLOCK), 0);
    }
    out.resize(out.len() + 2 * BLOCK, 0);
    Some(out)
}

fn header(name: &str, size: usize) -> Option<[u8; BLOCK]> {
    let mut header = [0_u8; BLOCK];
    let mut put = |at: usize, text: &[u8]| header[at..at + text.len()].copy_from_slice(text);
    let size = format!("{size:011o}");
    if name.len() > 100 || size.len() > 11 {
        return None;
    }
    put(0, name.as_bytes());
    put(100, b"0000644\0");
    put(108, b"0000000\0");
    put(116, b"0000000\0");
    put(124, size.as_bytes());
    put(136, b"00000000000");
    put(148, b"        ");
    put(156, b"0");
    put(257, b"ustar\x0000");
    let sum: u32 = header.iter().map(|b| u32::from(*b)).sum();
    header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    Some(header)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_archive_has_its_files_in_whole_blocks_with_their_checksums() {
        let files = [("a.obj".to_owned(), b"v 0 0 0\n".to_vec()), ("b.obj".to_owned(), vec![7; 600])];
        let bytes = archive(&files).unwrap();
        assert_eq!(bytes.len(), BLOCK * (2 + 3 + 2));
        assert_eq!((&bytes[..5], &bytes[2 * BLOCK..2 * BLOCK + 5]), (&b"a.obj"[..], &b"b.obj"[..]));
        assert_eq!(&bytes[BLOCK..BLOCK + 8], b"v 0 0 0\n");
        let mut header: [u8; BLOCK] = bytes[..BLOCK].try_into().unwrap();
        let stored = u32::from_str_radix(std::str::from_utf8(&header[148..154]).unwrap(), 8).unwrap();
        header[148..156].fill(b' ');
        assert_eq!(stored, header.iter().map(|b| u32::from(*b)).sum::<u32>());
        assert!(archive(&[("x".repeat(101), Vec::new())]).is_none());
    }
}
