//! Capitals, digits and a few marks as 5×7 dots: enough to label a picture without a font file.

/// Seven rows of five dots per character, the leftmost dot in bit 4.
#[rustfmt::skip]
const GLYPHS: [(char, [u8; 7]); 47] = [
    ('A', [14, 17, 17, 31, 17, 17, 17]), ('B', [30, 17, 17, 30, 17, 17, 30]), ('C', [14, 17, 16, 16, 16, 17, 14]),
    ('D', [30, 17, 17, 17, 17, 17, 30]), ('E', [31, 16, 16, 30, 16, 16, 31]), ('F', [31, 16, 16, 30, 16, 16, 16]),
    ('G', [14, 17, 16, 23, 17, 17, 15]), ('H', [17, 17, 17, 31, 17, 17, 17]), ('I', [14, 4, 4, 4, 4, 4, 14]),
    ('J', [7, 2, 2, 2, 2, 18, 12]),      ('K', [17, 18, 20, 24, 20, 18, 17]), ('L', [16, 16, 16, 16, 16, 16, 31]),
    ('M', [17, 27, 21, 21, 17, 17, 17]), ('N', [17, 17, 25, 21, 19, 17, 17]), ('O', [14, 17, 17, 17, 17, 17, 14]),
    ('P', [30, 17, 17, 30, 16, 16, 16]), ('Q', [14, 17, 17, 17, 21, 18, 13]), ('R', [30, 17, 17, 30, 20, 18, 17]),
    ('S', [15, 16, 16, 14, 1, 1, 30]),   ('T', [31, 4, 4, 4, 4, 4, 4]),       ('U', [17, 17, 17, 17, 17, 17, 14]),
    ('V', [17, 17, 17, 17, 17, 10, 4]),  ('W', [17, 17, 17, 21, 21, 21, 10]), ('X', [17, 17, 10, 4, 10, 17, 17]),
    ('Y', [17, 17, 17, 10, 4, 4, 4]),    ('Z', [31, 1, 2, 4, 8, 16, 31]),     ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),      ('2', [14, 17, 1, 2, 4, 8, 31]),     ('3', [31, 2, 4, 2, 1, 17, 14]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),     ('5', [31, 16, 30, 1, 1, 17, 14]),   ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),       ('8', [14, 17, 17, 14, 17, 17, 14]), ('9', [14, 17, 17, 15, 1, 2, 12]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),      (',', [0, 0, 0, 0, 12, 4, 8]),       (':', [0, 12, 12, 0, 12, 12, 0]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),       ('+', [0, 4, 4, 31, 4, 4, 0]),       ('=', [0, 0, 31, 0, 31, 0, 0]),
    ('/', [0, 1, 2, 4, 8, 16, 0]),       ('%', [24, 25, 2, 4, 8, 19, 3]),     ('(', [2, 4, 8, 8, 8, 4, 2]),
    (')', [8, 4, 2, 2, 2, 4, 8]),        ('_', [0, 0, 0, 0, 0, 0, 31]),
];

/// Glyph of characters that the font lacks: a frame.
const UNKNOWN: [u8; 7] = [31, 17, 17, 17, 17, 17, 31];

/// (column, row) of every dot of `c`, columns 0 to 4, rows 0 to 6. Small letters look like capitals.
pub fn dots(c: char) -> impl Iterator<Item = (usize, usize)> {
    let wanted = c.to_ascii_uppercase();
    let known = GLYPHS.iter().find(|(known, _)| *known == wanted).map_or(UNKNOWN, |(_, rows)| *rows);
    let rows = if c == ' ' { [0; 7] } else { known };
    (0..35).map(|i| (i % 5, i / 5)).filter(move |(column, row)| rows[*row] >> (4 - column) & 1 == 1)
}

/// Width of a line of text, px; its height is `8 · scale`.
pub fn text_width(text: &str, scale: usize) -> usize {
    text.chars().count() * 6 * scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glyphs_differ_fit_their_cell_and_small_letters_look_like_capitals() {
        for (i, (a, rows)) in GLYPHS.iter().enumerate() {
            assert!(rows.iter().all(|r| *r < 32), "{a} is too wide");
            assert!(GLYPHS[i + 1..].iter().all(|(b, other)| a != b && rows != other), "{a} has a double");
        }
        assert!(dots('q').eq(dots('Q')));
        assert_eq!(dots(' ').count(), 0);
        assert!(dots('é').eq(dots('\u{1F600}')), "unknown characters are a frame");
    }
}
