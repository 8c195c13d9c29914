//! The eight orientations of a camera, EXIF tag 274.
//!
//! With `(w, h)` the size of the stored picture, the pixel at `(i, j)` of the upright one is stored at
//!
//! ```text
//! (x, y) = swap ? (j, i) : (i, j),      then   x := w−1−x if flip_x,   y := h−1−y if flip_y.
//! ```

/// What makes a stored picture upright.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExifOrientation {
    /// Rows of the upright picture are columns of the stored one.
    pub swap: bool,
    /// Stored columns are read from the right.
    pub flip_x: bool,
    /// Stored rows are read from the bottom.
    pub flip_y: bool,
}

impl ExifOrientation {
    /// The orientation for a value of the tag; undefined values give the identity.
    pub const fn of_tag(value: u32) -> Self {
        let (swap, flip_x, flip_y) = match value {
            2 => (false, true, false),
            3 => (false, true, true),
            4 => (false, false, true),
            5 => (true, false, false),
            6 => (true, false, true),
            7 => (true, true, true),
            8 => (true, true, false),
            _ => (false, false, false),
        };
        Self { swap, flip_x, flip_y }
    }

    /// The orientation of a picture that a player mirrors from left to right (`mirrored`) and then turns clockwise by quarters.
    pub const fn of_display(quarters: u32, mirrored: bool) -> Self {
        Self::of_tag(match (quarters % 4, mirrored) {
            (0, false) => 1,
            (1, false) => 6,
            (2, false) => 3,
            (3, false) => 8,
            (0, true) => 2,
            (1, true) => 7,
            (2, true) => 4,
            _ => 5,
        })
    }

    /// Size of the upright picture.
    pub const fn size(self, width: usize, height: usize) -> (usize, usize) {
        if self.swap { (height, width) } else { (width, height) }
    }

    /// Where pixel `(i, j)` of the upright picture is stored in one of `width × height` px.
    pub const fn stored(self, (i, j): (usize, usize), width: usize, height: usize) -> (usize, usize) {
        let (x, y) = if self.swap { (j, i) } else { (i, j) };
        (if self.flip_x { width - 1 - x } else { x }, if self.flip_y { height - 1 - y } else { y })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The letter F as stored in a file, for each value of the tag (EXIF 2.3, 4.6.4 A, drawn).
    const STORED: [[&str; 5]; 8] = [
        ["###", "#..", "##.", "#..", "#.."],
        ["###", "..#", ".##", "..#", "..#"],
        ["..#", "..#", ".##", "..#", "###"],
        ["#..", "#..", "##.", "#..", "###"],
        ["#####", "#.#..", "#....", "", ""],
        ["#....", "#.#..", "#####", "", ""],
        ["....#", "..#.#", "#####", "", ""],
        ["#####", "..#.#", "....#", "", ""],
    ];

    #[test]
    fn every_value_of_the_tag_makes_the_letter_stand_upright() {
        for (value, stored) in (1..).zip(STORED) {
            let rows: Vec<&[u8]> = stored.iter().map(|r| r.as_bytes()).filter(|r| !r.is_empty()).collect();
            let (w, h) = (rows[0].len(), rows.len());
            let orientation = ExifOrientation::of_tag(value);
            assert_eq!(orientation.size(w, h), (3, 5), "{value}");
            let at = |i, j| {
                let (x, y) = orientation.stored((i, j), w, h);
                char::from(rows[y][x])
            };
            let upright: Vec<String> = (0..5).map(|j| (0..3).map(|i| at(i, j)).collect()).collect();
            assert_eq!(upright, STORED[0], "{value}");
        }
        assert_eq!(ExifOrientation::of_tag(0), ExifOrientation::default());
        assert_eq!(ExifOrientation::of_tag(77), ExifOrientation::default());
    }

    #[test]
    fn a_player_that_mirrors_and_rotates_agrees_with_the_orientation() {
        // A corner pixel of a 4×3 picture, mirrored, then oriented by quarters clockwise.
        for (quarters, mirrored) in (0..4).flat_map(|q| [(q, false), (q, true)]) {
            let (mut x, mut y, mut w, mut h) = (1, 0, 4, 3);
            if mirrored {
                x = w - 1 - x;
            }
            for _ in 0..quarters {
                (x, y) = (h - 1 - y, x);
                (w, h) = (h, w);
            }
            let orientation = ExifOrientation::of_display(quarters, mirrored);
            assert_eq!(orientation.size(4, 3), (w, h));
            assert_eq!(orientation.stored((x, y), 4, 3), (1, 0), "{quarters} {mirrored}");
        }
    }
}
