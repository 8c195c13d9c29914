//! Values with a unit: positions in a clip, sizes in bytes, bit rates, frame rates. Each reads what people write and prints what it reads.

use std::fmt;
use std::str::FromStr;

use serde::de::{self, Deserializer, Visitor};
use serde::{Serialize, Serializer};

use plumbline_media::Ratio;

/// A position in a clip: seconds from its start, ≥ 0. Written `12.5`, `"1:02.5"` or `"00:00:12.5"`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct ClipTime(f64);

impl ClipTime {
    /// Seconds from the clip's start; `None` unless finite and ≥ 0.
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        (seconds.is_finite() && seconds >= 0.0).then_some(Self(seconds))
    }

    /// Seconds from the clip's start.
    pub fn seconds(self) -> f64 {
        self.0
    }
}

impl FromStr for ClipTime {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no position in a clip (expected seconds or [HH:]MM:SS, not negative)");
        let parts: Vec<&str> = text.trim().split(':').collect();
        let (seconds, longer) = parts.split_last().ok_or_else(wrong)?;
        let digits = |s: &str| !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit() || b == b'.');
        if longer.len() > 2 || !digits(seconds) {
            return Err(wrong());
        }
        let mut total = seconds.parse::<f64>().map_err(|_| wrong())?;
        if !longer.is_empty() && total >= 60.0 {
            return Err(wrong());
        }
        for (unit, part) in [60.0, 3600.0].into_iter().zip(longer.iter().rev()) {
            total += unit * f64::from(part.parse::<u32>().map_err(|_| wrong())?);
        }
        Self::from_seconds(total).ok_or_else(wrong)
    }
}

impl fmt::Display for ClipTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// A size in bytes. Written `1048576`, `"256MiB"`, `"1.5GB"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ByteSize(pub u64);

/// A bit rate in bits per second, > 0. Written `6000000`, `"6M"`, `"800k"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BitRate(pub u64);

/// Frames per second, above 0 up to 1000. Written `24`, `"23.976"` or `"30000/1001"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRate(Ratio);

impl FrameRate {
    /// Largest rate, 1/s.
    const MAX: f64 = 1000.0;

    /// The rate as a fraction, 1/s.
    pub fn ratio(self) -> Ratio {
        self.0
    }

    /// Rates such as 23.976 and 59.94 mean `1000 n / 1001`; others are taken to the thousandth.
    fn from_decimal(rate: f64) -> Option<Ratio> {
        let nominal = (rate * 1.001).round();
        let broadcast = (nominal / 1.001 - rate).abs() < 5e-4 && rate.fract() != 0.0;
        let thousandths = (rate * 1e3).round();
        match broadcast {
            true => Ratio::new(nominal as i32 * 1000, 1001),
            false if thousandths % 1e3 == 0.0 => Ratio::new(rate as i32, 1),
            false => Ratio::new(thousandths as i32, 1000),
        }
    }
}

impl FromStr for FrameRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let ratio = match text.split_once('/') {
            Some((num, den)) => num.parse().ok().zip(den.parse().ok()).and_then(|(num, den)| Ratio::new(num, den)),
            None => text.parse().ok().filter(|r| *r > 0.0 && *r <= Self::MAX).and_then(Self::from_decimal),
        };
        let wrong =
            || format!("`{text}` is no frame rate (expected frames per second above 0 up to 1000, or a fraction)");
        ratio.filter(|r| r.value() <= Self::MAX).map(Self).ok_or_else(wrong)
    }
}

impl fmt::Display for FrameRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.den == 1 { write!(f, "{}", self.0.num) } else { write!(f, "{}", self.0) }
    }
}

impl Serialize for FrameRate {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        if self.0.den == 1 { s.serialize_i32(self.0.num) } else { s.collect_str(self) }
    }
}

const BYTE_UNITS: [(&str, f64); 7] = [
    ("KiB", 1024.0),
    ("MiB", 1_048_576.0),
    ("GiB", 1_073_741_824.0),
    ("KB", 1e3),
    ("MB", 1e6),
    ("GB", 1e9),
    ("B", 1.0),
];
const RATE_UNITS: [(&str, f64); 3] = [("k", 1e3), ("M", 1e6), ("G", 1e9)];

/// `number [unit]`; units are tried in order and compared without case where that is unambiguous.
fn scaled(text: &str, units: &[(&str, f64)]) -> Option<u64> {
    let text = text.trim();
    let unit = units
        .iter()
        .find(|(u, _)| text.len() > u.len() && text.to_ascii_lowercase().ends_with(&u.to_ascii_lowercase()));
    let (number, factor) = unit.map_or((text, 1.0), |(u, f)| (&text[..text.len() - u.len()], *f));
    let value = number.trim().parse::<f64>().ok()? * factor;
    (value.is_finite() && (0.0..9e18).contains(&value)).then_some(value.round() as u64)
}

impl FromStr for ByteSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no size (expected bytes, or a number with KiB, MiB, GiB, KB, MB or GB)");
        scaled(text, &BYTE_UNITS).map(Self).ok_or_else(wrong)
    }
}

impl fmt::Display for ByteSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            b if b > 0 && b % (1 << 30) == 0 => write!(f, "{}GiB", b >> 30),
            b if b > 0 && b % (1 << 20) == 0 => write!(f, "{}MiB", b >> 20),
            b if b > 0 && b % (1 << 10) == 0 => write!(f, "{}KiB", b >> 10),
            b => write!(f, "{b}"),
        }
    }
}

