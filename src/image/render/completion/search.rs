//! The nearest known patch of every patch that touches the hole.
//!
//! PatchMatch: a pixel tries the shifted matches of its predecessors, then random positions around its own match at
//! decreasing distances. Sweeps alternate in direction.

use super::level::Level;
use plumbline_num::run::{Run, Stopped};

/// Half a patch, px: patches of 7×7 px.
pub(super) const RADIUS: usize = 3;
/// Maximum depth in a hole that enters the weight, px.
const MAX_DEPTH: u32 = 100;
/// Sweeps per iteration.
const SWEEPS: usize = 2;

/// Where patches are taken from.
#[derive(Clone, Debug)]
pub(super) struct Search {
    /// For each pixel the middle of the nearest known patch; itself where its own patch is known.
    pub(super) nearest: Vec<u32>,
    /// Distance to it, mean squared difference; 0 where its own patch is known.
    pub(super) distance: Vec<f32>,
    /// Steps from what is known, at most 100.
    pub(super) depth: Vec<u32>,
    /// Pixels whose patch touches the hole, in the order of the rows.
    pub(super) targets: Vec<u32>,
    /// Pixels whose patch is known.
    sources: Vec<u32>,
    is_source: Vec<bool>,
    random: Random,
    sweeps: usize,
}

/// A small generator (xorshift64*): the same every time.
#[derive(Clone, Debug)]
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize) % n.max(1)
    }
}

impl Search {
    /// Starts from the nearest patches of a coarser level, or at random.
    pub(super) fn new(level: &Level, coarse: Option<&(Vec<u32>, usize, usize)>) -> Self {
        let (w, h) = (level.width, level.height);
        let whole = |k: usize| {
            let (x, y) = (k % w, k / w);
            let inside = x >= RADIUS && y >= RADIUS && x + RADIUS < w && y + RADIUS < h;
            inside
                && (y - RADIUS..=y + RADIUS)
                    .all(|j| !level.known[j * w + x - RADIUS..=j * w + x + RADIUS].contains(&false))
        };
        let mut is_source: Vec<bool> = (0..w * h).map(whole).collect();
        if !is_source.contains(&true) {
            // Nothing is wide enough for a patch: single pixels must do.
            is_source.clone_from(&level.known);
        }
        let numbers = |of: &dyn Fn(usize) -> bool| (0..w * h).filter(|&k| of(k)).map(|k| k as u32).collect::<Vec<_>>();
        let touches = |k: usize| around(level, k).any(|(_, j)| !level.known[j]);
        let (sources, targets) = (numbers(&|k| is_source[k]), numbers(&touches));
        let mut search = Self {
            nearest: (0..(w * h) as u32).collect(),
            distance: vec![0.0; w * h],
            depth: depths(level),
            targets,
            sources,
            is_source,
            random: Random(0x9E37_79B9_7F4A_7C15),
            sweeps: 0,
        };
        for n in 0..search.targets.len() {
            let k = search.targets[n] as usize;
            let any = search.sources[search.random.below(search.sources.len())];
            search.nearest[k] = coarse.and_then(|c| search.carried(level, k, c)).unwrap_or(any);
        }
        search
    }

    /// What a coarser level found at the place of a pixel.
    fn carried(&self, level: &Level, k: usize, (nearest, w, h): &(Vec<u32>, usize, usize)) -> Option<u32> {
        let (x, y) = (k % level.width, k / level.width);
        let (cx, cy) = ((x * w / level.width).min(w - 1), (y * h / level.height).min(h - 1));
        let from = nearest[cy * w + cx] as usize;
        let along = |to: usize, at: usize, own: usize, n: usize, size: usize| {
            let moved = (to as f64 - at as f64) * n as f64 / size as f64;
            (own as f64 + moved).round().clamp(0.0, (n - 1) as f64) as usize
        };
        let to = along(from / w, cy, y, level.height, *h) * level.width + along(from % w, cx, x, level.width, *w);
        self.is_source[to].then_some(to as u32)
    }

    /// One iteration: distances are recomputed, since the hole has changed, then sweeps.
    pub(super) fn improve(&mut self, level: &Level, run: &Run) -> Result<(), Stopped> {
        for n in 0..self.targets.len() {
            run.check()?;
            let k = self.targets[n] as usize;
            self.distance[k] = distance(level, k, self.nearest[k] as usize, f32::INFINITY);
        }
        for _ in 0..SWEEPS {
            let forth = self.sweeps.is_multiple_of(2);
            self.sweeps += 1;
            for n in 0..self.targets.len() {
                run.check()?;
                let n = if forth { n } else { self.targets.len() - 1 - n };
                self.improve_one(level, self.targets[n] as usize, forth);
            }
        }
        Ok(())
    }

