//! Memory of the values of a JSON text, bounded before they are read.
//!
//! A list of empty objects has 3 bytes for each, and in memory hundreds. A text is therefore scanned once for brackets and commas
//! outside of strings, and refused where its values could need far more memory than it has bytes.

use std::cell::Cell;
use std::fmt;
use std::io::{self, BufRead};

use serde::Deserializer;
use serde::de::{self, DeserializeSeed, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

/// Memory for each byte of a file, and for any file: no reader needs more.
const PER_BYTE: u64 = 9;
const FREE: u64 = 150 << 20;

/// Bytes in memory that the values of a file of `file_bytes` may take. With the file itself and the program that makes ten times the
/// file and 200 MB.
pub fn max_memory_of(file_bytes: u64) -> u64 {
    FREE.saturating_add(PER_BYTE.saturating_mul(file_bytes))
}

/// Bytes in memory of the values of a text, at most.
#[derive(Clone, Copy, Debug)]
pub struct JsonCosts {
    /// Of an object.
    pub object: u64,
    /// Of a list, without its items.
    pub list: u64,
    /// Of an item or member that is no object or list.
    pub item: u64,
    /// Of a `null` beyond that: the largest value could stand there.
    pub null: u64,
}

impl JsonCosts {
    /// Of texts that are read into structs: the largest struct has some hundred bytes, an item of a list is a number or a choice.
    pub const OF_STRUCTS: Self = Self { object: 400, list: 64, item: 24, null: 0 };
    /// Of streams of frames: numbers go to packed stores, the largest entry of a frame (a camera) has 96 bytes.
    pub const OF_STREAMS: Self = Self { object: 150, list: 40, item: 8, null: 96 };
    /// Of texts that are kept as [`serde_json::Value`] in part: a map allocates nodes of eleven members.
    pub const OF_VALUES: Self = Self { object: 650, list: 160, item: 32, null: 0 };

    /// Refuses a text whose values could need more memory than a file of `file_bytes` allows: the error is the bound on that memory.
    ///
    /// # Errors
    /// Bytes in memory, at most.
    pub fn check(&self, text: &[u8], file_bytes: u64) -> Result<(), u64> {
        Scan::default().of(self, text).within(file_bytes)
    }

    /// As [`Self::check`], of a text that is read piece by piece.
    ///
    /// # Errors
    /// The text cannot be read; within, the bytes in memory, at most.
    pub fn check_stream(&self, mut text: impl BufRead) -> io::Result<Result<(), u64>> {
        let (mut scan, mut length) = (Scan::default(), 0);
        loop {
            let piece = match text.fill_buf() {
                Ok([]) => return Ok(scan.within(length as u64)),
                Ok(piece) => piece,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            };
            scan = scan.of(self, piece);
            length += piece.len();
            let read = piece.len();
            text.consume(read);
        }
    }
}

/// A scan of a text for what stands outside of strings, up to some byte.
#[derive(Clone, Copy, Default)]
struct Scan {
    /// Bound on the memory of the values so far, bytes.
    sum: u64,
    in_string: bool,
    escaped: bool,
}

impl Scan {
    fn of(self, costs: &JsonCosts, text: &[u8]) -> Self {
        let Self { mut sum, mut in_string, mut escaped } = self;
        for byte in text {
            match byte {
                _ if escaped => escaped = false,
                b'\\' => escaped = in_string,
                b'"' => in_string = !in_string,
                _ if in_string => {}
                b'{' => sum += costs.object,
                b'[' => sum += costs.list,
                b',' => sum += costs.item,
                // No other word of JSON has the letter.
                b'n' => sum += costs.null,
                _ => {}
            }
        }
        Self { sum, in_string, escaped }
    }

    fn within(self, file_bytes: u64) -> Result<(), u64> {
        if self.sum <= max_memory_of(file_bytes) { Ok(()) } else { Err(self.sum) }
    }
}

/// Reads a value of any kind whose memory is limited, for documents that are too large to be scanned as a whole.
#[derive(Clone, Copy, Debug)]
pub struct ValueWithin<'a> {
    /// Bytes in memory that values may still take.
    pub left: &'a Cell<u64>,
}

impl ValueWithin<'_> {
    fn spend<E: de::Error>(self, bytes: u64) -> Result<(), E> {
        let left = self.left.get().checked_sub(bytes);
        self.left.set(left.ok_or_else(|| E::custom("too many values in blocks of other programs"))?);
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for ValueWithin<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for ValueWithin<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_bool<E: de::Error>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_str<E: de::Error>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_unit<E: de::Error>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        self.spend(JsonCosts::OF_VALUES.list)?;
        let mut list = Vec::new();
        while let Some(item) = items.next_element_seed(self)? {
            self.spend(JsonCosts::OF_VALUES.item)?;
            list.push(item);
        }
        Ok(list.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Value, A::Error> {
        self.spend(JsonCosts::OF_VALUES.object)?;
        let mut map = serde_json::Map::new();
        while let Some(key) = members.next_key::<String>()? {
            self.spend(JsonCosts::OF_VALUES.item)?;
            map.insert(key, members.next_value_seed(self)?);
        }
        Ok(map.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_they_are_up_to_their_limit() {
        let text = r#"{"a": [1, -2, 0.5, null, true, "b\n"], "c": {"d": []}}"#;
        let read = |bytes| {
            let left = Cell::new(bytes);
            ValueWithin { left: &left }.deserialize(&mut serde_json::Deserializer::from_str(text))
        };
        assert_eq!(read(10_000).unwrap(), serde_json::from_str::<Value>(text).unwrap());
        assert!(read(1000).unwrap_err().to_string().contains("too many values"));
    }

    #[test]
    fn brackets_and_commas_in_strings_cost_nothing() {
        let costs = JsonCosts { object: 100, list: 10, item: 1, null: 5 };
        for (text, bytes) in [
            (r#"{"a": [1, 2], "b": {}}"#, 212),
            (r#"["a,[{", "\"],[{n", "\\"]"#, 12),
            (r#"[null, true, "null"]"#, 17),
            ("", 0),
            (r#""abc,"#, 0),
        ] {
            assert_eq!(Scan::default().of(&costs, text.as_bytes()).sum, bytes, "{text}");
            let (before, after) = text.as_bytes().split_at(text.len() / 2);
            assert_eq!(Scan::default().of(&costs, before).of(&costs, after).sum, bytes, "{text}, in two pieces");
        }
    }

    #[test]
    fn a_stream_is_refused_as_its_text_is() {
        for (count, fits) in [(1_000_000, true), (5_000_000, false)] {
            let text = "null,".repeat(count);
            let costs = JsonCosts::OF_STREAMS;
            let streamed = costs.check_stream(io::BufReader::new(text.as_bytes())).expect("no fault");
            assert_eq!(streamed, costs.check(text.as_bytes(), text.len() as u64));
            assert_eq!(streamed.is_ok(), fits, "{count}");
        }
    }

    #[test]
    fn small_texts_pass_and_large_ones_by_their_density() {
        let objects = |n: usize, one: &str| one.repeat(n);
        assert!(JsonCosts::OF_VALUES.check(objects(200_000, "{},").as_bytes(), 600_000).is_ok());
        assert!(JsonCosts::OF_VALUES.check(objects(1_000_000, "{},").as_bytes(), 3_000_000).is_err());
        let joint = r#"{"name": "left upper arm", "parent": "left clavicle", "translation": [0.1, 0.2, 0.3]},"#;
        assert!(
            JsonCosts::OF_STRUCTS.check(objects(1_000_000, joint).as_bytes(), joint.len() as u64 * 1_000_000).is_ok()
        );
    }
}