impl FromStr for BitRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("`{text}` is no bit rate (expected bits per second above 0, or a number with k, M or G)");
        scaled(text, &RATE_UNITS).filter(|r| *r > 0).map(Self).ok_or_else(wrong)
    }
}

impl fmt::Display for BitRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            r if r % 1_000_000 == 0 => write!(f, "{}M", r / 1_000_000),
            r if r % 1000 == 0 => write!(f, "{}k", r / 1000),
            r => write!(f, "{r}"),
        }
    }
}

/// Reads a number or a string through `FromStr`, whichever it finds.
pub(super) fn number_or_text<'de, D, T>(deserializer: D, expected: &'static str) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr<Err = String>,
{
    struct Either<T>(&'static str, std::marker::PhantomData<T>);
    impl<T: FromStr<Err = String>> Visitor<'_> for Either<T> {
        type Value = T;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(self.0)
        }
        fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
            text.parse().map_err(E::custom)
        }
        fn visit_f64<E: de::Error>(self, x: f64) -> Result<T, E> {
            self.visit_str(&x.to_string())
        }
        fn visit_i64<E: de::Error>(self, x: i64) -> Result<T, E> {
            self.visit_str(&x.to_string())
        }
        fn visit_u64<E: de::Error>(self, x: u64) -> Result<T, E> {
            self.visit_str(&x.to_string())
        }
    }
    deserializer.deserialize_any(Either(expected, std::marker::PhantomData))
}

impl Serialize for ClipTime {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_f64(self.0)
    }
}

/// Read as a number or as text; in the schema as it says.
macro_rules! from_text {
    ($($name:ident: $expected:literal, $schema:tt;)*) => {$(
        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                $crate::pipeline::units::number_or_text(d, $expected)
            }
        }

        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!($schema)
            }
        }
    )*};
}

/// The same, and written as text.
macro_rules! as_text {
    ($($name:ident: $expected:literal, $schema:tt;)*) => {
        $crate::pipeline::units::from_text! { $($name: $expected, $schema;)* }
        $(
            impl serde::Serialize for $name {
                fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                    s.collect_str(self)
                }
            }
        )*
    };
}

pub(super) use {as_text, from_text};

from_text! {
    ClipTime: "seconds or \"[HH:]MM:SS\"",
        {"anyOf": [{"type": "number", "minimum": 0}, {"type": "string", "pattern": "^([0-9]+:){0,2}[0-9.]+$"}]};
    FrameRate: "frames per second such as 24 or \"30000/1001\"",
        {"anyOf": [
            {"type": "number", "exclusiveMinimum": 0, "maximum": 1000},
            {"type": "string", "pattern": "^[0-9.]+(/[0-9]+)?$"}
        ]};
}

as_text! {
    ByteSize: "a size such as \"256MiB\"",
        {"anyOf": [
            {"type": "integer", "minimum": 0},
            {"type": "string", "pattern": "^[0-9.]+ *([KMGkmg]i?)?[Bb]?$"}
        ]};
    BitRate: "a bit rate such as \"6M\"",
        {"anyOf": [{"type": "integer", "minimum": 1}, {"type": "string", "pattern": "^[0-9.]+ *[kKMmGg]?$"}]};
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_read_like_a_clock() {
        for (text, seconds) in [("0", 0.0), ("12.5", 12.5), ("1:02.5", 62.5), ("01:00:00", 3600.0), ("90", 90.0)] {
            assert_eq!(text.parse::<ClipTime>().map(ClipTime::seconds), Ok(seconds), "{text}");
        }
        for text in ["", "-1", "nan", "inf", "1e3", "1:2:3:4", "1:75", "a:10", "1::2"] {
            assert!(text.parse::<ClipTime>().is_err(), "{text}");
        }
    }

    #[test]
    fn frame_rates_read_what_people_call_them() {
        for (text, num, den) in [
            ("24", 24, 1),
            ("25.0", 25, 1),
            ("23.976", 24000, 1001),
            ("23.98", 2398, 100),
            ("29.97", 30000, 1001),
            ("59.94", 60000, 1001),
            ("12.5", 12500, 1000),
            ("30000/1001", 30000, 1001),
            ("1/2", 1, 2),
        ] {
            let rate: FrameRate = text.parse().expect(text);
            assert!((rate.ratio().value() - f64::from(num) / f64::from(den)).abs() < 1e-9, "{text}: {rate}");
            assert_eq!(rate.to_string().parse(), Ok(rate));
        }
        for text in ["", "0", "-1", "nan", "inf", "1001", "1/0", "0/1", "2000/1", "a/b"] {
            assert!(text.parse::<FrameRate>().is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_and_rates_read_their_units_and_print_what_they_read() {
        for (text, bytes) in [("256MiB", 256 << 20), ("1.5GB", 1_500_000_000), ("10", 10), ("2 kib", 2048), ("0", 0)] {
            let size: ByteSize = text.parse().unwrap_or(ByteSize(u64::MAX));
            assert_eq!(size.0, bytes, "{text}");
            assert_eq!(size.to_string().parse(), Ok(size));
        }
        for (text, rate) in [("6M", 6_000_000), ("800k", 800_000), ("1.5M", 1_500_000), ("123", 123)] {
            let read: BitRate = text.parse().unwrap_or(BitRate(0));
            assert_eq!(read.0, rate, "{text}");
            assert_eq!(read.to_string().parse(), Ok(read));
        }
        for text in ["", "MiB", "-1", "nan", "inf MiB", "1e40"] {
            assert!(text.parse::<ByteSize>().is_err(), "{text}");
        }
        assert!("0".parse::<BitRate>().is_err());
    }
}
