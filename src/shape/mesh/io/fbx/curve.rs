//! Animation curves.
//!
//! Between two keys a curve is constant, linear, or a Bézier curve in time and value whose inner points are at a third of the interval,
//! or at a weight of the key, on the tangents of the keys:
//!
//! ```text
//! (t₀, v₀),  (t₀ + w_r Δ, v₀ + w_r Δ s_r),  (t₁ − w_l Δ, v₁ − w_l Δ s_l),  (t₁, v₁),      Δ = t₁ − t₀.
//! ```
//!
//! Slopes s are stored; those of automatic keys follow from the keys beside them (the mean of the slope between these and of the slopes
//! on both sides, weighted by the other's interval), those of keys with tension, continuity and bias by Kochanek and Bartels.
//!
//! # Reference
//! D. Kochanek, R. Bartels, *Interpolating splines with local tension, continuity, and bias control*, SIGGRAPH 1984.

use super::document::Document;
use crate::mesh::MeshError;

/// Ticks of a second.
const TICKS: f64 = 46_186_158_000.0;

/// Flags of a key.
const CONSTANT: u32 = 0x2;
const LINEAR: u32 = 0x4;
const CUBIC: u32 = 0x8;
/// Of constant keys: the value of the next key.
const NEXT: u32 = 0x100;
/// Of cubic keys: the kind of the tangents.
const TCB: u32 = 0x200;
const USER: u32 = 0x400;
const CLAMPED: u32 = 0x1000;
const TIME_INDEPENDENT: u32 = 0x2000;
const CLAMPED_PROGRESSIVELY: u32 = 0x4000;
const WEIGHTED_RIGHT: u32 = 0x0100_0000;
const WEIGHTED_NEXT_LEFT: u32 = 0x0200_0000;

/// Weight of a tangent without one.
const THIRD: f64 = 1.0 / 3.0;
/// Difference of values up to which a clamped automatic key is level.
const LEVEL: f64 = 1e-3;
/// Iterations of Newton's method with bisection for the parameter at a time: 2⁻⁵⁰ by bisection alone.
const MAX_ITERATIONS: usize = 50;

/// A curve: at least one key.
pub(super) struct AnimationCurve {
    times: Vec<f64>,
    values: Vec<f64>,
    /// The curve after each key.
    spans: Vec<Span>,
}

/// Which limit is taken at a key where the value jumps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Before,
    After,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Span {
    Constant,
    /// The value of the key at the end.
    Next,
    Linear,
    Cubic {
        /// Slopes at both ends, per second.
        slopes: [f32; 2],
        weights: [f32; 2],
    },
}

/// Attributes of a key: flags, and its stored numbers.
#[derive(Clone, Copy, Default)]
struct Attributes {
    flags: u32,
    data: [u32; 4],
}

impl AnimationCurve {
    /// Reads a curve; `None` without keys. Keys that are not after those before them are left out.
    pub(super) fn read(document: &Document<'_, '_>, curve: u32) -> Result<Option<Self>, MeshError> {
        document.open(curve)?;
        let (reader, record) = (document.reader, document.object(curve).record);
        let ticks = reader.longs(record, "KeyTime")?;
        let numbers = reader.reals(record, "KeyValueFloat")?;
        if ticks.len() != numbers.len() {
            let told = format!("{} key times and {} values; it needs as many", ticks.len(), numbers.len());
            return Err(document.fault(curve, told));
        }
        if let Some(k) = numbers.iter().position(|x| !x.is_finite()) {
            return Err(document.fault(curve, format!("the value of key {k} is not finite")));
        }
        // Attributes are stored once for several keys that follow one another.
        let flags = reader.words(record, "KeyAttrFlags")?;
        let data = reader.words(record, "KeyAttrDataFloat")?;
        let counts = reader.integers(record, "KeyAttrRefCount")?;
        let data = data.as_chunks::<4>().0;
        let run = |k: usize| {
            let attributes = Attributes { flags: flags[k], data: data.get(k).copied().unwrap_or_default() };
            let count = counts.get(k).map_or(1, |&n| usize::try_from(n).unwrap_or(0));
            std::iter::repeat_n(attributes, count.min(ticks.len()))
        };
        let plain = Attributes { flags: LINEAR, ..Attributes::default() };
        let attributes = (0..flags.len()).flat_map(run).chain(std::iter::repeat(plain));
        let (mut times, mut values, mut of_keys) = (Vec::new(), Vec::new(), Vec::new());
        for ((&tick, &value), attributes) in ticks.iter().zip(&numbers).zip(attributes) {
            let time = tick as f64 / TICKS;
            if times.last().is_none_or(|&last| last < time) {
                times.push(time);
                values.push(value);
                of_keys.push(attributes);
            }
        }
        let spans = spans(&times, &values, &of_keys);
        Ok((!times.is_empty()).then_some(Self { times, values, spans }))
    }

