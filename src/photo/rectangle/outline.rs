//! The outline of a stitched picture: its surroundings, transparent, black or white, are found by flooding from the
//! frame.
//!
//! A pixel is *outside* where it can be reached from the frame through pixels that differ from the border's color by at
//! most `T` in every channel (through transparent ones where there is an alpha plane). `T` grows from rounding errors
//! to JPEG noise, but stops before the flood leaks into the picture: white borders adjoin pale skies. Where the two
//! mix, within two pixels of the flood and along the frame, whatever is nearer to the border's color than
//! `MIXED_TOLERANCE` is outside too. The outside is dilated by two pixels against compression ringing; the largest
//! connected component of the rest is the picture.
//!
//! The result is a raster of blocks: one is inside where all its pixels are.

use crate::Line;
use plumbline_image::Frame;
use plumbline_image::still::{StillError, rgb_of_rows};
use plumbline_num::math::{Point2, Rect, Vec2};

/// Maximum number of blocks along the longer side: the seams' time grows with its cube.
const RASTER: usize = 480;
/// Tolerances `T` of the flood, gray levels of 255: from rounding to the noise of JPEG compression on a flat color.
const TOLERANCES: [u8; 3] = [4, 8, 12];
/// Difference from the border's color within which a pixel next to the flood is a mixture of both, gray levels.
const MIXED_TOLERANCE: u8 = 40;
/// Width of mixed edges, px: interpolation of the stitcher.
const MIXED_PX: usize = 2;
/// Increase of the flooded fraction from one tolerance to the next that indicates a leak into the picture.
const MAX_GROWTH: f64 = 0.02;
/// Minimum percentage of the frame's pixels that have the border's color.
const MIN_FRAME_PERCENT: usize = 10;
/// Distance, blocks, within which a line counts as part of the outline.
const LINE_MARGIN: usize = 2;
/// Difference from black or white, gray levels, up to which a border counts as one of them.
const COLOR_TOLERANCE: u8 = 16;
/// Rows of colors that are in memory at once: tasks of all threads, and few megabytes.
const BAND_PX: usize = 256;
/// Dilation of the outside, px: the reach of compression ringing that the mixed edge leaves.
const RINGING_PX: usize = 2;

/// The outline of a picture: a raster of blocks inside and outside.
#[derive(Clone, Debug)]
pub struct Outline {
    /// Blocks along x and y.
    pub(super) cols: usize,
    pub(super) rows: usize,
    /// Side of a block, px.
    pub(super) block: usize,
    /// Inside, row-major.
    pub(super) inside: Vec<bool>,
    /// Which sides of the frame are touched by the outside: left, right, top, bottom.
    pub(super) touched: [bool; 4],
    /// How sharply border becomes picture, from 0, fading, to 1, cut.
    pub(super) step: f64,
}

impl Outline {
    /// The outline of a picture; `None` where its frame has no color of its own, or nothing else.
    pub fn of_frame(frame: &Frame) -> Option<Self> {
        let (width, height) = (frame.width, frame.height);
        if width < 16 || height < 16 {
            return None;
        }
        let Outside { outside, difference } = outside(frame)?;
        let touched = touched(&outside, width, height);
        let block = width.max(height).div_ceil(RASTER);
        let (cols, rows) = (width.div_ceil(block), height.div_ceil(block));
        let whole = |k: usize| {
            let span =
                |i: usize, n: usize| (i * block).saturating_sub(RINGING_PX)..((i + 1) * block + RINGING_PX).min(n);
            let (xs, ys) = (span(k % cols, width), span(k / cols, height));
            ys.into_iter().all(|y| !outside[y * width..][xs.clone()].contains(&true))
        };
        let inside = (0..cols * rows).map(whole).collect();
        let mut outline = Self { cols, rows, block, inside, touched, step: 1.0 };
        outline.keep_largest_part();
        if let Some(difference) = difference {
            outline.step = outline.step_of(|k| {
                let span = |i: usize, n: usize| i * block..((i + 1) * block).min(n);
                let (xs, ys) = (span(k % cols, width), span(k / cols, height));
                let count = xs.len() * ys.len();
                let sum = ys.flat_map(|y| &difference[y * width..][xs.clone()]).map(|v| f64::from(*v)).sum::<f64>();
                sum / count as f64
            });
        }
        (outline.inside.contains(&true) && outline.inside.contains(&false)).then_some(outline)
    }

    /// Fraction of the picture inside.
    pub fn inside_fraction(&self) -> f64 {
        self.count() as f64 / self.inside.len() as f64
    }

    pub(super) fn count(&self) -> usize {
        self.inside.iter().filter(|inside| **inside).count()
    }

