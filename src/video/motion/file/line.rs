//! The line of a value in a JSON text.

/// The line, from 1, in which the value at `path` begins, such as `frames[3].pts`; `None` where there is none. `text` must be
/// valid JSON; otherwise the result is meaningless.
pub(super) fn line_of(text: &[u8], path: &str) -> Option<usize> {
    let mut cursor = Cursor { text, at: 0 };
    for step in path.split(['.', '[']) {
        match step.strip_suffix(']') {
            Some(index) => cursor.enter_list(index.parse().ok()?)?,
            None => cursor.enter_object(step)?,
        }
    }
    cursor.skip_space();
    Some(text[..cursor.at].split(|b| *b == b'\n').count())
}

struct Cursor<'a> {
    text: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while self.peek().is_some_and(|b| b.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// Steps over `byte` and the space before it.
    fn expect(&mut self, byte: u8) -> Option<()> {
        self.skip_space();
        (self.peek()? == byte).then(|| self.at += 1)
    }

    /// To the entry `index` of a list.
    fn enter_list(&mut self, index: usize) -> Option<()> {
        self.expect(b'[')?;
        for _ in 0..index {
            self.skip_value()?;
            self.expect(b',')?;
        }
        self.skip_space();
        (self.peek()? != b']').then_some(())
    }

    /// To the value of `key` in an object.
    fn enter_object(&mut self, key: &str) -> Option<()> {
        self.expect(b'{')?;
        loop {
            self.skip_space();
            let start = self.at;
            self.skip_value()?;
            let found = self.text.get(start + 1..self.at - 1)? == key.as_bytes();
            self.expect(b':')?;
            if found {
                return Some(());
            }
            self.skip_value()?;
            self.expect(b',')?;
        }
    }

    /// Over a value of any kind.
    fn skip_value(&mut self) -> Option<()> {
        self.skip_space();
        let mut depth = 0_usize;
        loop {
            match self.peek()? {
                b'"' => self.skip_string()?,
                b'[' | b'{' => (depth, self.at) = (depth + 1, self.at + 1),
                b']' | b'}' => (depth, self.at) = (depth.checked_sub(1)?, self.at + 1),
                _ => self.at += 1,
            }
            let ended = self.peek().is_none_or(|b| matches!(b, b',' | b':' | b']' | b'}') || b.is_ascii_whitespace());
            if depth == 0 && ended {
                return Some(());
            }
        }
    }

    fn skip_string(&mut self) -> Option<()> {
        self.at += 1;
        loop {
            match self.peek()? {
                b'\\' => self.at += 2,
                b'"' => {
                    self.at += 1;
                    return Some(());
                }
                _ => self.at += 1,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_found_by_its_path() {
        let text =
            b"{ \"a\": [1,\n {\"x, \\\"y\": [2, 3],\n \"b\" : \"]\",\n\n\"c\": -1.5e3 }, []],\n\"d\":{}\n,\"e\": null}";
        for (path, line) in [
            ("a", Some(1)),
            ("a[0]", Some(1)),
            ("a[1].b", Some(3)),
            ("a[1].c", Some(5)),
            ("a[2]", Some(5)),
            ("d", Some(6)),
            ("e", Some(7)),
            ("a[3]", None),
            ("a[2][0]", None),
            ("f", None),
            ("motion of frame 3", None),
        ] {
            assert_eq!(line_of(text, path), line, "{path}");
        }
        assert_eq!(line_of(b"", "a"), None);
        assert_eq!(line_of(b"{\"a\": \"\\", "b"), None);
    }
}