    pub(super) fn times(&self) -> &[f64] {
        &self.times
    }

    /// Whether the curve is constant between its keys.
    pub(super) fn is_stepped(&self) -> bool {
        let inner = &self.spans[..self.spans.len() - 1];
        inner.iter().all(|span| matches!(span, Span::Constant | Span::Next))
    }

    /// The value at a time; constant before the first and after the last key.
    pub(super) fn at(&self, time: f64, side: Side) -> f64 {
        let passed = match side {
            Side::Before => self.times.partition_point(|&t| t < time),
            Side::After => self.times.partition_point(|&t| t <= time),
        };
        let last = self.times.len() - 1;
        if passed == 0 || passed > last {
            return self.values[if passed == 0 { 0 } else { last }];
        }
        let k = passed - 1;
        let [v0, v1] = [self.values[k], self.values[k + 1]];
        let length = self.times[k + 1] - self.times[k];
        let x = ((time - self.times[k]) / length).clamp(0.0, 1.0);
        match self.spans[k] {
            Span::Constant => v0,
            Span::Next => v1,
            Span::Linear => v0 * (1.0 - x) + v1 * x,
            Span::Cubic { slopes, weights } => {
                let [w0, w1] = weights.map(f64::from);
                let u = parameter(x, w0, 1.0 - w1);
                let [p1, p2] = [v0 + w0 * length * f64::from(slopes[0]), v1 - w1 * length * f64::from(slopes[1])];
                let value = bezier([v0, p1, p2, v1], u);
                // Slopes are any bits of the file.
                if value.is_finite() { value } else { v0 }
            }
        }
    }
}

/// A cubic Bézier curve of numbers.
fn bezier([a, b, c, d]: [f64; 4], u: f64) -> f64 {
    let v = 1.0 - u;
    v * v * v * a + 3.0 * v * v * u * b + 3.0 * v * u * u * c + u * u * u * d
}

/// The parameter u at which the Bézier curve 0, a, b, 1 has the value x: it ascends for a, b in [0, 1].
fn parameter(x: f64, a: f64, b: f64) -> f64 {
    let (mut low, mut high, mut u) = (0.0, 1.0, x);
    for _ in 0..MAX_ITERATIONS {
        let residual = bezier([0.0, a, b, 1.0], u) - x;
        if residual.abs() < 1e-14 {
            break;
        }
        if residual > 0.0 {
            high = u;
        } else {
            low = u;
        }
        let v = 1.0 - u;
        let slope = 3.0 * (v * v * a + 2.0 * v * u * (b - a) + u * u * (1.0 - b));
        let newton = u - residual / slope;
        u = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
    }
    u
}

