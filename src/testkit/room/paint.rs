//! Colors of surfaces: patterns with straight edges, and a grain that belongs to the surface.

use super::Wall;

/// Linear red, green and blue.
pub(super) type Color = [f32; 3];

/// How a rectangle is painted; lengths in meters, measured from the rectangle's first corner.
#[derive(Clone, Debug)]
pub(super) enum Paint {
    /// One color.
    Plain(Color),
    /// Squares of two colors.
    Checker { side: f64, colors: [Color; 2] },
    /// Tiles with joints; each tile a little lighter or darker.
    Tiles { side: (f64, f64), joint: f64, tile: Color, between: Color },
    /// From the first color to the second along t.
    Fade { colors: [Color; 2] },
    /// Spines of books of many widths and colors.
    Books,
}

/// A number in [0, 1) that depends on two integers alone (finalizer of splitmix64, S. Vigna).
fn hash(a: i64, b: i64) -> f32 {
    let mut x = (a as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (b as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x >> 40) as f32 / (1_u64 << 24) as f32
}

fn scaled(color: Color, by: f32) -> Color {
    color.map(|c| c * by)
}

impl Paint {
    /// The color at `(s, t)` from the first corner of a rectangle `height` long along t.
    pub(super) fn color(&self, s: f64, t: f64, height: f64) -> Color {
        match self {
            Self::Plain(color) => *color,
            Self::Checker { side, colors } => {
                let odd = ((s / side).floor() + (t / side).floor()).rem_euclid(2.0) >= 1.0;
                colors[usize::from(odd)]
            }
            Self::Tiles { side, joint, tile, between } => {
                let (i, j) = ((s / side.0).floor(), (t / side.1).floor());
                let inside = |x: f64, side: f64| {
                    let rest = x.rem_euclid(side);
                    rest >= 0.5 * joint && rest < side - 0.5 * joint
                };
                if inside(s, side.0) && inside(t, side.1) {
                    scaled(*tile, 0.92 + 0.16 * hash(i as i64, j as i64))
                } else {
                    *between
                }
            }
            Self::Fade { colors: [a, b] } => {
                let share = (t / height).clamp(0.0, 1.0) as f32;
                std::array::from_fn(|c| a[c] + share * (b[c] - a[c]))
            }
            Self::Books => book(s, t, height),
        }
    }
}

/// Books 2 to 6 cm wide that fill four fifths of the height or more.
fn book(s: f64, t: f64, height: f64) -> Color {
    const SLOT: f64 = 0.12;
    let slot = (s / SLOT).floor() as i64;
    let first = SLOT * (slot as f64 + 0.35 + 0.3 * f64::from(hash(slot, 1)));
    let id = 2 * slot + i64::from(s >= first);
    let tall = height * f64::from(0.8 + 0.18 * hash(id, 2));
    if height - t > tall {
        return [0.03, 0.025, 0.02];
    }
    let tint = |c: i64| 0.06 + 0.42 * hash(id, 3 + c).powi(2);
    [tint(0), tint(1), tint(2)]
}

/// Light on a wall and the grain of its plaster.
pub(super) fn light(wall: Wall, s: f64, t: f64) -> f32 {
    let grain = 0.97 + 0.06 * hash((s * 90.0 + 1000.0 * wall.axis as f64).floor() as i64, (t * 90.0).floor() as i64);
    // The lamps hang in the middle of the ceiling: far ends of the room and corners get less.
    let [a, b] = wall.along();
    let from_middle = |axis: usize, x: f64| {
        let (low, high) = (super::LOW[axis], super::HIGH[axis]);
        ((2.0 * x - low - high) / (high - low)).clamp(-1.0, 1.0)
    };
    let (u, v) = (from_middle(a, s), from_middle(b, t));
    let falloff = 1.0 - 0.22 * u * u - 0.16 * v * v;
    let facing = match wall.axis {
        1 if wall.high => 1.0,
        1 => 0.95,
        0 => 0.8,
        _ => 0.88,
    };
    grain * (falloff * facing) as f32
}
