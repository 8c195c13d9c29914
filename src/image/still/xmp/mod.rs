//! XMP: kept as text, and corrected where it describes pixels that changed.
//!
//! A packet is RDF in XML. Whoever wrote it may have used any namespace, and readers depend on properties that are unknown here, so that
//! nothing is parsed into a model and written again: tags are found (`tags.rs`), and values that are wrong after a rotation or a
//! resize are replaced in the text. What is wrong whatever its value, such as a thumbnail or the geometry of a
//! panorama, is removed.
//!
//! # Reference
//! ISO 16684-1 (XMP); Adobe, *XMP specification part 3: storage in files*; Google, *Photo Sphere XMP metadata*.

mod tags;

use std::collections::BTreeSet;
use std::ops::Range;

use tags::{Kind, Tag, Tags};

/// Maximum size of a packet, bytes: files of cameras have some 10 kB, edit histories some 100 kB.
const MAX_PACKET: usize = 4 << 20;
/// Maximum size of extended XMP, bytes: depth maps and original pictures in base64 are of some megabytes.
const MAX_EXTENDED: usize = 64 << 20;

/// Namespaces.
const TIFF: &str = "http://ns.adobe.com/tiff/1.0/";
const EXIF: &str = "http://ns.adobe.com/exif/1.0/";
const BASIC: &str = "http://ns.adobe.com/xap/1.0/";
const NOTE: &str = "http://ns.adobe.com/xmp/note/";
const PANORAMA: &str = "http://ns.google.com/photos/1.0/panorama/";
/// Second pictures, films and sounds behind the first picture of a file, none of which is written again.
const APPENDED: [&str; 4] = [
    "http://ns.google.com/photos/1.0/container/",
    "http://ns.google.com/photos/1.0/container/item/",
    "http://ns.google.com/photos/1.0/camera/",
    "http://ns.adobe.com/hdr-gain-map/1.0/",
];
/// Pictures inside extended XMP that belong to the pixels of the file: depth, and the photo before blurring.
const PIXEL_ALIGNED: [&str; 3] = [
    "http://ns.google.com/photos/1.0/depthmap/",
    "http://ns.google.com/photos/1.0/image/",
    "http://ns.google.com/photos/dd/1.0/",
];

/// XMP of a picture: a packet, and in JPEG files what did not fit into it.
///
/// ```
/// use plumbline_image::still::Xmp;
///
/// let packet = br#"<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"/>"#;
/// let xmp = Xmp { packet: packet.to_vec(), extended: None };
/// assert!(xmp.packet.starts_with(b"<rdf"));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Xmp {
    /// The packet, UTF-8.
    pub packet: Vec<u8>,
    /// Extended XMP, which the packet names by its digest; only JPEG has it.
    pub extended: Option<Vec<u8>>,
}

impl Xmp {
    /// XMP as a file has it, said to be upright and of this size, without what describes other pictures in the file. What is left
    /// out is said in `warnings`.
    pub(super) fn read(self, size: (usize, usize), warnings: &mut Vec<String>) -> Option<Self> {
        let long = |what: &str, bytes: usize| format!("its {what} of {bytes} bytes is too long and was left out");
        if self.packet.len() > MAX_PACKET {
            warnings.push(long("XMP", self.packet.len()));
            return None;
        }
        let text = std::str::from_utf8(&self.packet).ok();
        let Some(packet) = text.and_then(|text| edited(text, size, &APPENDED)) else {
            warnings.push("its XMP is damaged and was left out".to_owned());
            return None;
        };
        let extended = self.extended.filter(|extended| {
            let too_long = extended.len() > MAX_EXTENDED;
            warnings.extend(too_long.then(|| long("extended XMP", extended.len())));
            !too_long
        });
        Some(Self { packet, extended })
    }

    /// The packet for pixels of another size.
    pub(super) fn described(&self, size: (usize, usize)) -> Option<Vec<u8>> {
        edited(std::str::from_utf8(&self.packet).ok()?, size, &[])
    }

    /// The same for pixels that were moved: without the geometry of a panorama and pictures that belong to the pixels; the words
    /// name what was left out.
    pub(super) fn of_moved_pixels(&self, size: (usize, usize)) -> (Option<Self>, Vec<&'static str>) {
        let mut lost = Vec::new();
        let Ok(text) = std::str::from_utf8(&self.packet) else { return (None, lost) };
        let packet = edited(text, size, &[PANORAMA]);
        let aligned = |extended: &Vec<u8>| {
            let names = |namespace: &str| extended.windows(namespace.len()).any(|w| w == namespace.as_bytes());
            PIXEL_ALIGNED.iter().any(|n| names(n))
        };
        let extended = self.extended.clone().filter(|e| !aligned(e));
        if extended.is_some() != self.extended.is_some() {
            lost.push("a depth map or another picture in XMP");
        }
        (packet.map(|packet| Self { packet, extended }), lost)
    }

    /// The packet with a description more, behind its others; `None` where it has none.
    pub(super) fn with_description(&self, description: &str) -> Option<Vec<u8>> {
        let text = std::str::from_utf8(&self.packet).ok()?;
        let (mut tags, mut end) = (Tags::new(text), None);
        while let Some(tag) = tags.next_tag().ok()? {
            let name = &text[tag.name.clone()];
            if tag.kind == Kind::Close && name.split_once(':').map_or(name, |(_, local)| local) == "RDF" {
                end = Some(tag.whole.start);
            }
        }
        let (before, after) = text.split_at(end?);
        Some([before, description, after].concat().into_bytes())
    }

