//! Ultra HDR pictures: the gain map behind the picture, and files that lie about it.

use super::*;

const HDRGM: &str = r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0" hdrgm:GainMapMax="2.5"/></rdf:RDF>
</x:xmpmeta>"#;

fn ultra_hdr(xmp: bool, iso: bool) -> Photo {
    let mut before = photo(Layout::Gbr, 8, false, (64, 48));
    let map = photo(Layout::Gray, 8, false, (16, 12)).frame;
    before.gain_map = Some(GainMap { frame: map, xmp: xmp.then(|| HDRGM.into()), iso: iso.then(|| vec![1, 2, 3]) });
    before
}

fn map_of(bytes: &[u8]) -> GainMap {
    let photo = read(bytes).expect("sound");
    assert_eq!(photo.warnings, [""; 0]);
    photo.gain_map.expect("a gain map")
}

#[test]
fn a_gain_map_is_written_behind_its_picture_and_read_with_how_it_is_applied() {
    for (xmp, iso) in [(true, false), (false, true), (true, true)] {
        for exif in [None, Some(exif_block(Order::Big))] {
            let before = Photo { exif, icc: Some(profile(*b"RGB ", 300)), ..ultra_hdr(xmp, iso) };
            let (bytes, saved) = written(&before, StillFormat::Jpeg);
            assert_eq!(saved.warnings, [""; 0]);
            let (after, map) = (map_of(&bytes), before.gain_map.expect("a map"));
            assert_eq!((&after.xmp, &after.iso), (&map.xmp, &map.iso));
            let (a, b) = (after.frame.plane8(0).expect("8 bit"), map.frame.plane8(0).expect("8 bit"));
            assert!((0..12).all(|y| a.row(y).iter().zip(b.row(y)).all(|(a, b)| a.abs_diff(*b) < 9)));
        }
    }
}

#[test]
fn the_segments_say_where_the_gain_map_is_and_how_long() {
    let (bytes, _) = written(&ultra_hdr(true, true), StillFormat::Jpeg);
    let second = bytes.windows(3).rposition(|w| w == b"\xff\xd8\xff").expect("a second picture");
    let header = bytes.windows(4).position(|w| w == b"MPF\0").expect("a list of pictures") + 4;
    let number = |at: usize| u32::from_be_bytes(bytes[header + at..][..4].try_into().expect("four")) as usize;
    // Behind the directory, two entries of attributes, length, offset and dependencies.
    assert_eq!((number(50 + 4), number(50 + 8)), (second, 0));
    assert_eq!((number(66 + 4), number(66 + 8)), (bytes.len() - second, second - header));
    let length = format!("Item:Semantic=\"GainMap\" Item:Mime=\"image/jpeg\" Item:Length=\"{}\"", bytes.len() - second);
    assert!(bytes.windows(length.len()).any(|w| w == length.as_bytes()));
    // What announces the map does not pile up.
    let again = written(&read(&bytes).expect("sound"), StillFormat::Jpeg).0;
    assert_eq!(again.windows(14).filter(|w| w == b"hdrgm:Version=").count(), 2, "one for each picture");
    map_of(&again);
}

#[test]
fn a_gain_map_is_upright_with_its_picture() {
    let mut before = ultra_hdr(true, false);
    before.exif = Some(exif_block(Order::Little));
    let (mut bytes, _) = written(&before, StillFormat::Jpeg);
    let at = bytes.windows(8).position(|w| w == [0x12, 1, 3, 0, 1, 0, 0, 0]).expect("the orientation's entry") + 8;
    bytes[at] = 6;
    let after = read(&bytes).expect("sound");
    let map = after.gain_map.expect("a map").frame;
    assert_eq!((after.frame.width, after.frame.height, map.width, map.height), (48, 64, 12, 16));
}

#[test]
fn a_gain_map_that_is_lost_is_said_to_be() {
    for format in [StillFormat::Png, StillFormat::Tiff, StillFormat::WebP] {
        let (_, saved) = written(&ultra_hdr(true, true), format);
        assert!(saved.warnings.len() == 1 && saved.warnings[0].contains("gain map"), "{saved:?}");
    }
    let (whole, _) = written(&ultra_hdr(true, true), StillFormat::Jpeg);
    let second = whole.windows(3).rposition(|w| w == b"\xff\xd8\xff").expect("a second picture");
    let read = |bytes: &[u8]| {
        let after = read(bytes).expect("the picture is sound");
        assert!(after.gain_map.is_none());
        after.warnings.join("; ")
    };
    assert!(read(&whole[..whole.len() - 9]).contains("not where the file says"));
    let mut damaged = whole.clone();
    let frame = second + damaged[second..].windows(2).position(|w| w == [0xff, 0xc0]).expect("a frame header");
    damaged[frame + 5..frame + 9].fill(0xff);
    assert!(read(&damaged).contains("larger than its picture"));
    damaged[frame + 4] = 12;
    assert!(read(&damaged).contains("12 bits"));
}

#[test]
fn mutated_pictures_with_gain_maps_never_panic_and_can_be_written_again() {
    let mut rng = fastrand::Rng::with_seed(8);
    let (bytes, _) = written(&ultra_hdr(true, true), StillFormat::Jpeg);
    let header = bytes.windows(4).position(|w| w == b"MPF\0").expect("a list of pictures");
    for _ in 0..2000 {
        let mut wild = bytes.clone();
        for _ in 0..rng.usize(1..6) {
            let at = if rng.bool() { rng.usize(..wild.len()) } else { header + rng.usize(..90) };
            wild[at] = rng.u8(..);
        }
        if let Ok(after) = decode(Cursor::new(&wild), LoadOptions { max_pixels: 1 << 16 }) {
            written(&after, StillFormat::Jpeg);
        }
    }
}