    /// The first and one past the last column and row with blocks inside.
    pub(super) fn bounds(&self) -> [usize; 4] {
        let start = [self.cols, self.rows, 0, 0];
        (0..self.inside.len()).filter(|&k| self.inside[k]).fold(start, |[x0, y0, x1, y1], k| {
            let (i, j) = (k % self.cols, k / self.cols);
            [x0.min(i), y0.min(j), x1.max(i + 1), y1.max(j + 1)]
        })
    }

    /// Blocks inside that have one outside beside them.
    pub(super) fn along(&self) -> impl Iterator<Item = Vec2> {
        let outside = |i: usize, j: usize| i < self.cols && j < self.rows && !self.inside[j * self.cols + i];
        let beside = move |(i, j): (usize, usize)| {
            outside(i.wrapping_sub(1), j) || outside(i + 1, j) || outside(i, j.wrapping_sub(1)) || outside(i, j + 1)
        };
        let blocks = (0..self.inside.len()).filter(|&k| self.inside[k]).map(|k| (k % self.cols, k / self.cols));
        blocks.filter(move |&block| beside(block)).map(|(i, j)| Vec2::new(i as f64, j as f64))
    }

    /// Whether a point of the picture, px, lies in a block inside.
    pub fn contains(&self, p: Point2) -> bool {
        let index = |v: f64, n: usize| (v >= 0.0).then(|| (v / self.block as f64) as usize).filter(|i| *i < n);
        index(p.x, self.cols).zip(index(p.y, self.rows)).is_some_and(|(i, j)| self.inside[j * self.cols + i])
    }

    /// Whether a line runs along the outline: nothing that is straight in the world, but where the picture was cut.
    pub(super) fn runs_along(&self, line: &Line) -> bool {
        let near = |p: Point2| {
            let reach = (LINE_MARGIN * self.block) as f64;
            let beside = |dx: f64, dy: f64| !self.contains(p + Vec2::new(dx, dy) * reach);
            beside(0.0, 0.0) || beside(1.0, 0.0) || beside(-1.0, 0.0) || beside(0.0, 1.0) || beside(0.0, -1.0)
        };
        let samples =
            |ends: &[Point2]| (0..=8).filter(|k| near(ends[0] + (ends[1] - ends[0]) * (f64::from(*k) / 8.0))).count();
        let (along, all) = line.points.windows(2).fold((0, 0), |(n, of), ends| (n + samples(ends), of + 9));
        2 * along > all
    }

    /// Bounds of the inside, px.
    pub fn bounds_px(&self) -> Rect {
        let [x0, y0, x1, y1] = self.bounds().map(|i| (i * self.block) as f64);
        Rect { min: Point2::new(x0, y0), max: Point2::new(x1, y1) }
    }

    /// Keeps the largest 4-connected component of the inside.
    fn keep_largest_part(&mut self) {
        let mut part = vec![0_u32; self.inside.len()];
        let (mut parts, mut largest) = (0, (0, 0));
        for first in 0..self.inside.len() {
            if !self.inside[first] || part[first] > 0 {
                continue;
            }
            parts += 1;
            let mut count = 0;
            flood(self.cols, self.rows, vec![first], |k| {
                let joins = self.inside[k] && part[k] == 0;
                if joins {
                    (part[k], count) = (parts, count + 1);
                }
                joins
            });
            largest = largest.max((count, parts));
        }
        self.inside = part.iter().map(|p| *p > 0 && *p == largest.1).collect();
    }
}

/// Visits what is 4-connected to the seeds; `take` marks a pixel and returns whether it is new and belongs to the
/// component.
fn flood(width: usize, height: usize, seeds: Vec<usize>, mut take: impl FnMut(usize) -> bool) {
    let mut open: Vec<usize> = seeds.into_iter().filter(|&k| take(k)).collect();
    while let Some(k) = open.pop() {
        open.extend(beside(k, width, height).filter(|&next| take(next)));
    }
}

/// The pixels of the frame.
fn frame_pixels(width: usize, height: usize) -> Vec<usize> {
    let level = (0..width).flat_map(|x| [x, (height - 1) * width + x]);
    let upright = (0..height).flat_map(|y| [y * width, y * width + width - 1]);
    level.chain(upright).collect()
}

/// The surroundings of a picture.
struct Outside {
    /// Which pixels are outside.
    outside: Vec<bool>,
    /// Largest difference of a channel from the border's color; `None` where the border is transparent.
    difference: Option<Vec<u8>>,
}

