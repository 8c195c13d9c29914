//! XMP and IPTC through every format.

use super::*;

/// A packet that says orientation 6 and a size, and names extended XMP.
const PACKET: &str = r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xmlns:tiff="http://ns.adobe.com/tiff/1.0/" xmlns:exif="http://ns.adobe.com/exif/1.0/"
 xmlns:xmpNote="http://ns.adobe.com/xmp/note/" xmpNote:HasExtendedXMP="0123456789ABCDEF0123456789ABCDEF"
 tiff:Orientation="6" exif:PixelXDimension="9" exif:PixelYDimension="7"/></rdf:RDF></x:xmpmeta>"#;

/// A caption of IPTC.
const CAPTION: &[u8] = b"\x1c\x02\x78\x00\x05Hello";

fn with_xmp(extended: Option<usize>) -> Photo {
    let mut before = photo(Layout::Gbr, 8, false, (50, 40));
    let extended = extended.map(|bytes| (0..bytes).map(|i| b'a' + (i % 23) as u8).collect());
    before.xmp = Some(Xmp { packet: PACKET.into(), extended });
    before.iptc = Some(CAPTION.to_vec());
    before
}

#[test]
fn xmp_and_iptc_travel_through_every_format_and_say_the_new_size() {
    for (format, order) in
        FORMATS.into_iter().flat_map(|f| [(f, None), (f, Some(Order::Little)), (f, Some(Order::Big))])
    {
        let mut before = with_xmp(None);
        before.exif = order.map(exif_block);
        before.icc = order.map(|_| profile(*b"RGB ", 900));
        let (bytes, saved) = written(&before, format);
        let after = read(&bytes).expect("sound");
        let xmp = String::from_utf8(after.xmp.expect("kept").packet).expect("text");
        let expected =
            PACKET.replace("n=\"6\"", "n=\"1\"").replace("n=\"9\"", "n=\"50\"").replace("n=\"7\"", "n=\"40\"");
        assert_eq!(xmp, expected, "{format:?}");
        assert!(after.icc == before.icc && (after.exif.is_some() || order.is_none()), "{format:?}");
        if format == StillFormat::WebP {
            assert_eq!((saved.warnings.len(), after.iptc), (1, None));
            assert!(saved.warnings[0].contains("IPTC"), "{saved:?}");
        } else {
            assert_eq!(saved.warnings, [""; 0], "{format:?}");
            assert_eq!(after.iptc.as_deref(), Some(CAPTION), "{format:?}");
        }
    }
}

#[test]
fn extended_xmp_is_kept_in_jpeg_alone_and_said_to_be_lost_elsewhere() {
    for bytes in [10, 200_000] {
        let before = with_xmp(Some(bytes));
        let (file, saved) = written(&before, StillFormat::Jpeg);
        assert_eq!(saved.warnings, [""; 0]);
        let extended = read(&file).expect("sound").xmp.expect("kept").extended;
        assert!(extended == before.xmp.and_then(|xmp| xmp.extended), "{bytes} bytes come back");
    }
    let (file, saved) = written(&with_xmp(Some(10)), StillFormat::Png);
    assert!(saved.warnings[0].contains("extended XMP") && saved.warnings.len() == 1, "{saved:?}");
    assert_eq!(read(&file).expect("sound").xmp.expect("kept").extended, None);
    // A piece of it is missing.
    let (mut file, _) = written(&with_xmp(Some(200_000)), StillFormat::Jpeg);
    let piece = file.windows(10).position(|w| w == b"/extension").expect("written");
    file[piece] = b'-';
    let after = read(&file).expect("sound");
    assert_eq!(after.xmp.map(|xmp| xmp.extended), Some(None));
}

#[test]
fn jpeg_says_that_xmp_or_iptc_is_too_long_for_its_segments() {
    let mut before = with_xmp(None);
    let long = |xmp: &mut Xmp| xmp.packet.extend(std::iter::repeat_n(b' ', 70_000));
    before.xmp.as_mut().map(long).expect("there");
    before.iptc = Some([CAPTION, &vec![0; 66_000]].concat());
    let (bytes, saved) = written(&before, StillFormat::Jpeg);
    assert_eq!(saved.warnings.len(), 2, "{saved:?}");
    assert!(saved.warnings.iter().all(|w| w.contains("does not fit into JPEG")), "{saved:?}");
    let after = read(&bytes).expect("sound");
    assert_eq!((after.xmp, after.iptc), (None, None));
    let (bytes, saved) = written(&before, StillFormat::Tiff);
    let after = read(&bytes).expect("sound");
    assert!(saved.warnings.is_empty() && after.iptc == before.iptc && after.xmp.is_some());
}

#[test]
fn a_webp_chunk_that_claims_more_than_the_file_is_refused() {
    let (mut bytes, _) = written(&with_xmp(None), StillFormat::WebP);
    let at = bytes.windows(4).rposition(|w| w == b"XMP ").expect("written");
    bytes[at + 4..at + 8].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(matches!(read(&bytes), Err(StillError::Truncated)));
}

#[test]
fn mutated_metadata_never_panic_and_can_be_written_again() {
    let mut rng = fastrand::Rng::with_seed(3);
    for format in FORMATS {
        let (bytes, _) = written(&with_xmp(Some(50)), format);
        for _ in 0..800 {
            let mut wild = bytes.clone();
            for _ in 0..rng.usize(1..6) {
                let most = wild.len().min(1200);
                wild[rng.usize(..most)] = rng.u8(..);
            }
            let Ok(after) = decode(Cursor::new(&wild), LoadOptions { max_pixels: 1 << 16 }) else { continue };
            written(&after, StillFormat::Jpeg);
            written(&after, StillFormat::Tiff);
        }
    }
}
