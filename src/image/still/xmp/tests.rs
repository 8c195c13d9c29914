//! Corrections in the text, and texts that are none.

use super::*;

const PACKET: &str = r#"<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><!-- t:Orientation="9" -->
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="" xmlns:t='http://ns.adobe.com/tiff/1.0/' xmlns:exif="http://ns.adobe.com/exif/1.0/"
    xmlns:xmp="http://ns.adobe.com/xap/1.0/" xmlns:g="http://ns.google.com/photos/1.0/panorama/"
    xmlns:c="http://ns.google.com/photos/1.0/container/" xmlns:note="http://ns.adobe.com/xmp/note/"
    t:Orientation="6" exif:PixelXDimension="400" xmp:Rating="5" g:UsePanoramaViewer = "True"
    note:HasExtendedXMP="0123456789ABCDEF0123456789ABCDEF">
   <exif:PixelYDimension>300</exif:PixelYDimension>
   <xmp:Thumbnails><rdf:Alt><rdf:li>Zm9v</rdf:li></rdf:Alt></xmp:Thumbnails>
   <c:Directory><c:Directory/><rdf:Seq/></c:Directory>
   <g:ProjectionType>equirectangular</g:ProjectionType>
   <dc:title xmlns:dc="http://purl.org/dc/elements/1.1/">ä &lt; ö</dc:title>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
<?xpacket end="w"?>"#;

fn xmp(packet: &str) -> Xmp {
    Xmp { packet: packet.as_bytes().to_vec(), extended: None }
}

#[test]
fn orientation_and_size_are_corrected_and_nothing_else_is_touched() {
    let mut warnings = Vec::new();
    let read = xmp(PACKET).read((1200, 99), &mut warnings).expect("sound");
    assert!(warnings.is_empty(), "{warnings:?}");
    let expected = PACKET
        .replace(r#"t:Orientation="6""#, r#"t:Orientation="1""#)
        .replace(r#"Dimension="400""#, r#"Dimension="1200""#)
        .replace(">300<", ">99<")
        .replace("<xmp:Thumbnails><rdf:Alt><rdf:li>Zm9v</rdf:li></rdf:Alt></xmp:Thumbnails>", "")
        .replace("<c:Directory><c:Directory/><rdf:Seq/></c:Directory>", "");
    assert_eq!(String::from_utf8(read.packet).expect("text"), expected);
}

#[test]
fn the_geometry_of_a_panorama_goes_with_its_pixels() {
    let (moved, lost) = xmp(PACKET).of_moved_pixels((10, 10));
    let text = String::from_utf8(moved.expect("sound").packet).expect("text");
    assert!(!text.contains("equirectangular") && !text.contains("UsePanoramaViewer"), "{text}");
    assert!(text.contains("xmp:Rating=\"5\"") && text.contains("ä &lt; ö") && lost.is_empty());
}

#[test]
fn a_depth_map_does_not_outlive_a_move_of_the_pixels_and_a_history_does() {
    let with = |extended: &str| Xmp { extended: Some(extended.as_bytes().to_vec()), ..xmp(PACKET) };
    let (moved, lost) = with(r#"xmlns:GDepth="http://ns.google.com/photos/1.0/depthmap/""#).of_moved_pixels((1, 1));
    assert_eq!((moved.expect("a packet").extended, lost.len()), (None, 1));
    let (moved, lost) = with("<rdf:RDF/>").of_moved_pixels((1, 1));
    assert_eq!((moved.expect("a packet").extended.as_deref(), lost.len()), (Some(&b"<rdf:RDF/>"[..]), 0));
    assert_eq!(Xmp::digest(PACKET.as_bytes()), Some("0123456789ABCDEF0123456789ABCDEF"));
}

#[test]
fn what_is_no_xml_is_left_out_with_a_warning() {
    let entities = r#"<!DOCTYPE x [<!ENTITY a "aaaa">]><x/>"#;
    let texts = ["", "text", "<", "<a", "<a b>", "<a b=c>", "<a b='<'>", "<!-- ", "<?x", entities];
    for text in texts {
        let mut warnings = Vec::new();
        assert_eq!(xmp(text).read((1, 1), &mut warnings), None, "{text}");
        assert_eq!(warnings, ["its XMP is damaged and was left out"], "{text}");
    }
    let mut warnings = Vec::new();
    assert_eq!(Xmp { packet: vec![b'<', 0xff, b'>'], extended: None }.read((1, 1), &mut warnings), None);
    assert_eq!(Xmp { packet: vec![b' '; MAX_PACKET + 1], extended: None }.read((1, 1), &mut warnings), None);
    assert!(warnings[1].contains("too long"), "{warnings:?}");
}

#[test]
fn mutated_packets_are_edited_or_refused_and_what_was_edited_stays_so() {
    let mut rng = fastrand::Rng::with_seed(7);
    for _ in 0..5000 {
        let mut wild = PACKET.as_bytes().to_vec();
        for _ in 0..rng.usize(1..6) {
            let (at, from) = (rng.usize(..wild.len()), rng.usize(..PACKET.len()));
            wild[at] = if rng.bool() { rng.u8(..) } else { PACKET.as_bytes()[from] };
        }
        let Some(once) = (Xmp { packet: wild, extended: None }).read((7, 8), &mut Vec::new()) else { continue };
        let twice = once.clone().read((7, 8), &mut Vec::new()).expect("what was edited is XML");
        assert_eq!(once, twice);
    }
}
