//! Text in HTML and XML.

use std::fmt::{self, Display, Write};

/// Shows its content as text of an element or of a quoted attribute.
///
/// What no XML may hold (control characters) becomes U+FFFD: names of files may be made of anything.
pub(super) struct Text<T>(pub(super) T);

impl<T: Display> Display for Text<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(Escaping(f), "{}", self.0)
    }
}

struct Escaping<'a, 'f>(&'a mut fmt::Formatter<'f>);

impl Write for Escaping<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|c| match c {
            '&' => self.0.write_str("&amp;"),
            '<' => self.0.write_str("&lt;"),
            '>' => self.0.write_str("&gt;"),
            '"' => self.0.write_str("&quot;"),
            '\'' => self.0.write_str("&#39;"),
            '\t' | '\n' => self.0.write_char(' '),
            '\u{fffe}' | '\u{ffff}' => self.0.write_char('\u{fffd}'),
            c if c.is_control() => self.0.write_char('\u{fffd}'),
            c => self.0.write_char(c),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_ends_an_element_or_an_attribute() {
        assert_eq!(Text("<b>&\".mp4").to_string(), "&lt;b&gt;&amp;&quot;.mp4");
        assert_eq!(Text("it's").to_string(), "it&#39;s");
        assert_eq!(Text("a\u{1b}[31m\nb\u{0}\u{ffff}").to_string(), "a\u{fffd}[31m b\u{fffd}\u{fffd}");
        assert_eq!(Text("Übung 1 – 2×, 視").to_string(), "Übung 1 – 2×, 視");
    }
}
