//! Sizes, shapes and directions of pictures, as people write them: `1600x1200`, `60%`, `16:9`, `10,-5,0`.

use std::fmt;
use std::str::FromStr;

use super::units::as_text;
use plumbline_photo::AspectRatio;

/// Largest side of a picture that is rendered, px.
pub const MAX_SIDE: u32 = 16_384;

/// Width and height, px, 1 to 16384 each. Written `"1600x1200"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelSize {
    /// Width, px.
    pub width: u32,
    /// Height, px.
    pub height: u32,
}

/// A size, in full or from one side of the picture. Written `"800x600"`, `"800x"`, `"x600"` or `"60%"`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PictureSize {
    /// Both sides, px.
    Pixels(PixelSize),
    /// The width, px; the height follows from the shape of the picture.
    Width(u32),
    /// The height, px; the width follows from the shape of the picture.
    Height(u32),
    /// Both sides as a percentage of the picture's, above 0 up to 1000.
    Percent(f64),
}

/// A size, or a shape. Written as a [`PictureSize`] or as `"9:16"`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TargetSize {
    /// A size in pixels, or relative to the picture.
    Size(PictureSize),
    /// A shape: the picture keeps one side and loses from the other.
    Shape(AspectRatio),
}

/// Where the viewer looks, degrees from where the camera looked. Written `"YAW,PITCH,ROLL"`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewAngles {
    /// To the right.
    pub yaw: f64,
    /// Up.
    pub pitch: f64,
    /// Clockwise.
    pub roll: f64,
}

/// How much of the world a view shows, degrees. Written `"WIDTH,HEIGHT"`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewField {
    /// From side to side.
    pub width: f64,
    /// From top to bottom.
    pub height: f64,
}

fn positive(text: &str) -> Option<f64> {
    let x: f64 = text.trim().parse().ok()?;
    (x > 0.0 && x.is_finite()).then_some(x)
}

impl FromStr for PixelSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("`{text}` is no size (expected WIDTHxHEIGHT in pixels, 1 to {MAX_SIDE} each, such as 1600x1200)")
        };
        match text.parse() {
            Ok(PictureSize::Pixels(size)) => Ok(size),
            _ => Err(wrong()),
        }
    }
}

/// Largest percentage of a side.
const MAX_PERCENT: f64 = 1000.0;

impl PictureSize {
    /// Both sides, px, of a picture that would be of `natural` px; each at least 1.
    pub fn pixels(self, natural: (usize, usize)) -> (usize, usize) {
        let (w, h) = (natural.0 as f64, natural.1 as f64);
        let scaled = |factor: f64| {
            let side = |side: f64| ((factor * side).round() as usize).max(1);
            (side(w), side(h))
        };
        match self {
            Self::Pixels(size) => (size.width as usize, size.height as usize),
            Self::Width(width) => (width as usize, scaled(f64::from(width) / w).1),
            Self::Height(height) => (scaled(f64::from(height) / h).0, height as usize),
            Self::Percent(percent) => scaled(percent / 100.0),
        }
    }

    /// Both sides, where they do not depend on the picture.
    pub fn exact(self) -> Option<(usize, usize)> {
        if let Self::Pixels(size) = self { Some((size.width as usize, size.height as usize)) } else { None }
    }
}

impl FromStr for PictureSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let wrong = || {
            format!(
                "`{text}` is no size (expected WIDTHxHEIGHT, WIDTHx or xHEIGHT in pixels, 1 to {MAX_SIDE} each, such as \
                 1600x1200, or a percentage above 0 up to {MAX_PERCENT} such as 60%)"
            )
        };
        if let Some(percent) = text.strip_suffix('%') {
            return positive(percent).filter(|p| *p <= MAX_PERCENT).map(Self::Percent).ok_or_else(wrong);
        }
        let side = |t: &str| t.trim().parse::<u32>().ok().filter(|s| (1..=MAX_SIDE).contains(s)).ok_or_else(wrong);
        match text.split_once(['x', 'X', '×']).ok_or_else(wrong)? {
            ("", "") => Err(wrong()),
            (width, "") => side(width).map(Self::Width),
            ("", height) => side(height).map(Self::Height),
            (width, height) => Ok(Self::Pixels(PixelSize { width: side(width)?, height: side(height)? })),
        }
    }
}

impl fmt::Display for PictureSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pixels(size) => size.fmt(f),
            Self::Width(width) => write!(f, "{width}x"),
            Self::Height(height) => write!(f, "x{height}"),
            Self::Percent(percent) => write!(f, "{percent}%"),
        }
    }
}

impl fmt::Display for PixelSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl TargetSize {
    /// Pixels for a picture of `source` px: of a shape, the largest that is nowhere larger than the picture.
    pub fn pixels(self, source: (usize, usize)) -> (usize, usize) {
        match self {
            Self::Size(size) => size.pixels(source),
            Self::Shape(ratio) => {
                let (w, h) = (source.0 as f64, source.1 as f64);
                let width = w.min(h * ratio.value());
                let height = h.min(w / ratio.value());
                ((width.round() as usize).max(1), (height.round() as usize).max(1))
            }
        }
    }
}

impl FromStr for TargetSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.contains(':') {
            text.parse().map(Self::Shape)
        } else {
            text.parse().map(Self::Size).map_err(|e: String| format!("{e}; or a shape such as 16:9"))
        }
    }
}

impl fmt::Display for TargetSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size(size) => size.fmt(f),
            Self::Shape(ratio) => ratio.fmt(f),
        }
    }
}