/// The curve after each key.
fn spans(times: &[f64], values: &[f64], keys: &[Attributes]) -> Vec<Span> {
    let slope = |k: usize| (values[k + 1] - values[k]) / (times[k + 1] - times[k]);
    let number = |word: u32| f64::from(f32::from_bits(word));
    // Slopes before and after each key, where the key itself sets them.
    let set = |k: usize| -> Option<[f64; 2]> {
        let Attributes { flags, data } = keys[k];
        let before = (k > 0).then(|| slope(k - 1));
        let after = (k + 1 < times.len()).then(|| slope(k));
        match flags {
            _ if flags & (CUBIC | CONSTANT) != CUBIC || flags & (TCB | USER) == USER => None,
            _ if flags & TCB != 0 => Some(kochanek_bartels(data.map(number), before, after)),
            _ => {
                let lengths = [before.map(|_| times[k] - times[k - 1]), after.map(|_| times[k + 1] - times[k])];
                Some([automatic(flags, [before, after], lengths); 2])
            }
        }
    };
    let mut spans = Vec::with_capacity(times.len());
    for (k, &Attributes { flags, data }) in keys.iter().enumerate() {
        spans.push(if flags & CONSTANT != 0 {
            if flags & NEXT != 0 { Span::Next } else { Span::Constant }
        } else if flags & CUBIC != 0 && k + 1 < times.len() {
            let stored = if flags & TCB != 0 { [0.0; 2] } else { [number(data[0]), number(data[1])] };
            let right = set(k).map_or(stored[0], |[_, right]| right);
            let left = set(k + 1).map_or(stored[1], |[left, _]| left);
            // Two weights of four decimals in one word.
            let weight = |flag: u32, word: u32| {
                if flags & flag != 0 { (f64::from(word) * 1e-4).min(1.0) as f32 } else { THIRD as f32 }
            };
            let packed = data[2];
            let weights = [weight(WEIGHTED_RIGHT, packed & 0xffff), weight(WEIGHTED_NEXT_LEFT, packed >> 16)];
            Span::Cubic { slopes: [right as f32, left as f32], weights }
        } else {
            Span::Linear
        });
    }
    spans
}

/// Slope of an automatic key, by the slopes and lengths of the intervals before and after it.
fn automatic(flags: u32, slopes: [Option<f64>; 2], lengths: [Option<f64>; 2]) -> f64 {
    let level = |slope: f64, length: f64| flags & CLAMPED != 0 && (slope * length).abs() <= LEVEL;
    let progressive = flags & CLAMPED_PROGRESSIVELY != 0;
    match (slopes, lengths) {
        ([Some(before), Some(after)], [Some(d0), Some(d1)]) => {
            if level(before, d0) || level(after, d1) {
                return 0.0;
            }
            let total = (before * d0 + after * d1) / (d0 + d1);
            let mixed = (before * d1 + after * d0) / (d0 + d1);
            let slope = if flags & TIME_INDEPENDENT != 0 { total } else { 0.5 * (total + mixed) };
            if !progressive {
                return slope;
            }
            // No further than the keys beside it: a third of the interval at this slope stays below their values.
            let sign = if slope < 0.0 { -1.0 } else { 1.0 };
            let most = (sign * before / THIRD).min(sign * after / THIRD).max(0.0);
            sign * slope.abs().min(most)
        }
        ([Some(slope), None], [Some(length), _]) | ([None, Some(slope)], [_, Some(length)]) => {
            if progressive || level(slope, length) { 0.0 } else { slope }
        }
        _ => 0.0,
    }
}