    fn improve_one(&mut self, level: &Level, k: usize, forth: bool) {
        let (w, h) = (level.width as isize, level.height as isize);
        let (x, y) = ((k % level.width) as isize, (k / level.width) as isize);
        let back = if forth { -1 } else { 1 };
        for (dx, dy) in [(back, 0), (0, back)] {
            if (0..w).contains(&(x + dx)) && (0..h).contains(&(y + dy)) {
                let from = self.nearest[((y + dy) * w + x + dx) as usize] as isize;
                self.try_at(level, k, from % w - dx, from / w - dy);
            }
        }
        let mut reach = w.max(h);
        while reach >= 1 {
            let now = self.nearest[k] as isize;
            let mut step = || self.random.below(2 * reach as usize + 1) as isize - reach;
            let (dx, dy) = (step(), step());
            self.try_at(level, k, now % w + dx, now / w + dy);
            reach /= 2;
        }
    }

    fn try_at(&mut self, level: &Level, k: usize, x: isize, y: isize) {
        let (w, h) = (level.width as isize, level.height as isize);
        if !((0..w).contains(&x) && (0..h).contains(&y)) {
            return;
        }
        let to = (y * w + x) as usize;
        if self.is_source[to] && to as u32 != self.nearest[k] {
            let found = distance(level, k, to, self.distance[k]);
            if found < self.distance[k] {
                (self.nearest[k], self.distance[k]) = (to as u32, found);
            }
        }
    }
}

/// How many steps each pixel lies from what is known.
fn depths(level: &Level) -> Vec<u32> {
    let (w, h) = (level.width, level.height);
    let mut depth: Vec<u32> = level.known.iter().map(|known| if *known { 0 } else { MAX_DEPTH }).collect();
    let mut open: std::collections::VecDeque<usize> = (0..w * h).filter(|&k| level.known[k]).collect();
    while let Some(k) = open.pop_front() {
        let (x, y) = (k % w, k / w);
        for (valid, next) in
            [(x > 0, k.wrapping_sub(1)), (x + 1 < w, k + 1), (y > 0, k.wrapping_sub(w)), (y + 1 < h, k + w)]
        {
            if valid && depth[next] > depth[k] + 1 {
                depth[next] = depth[k] + 1;
                open.push_back(next);
            }
        }
    }
    depth
}

/// The pixels of a patch, with their steps from its middle.
pub(super) fn around(level: &Level, k: usize) -> impl Iterator<Item = ((isize, isize), usize)> + use<> {
    let (w, h, r) = (level.width as isize, level.height as isize, RADIUS as isize);
    let (x, y) = (k as isize % w, k as isize / w);
    (-r..=r).flat_map(move |dy| (-r..=r).map(move |dx| (dx, dy))).filter_map(move |(dx, dy)| {
        let inside = (0..w).contains(&(x + dx)) && (0..h).contains(&(y + dy));
        inside.then(|| ((dx, dy), ((y + dy) * w + x + dx) as usize))
    })
}

/// Mean squared difference of two patches over what lies in the picture of both; given up beyond `most`.
fn distance(level: &Level, a: usize, b: usize, most: f32) -> f32 {
    let (w, h, r) = (level.width as isize, level.height as isize, RADIUS as isize);
    let (ax, ay) = (a as isize % w, a as isize / w);
    let (bx, by) = (b as isize % w, b as isize / w);
    let (left, right) = (-r.min(ax).min(bx), r.min(w - 1 - ax).min(w - 1 - bx));
    let (top, bottom) = (-r.min(ay).min(by), r.min(h - 1 - ay).min(h - 1 - by));
    let count = ((right - left + 1) * (bottom - top + 1)) as f32;
    let mut sum = 0.0;
    for dy in top..=bottom {
        let start = |x: isize, y: isize| ((y + dy) * w + x + left) as usize;
        let (i, j, n) = (start(ax, ay), start(bx, by), (right - left + 1) as usize);
        for channel in &level.channels {
            sum += channel[i..i + n].iter().zip(&channel[j..j + n]).map(|(p, q)| (p - q) * (p - q)).sum::<f32>();
        }
        if sum > most * count {
            return f32::INFINITY;
        }
    }
    sum / count
}
