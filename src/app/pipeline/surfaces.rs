//! Colors as people write them: `white`, `#204060`.

use std::fmt;
use std::str::FromStr;

use super::units::as_text;
use plumbline_image::canvas::Rgb;

/// Color behind a mesh. Written `"#204060"`, `"white"` or `"black"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackgroundColor(pub Rgb);

impl FromStr for BackgroundColor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no color (expected white, black, gray, or #RRGGBB such as #204060)");
        let hex = match text.trim() {
            "white" => "ffffff",
            "black" => "000000",
            "gray" | "grey" => "808080",
            other => other.strip_prefix('#').filter(|h| h.len() == 6 && h.is_ascii()).ok_or_else(wrong)?,
        };
        let part = |i: usize| u8::from_str_radix(&hex[i..i + 2], 16).map_err(|_| wrong());
        Ok(Self([part(0)?, part(2)?, part(4)?]))
    }
}

impl fmt::Display for BackgroundColor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "#{r:02x}{g:02x}{b:02x}")
    }
}

as_text! {
    BackgroundColor: "a color such as \"white\" or \"#204060\"",
        {"type": "string", "pattern": "^white$|^black$|^gray$|^#[0-9a-fA-F]{6}$"};
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back_and_nonsense_is_refused_with_what_is_expected() {
        assert_eq!("white".parse::<BackgroundColor>().map(|c| c.to_string()).as_deref(), Ok("#ffffff"));
        for text in ["", "#12345", "#12345g", "red", "#ééé"] {
            assert!(text.parse::<BackgroundColor>().is_err_and(|e| e.contains("#204060")), "{text}");
        }
    }
}