/// Slopes before and after a key by its tension, continuity and bias.
fn kochanek_bartels([t, c, b, _]: [f64; 4], before: Option<f64>, after: Option<f64>) -> [f64; 2] {
    let factor = if before.is_some() && after.is_some() { 0.5 } else { 1.0 };
    let [before, after] = [before, after].map(|slope| slope.unwrap_or(0.0));
    let mix = |c: f64| factor * (1.0 - t) * ((1.0 + b) * (1.0 - c) * before + (1.0 - b) * (1.0 + c) * after);
    [mix(c), mix(-c)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(keys: &[(f64, f64, u32, [f32; 2], u32)]) -> AnimationCurve {
        let times: Vec<f64> = keys.iter().map(|k| k.0).collect();
        let values: Vec<f64> = keys.iter().map(|k| k.1).collect();
        let of_key = |&(_, _, flags, slopes, weights): &(f64, f64, u32, [f32; 2], u32)| Attributes {
            flags,
            data: [slopes[0].to_bits(), slopes[1].to_bits(), weights, 0],
        };
        let attributes: Vec<Attributes> = keys.iter().map(of_key).collect();
        let spans = spans(&times, &values, &attributes);
        AnimationCurve { times, values, spans }
    }

    #[test]
    fn a_cubic_with_stored_slopes_is_the_hermite_polynomial() {
        // v = t³ − 2t + 1 on [1, 3].
        let value = |t: f64| t * t * t - 2.0 * t + 1.0;
        let cubic = CUBIC | USER;
        let read = curve(&[(1.0, value(1.0), cubic, [1.0, 25.0], 0), (3.0, value(3.0), cubic, [0.0; 2], 0)]);
        for t in (0..=20).map(|k| 1.0 + 0.1 * f64::from(k)) {
            assert!((read.at(t, Side::After) - value(t)).abs() < 1e-5, "{t}");
        }
        assert_eq!((read.at(0.0, Side::After), read.at(9.0, Side::Before)), (value(1.0), value(3.0)));
    }

    #[test]
    fn weights_move_the_inner_points_along_the_tangents() {
        // Points (0, 0), (0.6, 1.2), (0.9, 0.9), (1, 1).
        let flags = CUBIC | USER | WEIGHTED_RIGHT | WEIGHTED_NEXT_LEFT;
        let read = curve(&[(0.0, 0.0, flags, [2.0, 1.0], 6000 + (1000 << 16)), (1.0, 1.0, flags, [0.0; 2], 0)]);
        for u in (0..=10).map(|k| 0.1 * f64::from(k)) {
            let [t, v] = [bezier([0.0, 0.6, 0.9, 1.0], u), bezier([0.0, 1.2, 0.9, 1.0], u)];
            assert!((read.at(t, Side::After) - v).abs() < 1e-6, "{u}");
        }
    }

    #[test]
    fn constant_keys_jump_at_the_next_key_or_at_once() {
        let read = curve(&[
            (0.0, 1.0, CONSTANT, [0.0; 2], 0),
            (1.0, 2.0, CONSTANT | NEXT, [0.0; 2], 0),
            (2.0, 4.0, LINEAR, [0.0; 2], 0),
        ]);
        assert_eq!((read.at(0.9, Side::After), read.at(1.0, Side::Before)), (1.0, 1.0));
        assert_eq!((read.at(1.0, Side::After), read.at(1.5, Side::Before)), (4.0, 4.0));
        assert!(read.is_stepped());
    }

    #[test]
    fn automatic_tangents_reproduce_lines_and_stay_level_where_they_are_clamped() {
        let flags = CUBIC | 0x100;
        let line = |t: f64| 3.0 * t - 1.0;
        let keys: Vec<_> = [0.0, 0.3, 1.0, 1.1].map(|t| (t, line(t), flags, [0.0; 2], 0)).to_vec();
        let read = curve(&keys);
        for t in (0..=22).map(|k| 0.05 * f64::from(k)) {
            assert!((read.at(t, Side::After) - line(t)).abs() < 1e-6, "{t}");
        }
        for clamp in [CLAMPED, CLAMPED_PROGRESSIVELY] {
            let keys: Vec<_> = [0.0, 1.0, 1.0, 3.0]
                .iter()
                .enumerate()
                .map(|(k, &v)| (k as f64, v, flags | clamp, [0.0; 2], 0))
                .collect();
            let read = curve(&keys);
            for t in (0..=10).map(|k| 1.0 + 0.1 * f64::from(k)) {
                assert!((read.at(t, Side::After) - 1.0).abs() < 1e-6, "{t}");
            }
        }
    }

    #[test]
    fn tension_continuity_and_bias_of_zero_are_catmull_rom() {
        let keys: Vec<_> =
            [0.0, 2.0, 1.0, 5.0].iter().enumerate().map(|(k, &v)| (k as f64, v, CUBIC | TCB, [0.0; 2], 0)).collect();
        // The middle of an interval, from the four keys around it.
        let read = curve(&keys);
        let expected = (9.0 * (2.0 + 1.0) - (0.0 + 5.0)) / 16.0;
        assert!((read.at(1.5, Side::After) - expected).abs() < 1e-6);
    }
}