    /// A packet of one description.
    pub(super) fn of_description(description: &str) -> Vec<u8> {
        let rdf = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";
        let open = format!("<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"{rdf}\">");
        format!("{open}{description}</rdf:RDF></x:xmpmeta>").into_bytes()
    }

    /// The digest by which the packet names its extension.
    pub(super) fn digest(packet: &[u8]) -> Option<&str> {
        let text = std::str::from_utf8(packet).ok()?;
        let prefixes = prefixes(text, NOTE)?;
        let mut tags = Tags::new(text);
        while let Some(tag) = tags.next_tag().ok()? {
            let value = property(text, &tag, &tags, &prefixes, "HasExtendedXMP").map(|range| text[range].trim());
            if let Some(value) = value.filter(|v| v.len() == DIGEST) {
                return Some(value);
            }
        }
        None
    }
}

/// Characters of a digest (MD5).
pub(super) const DIGEST: usize = 32;

/// Prefixes that are bound to a namespace anywhere; `None` for text that is no XML.
fn prefixes<'t>(text: &'t str, namespace: &str) -> Option<BTreeSet<&'t str>> {
    let (mut found, mut tags) = (BTreeSet::new(), Tags::new(text));
    while let Some(tag) = tags.next_tag().ok()? {
        let bound = tag.attributes.iter().filter(|a| &text[a.value.clone()] == namespace);
        found.extend(bound.filter_map(|a| text[a.name.clone()].strip_prefix("xmlns:")));
    }
    Some(found)
}

/// Local name of a qualified name whose prefix is one of these.
fn local<'t>(name: &'t str, prefixes: &BTreeSet<&str>) -> Option<&'t str> {
    name.split_once(':').filter(|(prefix, _)| prefixes.contains(prefix)).map(|(_, local)| local)
}

/// Where the value of a simple property is, if this tag holds it: an attribute, or an element with text alone.
fn property(text: &str, tag: &Tag, rest: &Tags<'_>, prefixes: &BTreeSet<&str>, name: &str) -> Option<Range<usize>> {
    let is = |range: &Range<usize>| local(&text[range.clone()], prefixes) == Some(name);
    if let Some(attribute) = tag.attributes.iter().find(|a| is(&a.name)) {
        return Some(attribute.value.clone());
    }
    let simple = tag.kind == Kind::Open && is(&tag.name);
    simple.then(|| rest.text_before_closing(&text[tag.name.clone()])).flatten()
}

/// A packet that says that its picture is upright and of this size, without thumbnails and the properties of some namespaces;
/// `None` for what is no XML.
fn edited(text: &str, (width, height): (usize, usize), removed: &[&str]) -> Option<Vec<u8>> {
    let (rules, mut tags) = (Rules::new(text, (width, height), removed)?, Tags::new(text));
    let (mut out, mut done, mut any) = (String::with_capacity(text.len()), 0, false);
    while let Some(tag) = tags.next_tag().ok()? {
        any = true;
        let edits = if tag.kind != Kind::Close && rules.removes(&text[tag.name.clone()]) {
            if tag.kind == Kind::Open {
                tags.skip_to_close(&text[tag.name.clone()])?;
            }
            vec![(tag.whole.start..tags.at(), "")]
        } else {
            rules.edits(text, &tag, &tags)
        };
        for (range, value) in edits {
            out.push_str(&text[done..range.start]);
            out.push_str(value);
            done = range.end;
        }
    }
    out.push_str(&text[done..]);
    any.then(|| out.into_bytes())
}

/// A property that gets a value: prefixes of its namespace, local name, value.
type Value<'t> = (BTreeSet<&'t str>, &'static str, String);

/// What is changed in a packet.
struct Rules<'t> {
    values: Vec<Value<'t>>,
    /// Prefixes of namespaces that go, and of the one whose thumbnails go.
    removed: BTreeSet<&'t str>,
    basic: BTreeSet<&'t str>,
}

impl<'t> Rules<'t> {
    fn new(text: &'t str, (width, height): (usize, usize), removed: &[&str]) -> Option<Self> {
        let [tiff, exif] = [prefixes(text, TIFF)?, prefixes(text, EXIF)?];
        let values = vec![
            (tiff.clone(), "Orientation", "1".to_owned()),
            (tiff.clone(), "ImageWidth", width.to_string()),
            (tiff, "ImageLength", height.to_string()),
            (exif.clone(), "PixelXDimension", width.to_string()),
            (exif, "PixelYDimension", height.to_string()),
        ];
        let removed: Option<Vec<_>> = removed.iter().map(|namespace| prefixes(text, namespace)).collect();
        Some(Self { values, removed: removed?.into_iter().flatten().collect(), basic: prefixes(text, BASIC)? })
    }

    fn removes(&self, name: &str) -> bool {
        local(name, &self.removed).is_some() || local(name, &self.basic) == Some("Thumbnails")
    }

    /// Changes of a tag and the text behind it, in order.
    fn edits(&self, text: &str, tag: &Tag, rest: &Tags<'_>) -> Vec<(Range<usize>, &str)> {
        let gone = tag.attributes.iter().filter(|a| self.removes(&text[a.name.clone()]));
        let mut edits: Vec<(Range<usize>, &str)> = gone.map(|a| (a.whole.clone(), "")).collect();
        edits.extend(
            self.values.iter().filter_map(|(prefixes, name, value)| {
                Some((property(text, tag, rest, prefixes, name)?, value.as_str()))
            }),
        );
        edits.sort_by_key(|(range, _)| range.start);
        edits
    }
}

#[cfg(test)]
mod tests;
