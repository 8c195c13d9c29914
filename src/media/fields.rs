//! Whether pictures that are not flagged as interlaced hold two fields all the same.
//!
//! Captures and careless conversions lose the flag. With `c`, `p`, `n` the current frame, the one before and the one after,
//! and `f(v | y) = Σₓ |c(x, y−1) + c(x, y+1) − 2 v(x, y)|`, how badly line `y` of `v` fits between its neighbors in `c`:
//!
//! ```text
//! A    =  Σ_{y even} f(p | y)  +  Σ_{y odd} f(n | y)
//! B    =  Σ_{y even} f(n | y)  +  Σ_{y odd} f(p | y)
//! own  =  Σ_y f(c | y)
//! ```
//!
//! In whole pictures that move, `own` is the least and `A ≈ B`. With the top field earlier, the lines of a field lie half a
//! frame from their neighbors in time, as do those that `B` takes from the next frame for the top field and from the previous
//! one for the bottom field: `own ≈ B`; those of `A` lie one and a half frames away: `A > B`. With the bottom field earlier
//! `A` and `B` change places. Where nothing moves all three agree, and nothing is said. One frame may err; many together
//! decide.

use super::FieldOrder;

/// Number of columns that are compared, from the middle of the picture: enough lines cross them.
const COLUMNS: usize = 128;
/// Number of frames that are classified: the beginning of a clip decides for all of it.
const MAX_FRAMES: u32 = 150;
/// Ratio of the far field's misfit to the near field's from which the fields are of different times: hand-held motion
/// from frame to frame makes up to 1.2.
const MIN_FAR_RATIO: f64 = 1.2;
/// Misfit of a frame's own lines relative to the near field's from which they are of different times.
const MIN_OWN_RATIO: f64 = 0.7;
/// Minimum number of interlaced frames, and the factor by which they must outnumber progressive ones. A shake that
/// reverses within a frame makes single frames err about the order, not about the fields: the majority decides the
/// order.
const MIN_VOTES: u32 = 8;
const MAJORITY: u32 = 2;

/// Judges frames as they pass.
#[derive(Debug, Default)]
pub(super) struct FieldDetector {
    /// Middle columns of the last frames, the newest last.
    strips: Vec<Strip>,
    judged: u32,
    top: u32,
    bottom: u32,
    whole: u32,
}

#[derive(Debug)]
struct Strip {
    width: usize,
    samples: Vec<u16>,
}

impl FieldDetector {
    /// Takes the next frame's first plane: rows of `width` samples of one or two bytes.
    pub(super) fn push(&mut self, plane: (&[u8], usize), (width, height): (usize, usize), bytes: usize) {
        if self.judged >= MAX_FRAMES || height < 8 || width == 0 {
            return;
        }
        let columns = COLUMNS.min(width);
        let from = (width - columns) / 2 * bytes;
        let mut samples = Vec::with_capacity(columns * height);
        for y in 0..height {
            let row = &plane.0[y * plane.1 + from..][..columns * bytes];
            match bytes {
                1 => samples.extend(row.iter().map(|v| u16::from(*v))),
                _ => samples.extend(row.as_chunks::<2>().0.iter().map(|v| u16::from_ne_bytes(*v))),
            }
        }
        self.strips.push(Strip { width: columns, samples });
        if let [before, now, after] = self.strips.as_slice() {
            match judge(before, now, after) {
                Some(FieldOrder::TopFirst) => self.top += 1,
                Some(FieldOrder::BottomFirst) => self.bottom += 1,
                Some(FieldOrder::Progressive) => self.whole += 1,
                None => {}
            }
            self.judged += 1;
            self.strips.remove(0);
        }
    }

    /// The order of fields that most frames show; `None` where they are whole, or nothing moved.
    pub(super) fn verdict(&self) -> Option<FieldOrder> {
        let fields = self.top + self.bottom;
        let order = if self.top >= self.bottom { FieldOrder::TopFirst } else { FieldOrder::BottomFirst };
        (fields >= MIN_VOTES && fields > MAJORITY * self.whole).then_some(order)
    }
}

/// Classification of a frame; `None` where it does not move enough.
fn judge(before: &Strip, now: &Strip, after: &Strip) -> Option<FieldOrder> {
    if before.samples.len() != now.samples.len() || after.samples.len() != now.samples.len() {
        return None;
    }
    let height = now.samples.len() / now.width;
    let (mut sums, mut own) = ([0_u64; 2], 0_u64);
    for y in 1..height - 1 {
        own += misfit(now, now, y);
        sums[y % 2] += misfit(now, before, y);
        sums[1 - y % 2] += misfit(now, after, y);
    }
    let [a, b, own] = [sums[0], sums[1], own].map(|s| s as f64);
    let (far, near) = (a.max(b), a.min(b));
    if own < MIN_OWN_RATIO * near {
        return Some(FieldOrder::Progressive);
    }
    (far > MIN_FAR_RATIO * near).then_some(if a > b { FieldOrder::TopFirst } else { FieldOrder::BottomFirst })
}

/// How badly line `y` of `other` fits between its neighbors in `now`.
fn misfit(now: &Strip, other: &Strip, y: usize) -> u64 {
    let row = |strip: &Strip, y: usize| -> std::ops::Range<usize> { y * strip.width..(y + 1) * strip.width };
    let (above, below) = (&now.samples[row(now, y - 1)], &now.samples[row(now, y + 1)]);
    let lines = above.iter().zip(below).zip(&other.samples[row(other, y)]);
    lines.map(|((a, b), v)| u64::from((i32::from(*a) + i32::from(*b) - 2 * i32::from(*v)).unsigned_abs())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (160, 64);

    /// A smooth texture at time `t`, which moves unevenly.
    fn texture(x: usize, y: usize, t: f64) -> u8 {
        let (x, y) = (x as f64 + 3.0 * t + (1.9 * t).sin(), y as f64 + 0.8 * (0.7 * t).sin());
        (128.0 + 50.0 * (x / 4.0).sin() + 40.0 * (y / 5.0 + x / 9.0).cos()) as u8
    }

    /// What frames say whose top and bottom lines show the times `k + top` and `k + bottom`, `speed` times as fast.
    fn verdict(top: f64, bottom: f64, speed: f64) -> Option<FieldOrder> {
        let mut detector = FieldDetector::default();
        for k in 0..40 {
            let time = |y: usize| speed * (f64::from(k) + if y.is_multiple_of(2) { top } else { bottom });
            let plane: Vec<u8> =
                (0..SIZE.0 * SIZE.1).map(|i| texture(i % SIZE.0, i / SIZE.0, time(i / SIZE.0))).collect();
            detector.push((&plane, SIZE.0), SIZE, 1);
        }
        detector.verdict()
    }

    #[test]
    fn fields_are_found_with_their_order_and_whole_pictures_are_left_alone() {
        assert_eq!(verdict(0.0, 0.5, 1.0), Some(FieldOrder::TopFirst));
        assert_eq!(verdict(0.5, 0.0, 1.0), Some(FieldOrder::BottomFirst));
        assert_eq!(verdict(0.0, 0.0, 1.0), None, "whole");
        assert_eq!(verdict(0.0, 0.5, 0.0), None, "still");
    }
}