impl FromStr for ViewAngles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no direction (expected YAW,PITCH,ROLL in degrees: -180 to 180, -90 to 90, -180 to 180; the last may \
                 be left out)"
            )
        };
        let numbers: Option<Vec<f64>> = text.split(',').map(|t| t.trim().parse().ok()).collect();
        let angle = |i: usize, most: f64| {
            let value = numbers.as_ref()?.get(i).copied().unwrap_or(0.0);
            (-most..=most).contains(&value).then_some(value)
        };
        if numbers.as_ref().is_none_or(|n| n.is_empty() || n.len() > 3) {
            return Err(wrong());
        }
        let angles = angle(0, 180.0).zip(angle(1, 90.0)).zip(angle(2, 180.0));
        angles.map(|((yaw, pitch), roll)| Self { yaw, pitch, roll }).ok_or_else(wrong)
    }
}

impl fmt::Display for ViewAngles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{}", self.yaw, self.pitch, self.roll)
    }
}

impl FromStr for ViewField {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text.split_once(',').map(|(w, h)| (positive(w), positive(h)));
        match sides {
            Some((Some(width), Some(height))) if width <= 360.0 && height < 180.0 => Ok(Self { width, height }),
            _ => Err(format!("`{text}` is no field (expected WIDTH,HEIGHT in degrees: up to 360, below 180)")),
        }
    }
}

impl fmt::Display for ViewField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{}", self.width, self.height)
    }
}

as_text! {
    PixelSize: "a size such as \"1600x1200\"", {"type": "string", "pattern": "^[0-9]+[xX×][0-9]+$"};
    PictureSize: "a size such as \"1600x1200\", \"800x\", \"x600\" or \"60%\"",
        {"type": "string", "pattern": "^[0-9]+[xX×][0-9]*$|^[xX×][0-9]+$|^[0-9.]+%$"};
    TargetSize: "a size such as \"1080x1920\", \"800x\", \"x600\" or \"60%\", or a shape such as \"9:16\"",
        {"type": "string", "pattern": "^[0-9]+[xX×][0-9]*$|^[xX×][0-9]+$|^[0-9.]+%$|^[0-9.]+:[0-9.]+$"};
    ViewField: "\"WIDTH,HEIGHT\" in degrees", {"type": "string", "pattern": "^[0-9.]+,[0-9.]+$"};
    ViewAngles: "\"YAW,PITCH,ROLL\" in degrees", {"type": "string", "pattern": "^-?[0-9.]+(,-?[0-9.]+){0,2}$"};
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip<T: FromStr<Err = String> + fmt::Display + PartialEq + fmt::Debug>(text: &str) {
        let value: T = text.parse().unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(value.to_string(), text);
        assert_eq!(value.to_string().parse::<T>().as_ref(), Ok(&value));
    }

    #[test]
    fn what_is_written_reads_back() {
        for t in ["1x1", "16384x2", "1600x1200"] {
            round_trip::<PixelSize>(t);
        }
        for t in ["9:16", "1.91:1", "640x480"] {
            round_trip::<TargetSize>(t);
        }
        for t in ["800x", "x600", "60%", "12.5%", "800x600"] {
            round_trip::<PictureSize>(t);
            round_trip::<TargetSize>(t);
        }
        for t in ["0,0,0", "10,-5.5,180"] {
            round_trip::<ViewAngles>(t);
        }
        for t in ["100,75", "360,179.5"] {
            round_trip::<ViewField>(t);
        }
        assert_eq!("30".parse(), Ok(ViewAngles { yaw: 30.0, ..ViewAngles::default() }));
    }

    #[test]
    fn nonsense_is_refused_with_what_is_expected() {
        for text in ["", "0x5", "5x0", "100000x5", "5", "-5x5", "5x5x5", "nanxnan"] {
            assert!(text.parse::<PixelSize>().is_err_and(|e| e.contains("1600x1200")), "{text}");
        }
        for text in ["x", "0x", "x0", "0%", "-5%", "nan%", "1001%", "%", "60", "5x5%"] {
            let all = ["1600x1200", "60%", "xHEIGHT"];
            assert!(text.parse::<PictureSize>().is_err_and(|e| all.iter().all(|word| e.contains(word))), "{text}");
        }
        for text in ["0:1", "1:0", "nan:1", "1:1000", ":", "inf:inf"] {
            assert!(text.parse::<TargetSize>().is_err_and(|e| e.contains("16:9")), "{text}");
        }
        for text in ["", "90", "0,50", "361,50", "90,180", "nan,50"] {
            assert!(text.parse::<ViewField>().is_err_and(|e| e.contains("WIDTH,HEIGHT")), "{text}");
        }
        for text in ["", "1,2,3,4", "0,91,0", "nan,0,0", "a"] {
            assert!(text.parse::<ViewAngles>().is_err_and(|e| e.contains("PITCH")), "{text}");
        }
    }

    #[test]
    fn a_shape_is_the_largest_inside_the_picture() {
        let pixels = |text: &str, source| text.parse::<TargetSize>().expect("a size").pixels(source);
        assert_eq!(pixels("9:16", (1920, 1080)), (608, 1080));
        assert_eq!(pixels("16:9", (1000, 1000)), (1000, 563));
        assert_eq!(pixels("3:2", (3000, 2000)), (3000, 2000));
        assert_eq!(pixels("100:1", (3, 3)), (3, 1));
        assert_eq!(pixels("640x48", (3, 3)), (640, 48));
    }

    #[test]
    fn one_side_or_a_percentage_keeps_the_shape_of_the_picture() {
        for (text, expected) in [
            ("800x", (800, 600)),
            ("x600", (800, 600)),
            ("60%", (1920, 1440)),
            ("200%", (6400, 4800)),
            ("0.001%", (1, 1)),
        ] {
            let size: PictureSize = text.parse().expect("a size");
            assert_eq!(size.pixels((3200, 2400)), expected, "{text}");
        }
    }
}