/// Which pixels are outside.
fn outside(frame: &Frame) -> Option<Outside> {
    let (width, height) = (frame.width, frame.height);
    let around = frame_pixels(width, height);
    let flooded = |joins: &dyn Fn(usize) -> bool| {
        let mut outside = vec![false; width * height];
        flood(width, height, around.clone(), |k| {
            let new = !outside[k] && joins(k);
            outside[k] |= new;
            new
        });
        outside
    };
    if let Some(clear) = transparent(frame) {
        let outside = flooded(&|k| clear[k]);
        return outside.contains(&true).then_some(Outside { outside, difference: None });
    }
    let color = border_color(&frame_colors(frame).ok()?)?;
    let furthest = |pixel: &[u8; 3]| pixel.iter().zip(color).map(|(v, c)| v.abs_diff(c)).max().unwrap_or(0);
    let mut difference: Vec<u8> = Vec::with_capacity(width * height);
    for rows in bands(frame) {
        difference.extend(rows.ok()?.iter().map(furthest));
    }
    let share = |o: &[bool]| o.iter().filter(|v| **v).count() as f64 / o.len() as f64;
    let mut found: Option<(f64, Vec<bool>)> = None;
    for tolerance in TOLERANCES {
        let next = flooded(&|k| difference[k] <= tolerance);
        let taken = share(&next);
        if found.as_ref().is_some_and(|(before, _)| taken > before + MAX_GROWTH) {
            break;
        }
        found = Some((taken, next));
    }
    let mut outside = found.map(|(_, outside)| outside).filter(|o| o.contains(&true))?;
    add_mixed(&mut outside, (width, height), &around, |k| difference[k] <= MIXED_TOLERANCE);
    Some(Outside { outside, difference: Some(difference) })
}

/// Adds mixtures of border and picture: next to the outside, and along the frame, where the picture may leave less than
/// a pixel of border.
fn add_mixed(outside: &mut [bool], (width, height): (usize, usize), around: &[usize], mixed: impl Fn(usize) -> bool) {
    let at_frame = |k: usize| {
        let (x, y) = (k % width, k / width);
        x.min(width - 1 - x).min(y).min(height - 1 - y) < MIXED_PX
    };
    let mut edge: Vec<usize> = (0..outside.len()).filter(|&k| outside[k]).collect();
    for _ in 0..MIXED_PX {
        let before = std::mem::take(&mut edge);
        for k in before {
            for next in beside(k, width, height) {
                if !outside[next] && mixed(next) {
                    outside[next] = true;
                    edge.push(next);
                }
            }
        }
    }
    let seeds = around.iter().copied().filter(|&k| outside[k]).flat_map(|k| beside(k, width, height)).collect();
    flood(width, height, seeds, |k| {
        let joins = !outside[k] && at_frame(k) && mixed(k);
        outside[k] |= joins;
        joins
    });
}

/// The four neighbors of a pixel.
fn beside(k: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (k % width, k / width);
    let four = [
        (x > 0, k.wrapping_sub(1)),
        (x + 1 < width, k + 1),
        (y > 0, k.wrapping_sub(width)),
        (y + 1 < height, k + width),
    ];
    four.into_iter().filter(|(valid, _)| *valid).map(|(_, next)| next)
}

/// Which pixels are more transparent than not; `None` where none is.
fn transparent(frame: &Frame) -> Option<Vec<bool>> {
    if !frame.format.alpha {
        return None;
    }
    let plane = frame.format.planes() - 1;
    let half = 1_u32 << (frame.format.bits - 1);
    let row = |y: usize| -> Option<Vec<bool>> {
        match frame.plane8(plane) {
            Some(alpha) => Some(alpha.row(y).iter().map(|v| u32::from(*v) < half).collect()),
            None => Some(frame.plane16(plane)?.row(y).iter().map(|v| u32::from(*v) < half).collect()),
        }
    };
    let rows: Option<Vec<Vec<bool>>> = (0..frame.height).map(row).collect();
    rows.map(|rows| rows.concat()).filter(|clear| clear.contains(&true))
}

/// Colors of the frame's rows from top to bottom, in bands: a large picture is not in memory twice.
fn bands(frame: &Frame) -> impl Iterator<Item = Result<Vec<[u8; 3]>, StillError>> {
    let starts = (0..frame.height).step_by(BAND_PX);
    starts.map(|first| rgb_of_rows(frame, first..(first + BAND_PX).min(frame.height)))
}

/// Colors of the pixels along the frame; those of the corners are twice in it.
fn frame_colors(frame: &Frame) -> Result<Vec<[u8; 3]>, StillError> {
    let mut colors = [rgb_of_rows(frame, 0..1)?, rgb_of_rows(frame, frame.height - 1..frame.height)?].concat();
    for rows in bands(frame) {
        colors.extend(rows?.chunks(frame.width).flat_map(|row| [row[0], row[row.len() - 1]]));
    }
    Ok(colors)
}

/// The most frequent of the colors along the frame, if it is black or white and frequent enough.
fn border_color(around: &[[u8; 3]]) -> Option<[u8; 3]> {
    let mut bins = std::collections::BTreeMap::<[u8; 3], (usize, [usize; 3])>::new();
    for color in around {
        let (count, sum) = bins.entry(color.map(|v| v >> 4)).or_default();
        *count += 1;
        sum.iter_mut().zip(color).for_each(|(sum, v)| *sum += usize::from(*v));
    }
    let (_, (count, sum)) = bins.into_iter().max_by_key(|(_, (count, _))| *count)?;
    let color = sum.map(|s| (s / count) as u8);
    // Walls and skies have a color along the frame, too.
    let plain = color.iter().all(|c| *c <= COLOR_TOLERANCE) || color.iter().all(|c| *c >= 255 - COLOR_TOLERANCE);
    (plain && count * 100 >= around.len() * MIN_FRAME_PERCENT).then_some(color)
}

/// Which sides of the frame touch the outside.
fn touched(outside: &[bool], width: usize, height: usize) -> [bool; 4] {
    let column = |x: usize| (0..height).any(|y| outside[y * width + x]);
    let row = |y: usize| outside[y * width..][..width].contains(&true);
    [column(0), column(width - 1), row(0), row(height - 1)]
}

/// Signed distances to the border of the inside, in blocks, positive inside: two passes of the 3-4 chamfer. What lies beyond
/// the raster is outside.
#[derive(Clone, Debug)]
pub(super) struct Depth {
    cols: usize,
    rows: usize,
    values: Vec<f64>,
}

impl Depth {
    pub(super) fn of(cols: usize, rows: usize, inside: &[bool]) -> Self {
        let to_outside = chamfer(cols, rows, |k| !inside[k], true);
        let to_inside = chamfer(cols, rows, |k| inside[k], false);
        // Half a block: the border runs between centers.
        let signed = |k: usize| if inside[k] { to_outside[k] - 0.5 } else { 0.5 - to_inside[k] };
        Self { cols, rows, values: (0..cols * rows).map(signed).collect() }
    }

    /// The distance at a point, in blocks from the corner of the raster.
    pub(super) fn at(&self, p: Vec2) -> f64 {
        let (x, y) = (p.x - 0.5, p.y - 0.5);
        let (i, j) = (x.floor(), y.floor());
        let value = |i: f64, j: f64| {
            let within = |v: f64, n: usize| v.clamp(0.0, (n - 1) as f64);
            let (c, r) = (within(i, self.cols), within(j, self.rows));
            let beyond = (i - c).abs().max((j - r).abs());
            let at = self.values[r as usize * self.cols + c as usize];
            if beyond > 0.0 { at.min(0.5) - beyond } else { at }
        };
        let (s, t) = (x - i, y - j);
        let top = value(i, j) * (1.0 - s) + value(i + 1.0, j) * s;
        let bottom = value(i, j + 1.0) * (1.0 - s) + value(i + 1.0, j + 1.0) * s;
        top * (1.0 - t) + bottom * t
    }

    /// Unit direction inwards at a point; zero in the middle.
    pub(super) fn inwards(&self, p: Vec2) -> Vec2 {
        let e = 1.5;
        let slope = Vec2::new(
            self.at(p + Vec2::new(e, 0.0)) - self.at(p - Vec2::new(e, 0.0)),
            self.at(p + Vec2::new(0.0, e)) - self.at(p - Vec2::new(0.0, e)),
        );
        slope.try_normalize(1e-9).unwrap_or_default()
    }
}

/// Distance of each block to the nearest target.
fn chamfer(cols: usize, rows: usize, target: impl Fn(usize) -> bool, beyond: bool) -> Vec<f64> {
    const FAR: f64 = 1e9;
    let mut d: Vec<f64> = (0..cols * rows).map(|k| if target(k) { 0.0 } else { FAR }).collect();
    let steps = [(-1_isize, 0_isize, 1.0), (0, -1, 1.0), (-1, -1, 4.0 / 3.0), (1, -1, 4.0 / 3.0)];
    for sign in [1_isize, -1] {
        for n in 0..cols * rows {
            let k = if sign > 0 { n } else { cols * rows - 1 - n };
            let (i, j) = ((k % cols) as isize, (k / cols) as isize);
            for (dx, dy, length) in steps {
                let (x, y) = (i + sign * dx, j + sign * dy);
                let held = (0..cols as isize).contains(&x) && (0..rows as isize).contains(&y);
                let there = match held {
                    true => d[y as usize * cols + x as usize],
                    false if beyond => 0.0,
                    false => FAR,
                };
                d[k] = d[k].min(there + length);
            }
        }
    }
    d
}
