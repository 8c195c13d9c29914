//! What the street is painted with: functions of (u, v) in the unit square that repeat without a seam, sRGB in [0, 1].

use plumbline_image::canvas::font;

type Color = [f32; 3];

/// Pseudo-random value in [0, 1) of two integers and a seed.
pub(super) fn hash(x: i32, y: i32, seed: u32) -> f32 {
    let mut h =
        (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77) ^ seed.wrapping_mul(0xC2B2_AE3D);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    (h ^ (h >> 15)) as f32 / 4_294_967_808.0
}

/// Value noise in [0, 1] with `cells` lattice cells per unit, periodic in both directions.
fn noise(u: f32, v: f32, cells: i32, seed: u32) -> f32 {
    let (x, y) = (u * cells as f32, v * cells as f32);
    let (x0, y0) = (x.floor(), y.floor());
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (ease(x - x0), ease(y - y0));
    let at = |dx: i32, dy: i32| hash((x0 as i32 + dx).rem_euclid(cells), (y0 as i32 + dy).rem_euclid(cells), seed);
    let row = |dy| at(0, dy) * (1.0 - fx) + at(1, dy) * fx;
    row(0) * (1.0 - fy) + row(1) * fy
}

/// Sum of octaves of noise, each with twice the frequency and half the amplitude; about [0, 1].
pub(super) fn fractal(u: f32, v: f32, cells: i32, octaves: u32, seed: u32) -> f32 {
    let octave = |k: u32| noise(u, v, cells << k, seed.wrapping_add(k)) / (1 << k) as f32;
    (0..octaves).map(octave).sum::<f32>() / (2.0 - 2.0 / (1 << octaves) as f32)
}

fn mix(a: Color, b: Color, t: f32) -> Color {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t.clamp(0.0, 1.0))
}

fn scaled(color: Color, factor: f32) -> Color {
    color.map(|v| v * factor)
}

/// Running bond, 6 bricks wide and 16 high, each of its own shade.
pub(super) fn bricks(u: f32, v: f32, base: Color, seed: u32) -> Color {
    let (columns, rows) = (6, 16);
    let row = (v * rows as f32).floor() as i32;
    let x = u * columns as f32 + if row % 2 == 0 { 0.5 } else { 0.0 };
    let column = (x.floor() as i32).rem_euclid(columns);
    let (fx, fy) = (x - x.floor(), v * rows as f32 - row as f32);
    let grain = fractal(u, v, 32, 4, seed);
    let mortar = fx < 0.035 || fy < 0.10;
    if mortar {
        return scaled([0.66, 0.63, 0.58], 0.75 + 0.35 * grain);
    }
    let shade = 0.72 + 0.5 * hash(column, row, seed);
    let warm = hash(column, row, seed ^ 0x4D) * 0.16 - 0.08;
    let edge = if fx > 0.965 || fy > 0.92 { 0.82 } else { 1.0 };
    let color = scaled(base, shade * edge * (0.78 + 0.44 * grain));
    [color[0] + warm, color[1] + warm * 0.5, color[2]]
}

/// Plaster with stains, fine grain and a few hairline cracks.
pub(super) fn plaster(u: f32, v: f32, base: Color, seed: u32) -> Color {
    let stain = fractal(u, v, 3, 5, seed);
    let grain = fractal(u, v, 64, 3, seed ^ 5);
    let crack = (fractal(u, v, 5, 5, seed ^ 9) - 0.5).abs();
    let worn = fractal(u, v, 4, 6, seed ^ 0x15);
    let color = scaled(base, 0.80 + 0.22 * stain + 0.22 * (grain - 0.5));
    let color = if worn > 0.66 { mix(color, [0.62, 0.45, 0.36], 0.8) } else { color };
    if crack < 0.004 { scaled(color, 0.6) } else { color }
}

/// Distance to the nearest and second nearest of the jittered points of a periodic lattice, and the nearest one's hash.
fn cells(u: f32, v: f32, count: i32, seed: u32) -> (f32, f32, f32) {
    let (x, y) = (u * count as f32, v * count as f32);
    let (x0, y0) = (x.floor() as i32, y.floor() as i32);
    let (mut first, mut second, mut id) = (9.0_f32, 9.0_f32, 0.0);
    for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
        let (i, j) = ((x0 + dx).rem_euclid(count), (y0 + dy).rem_euclid(count));
        let px = (x0 + dx) as f32 + 0.5 + 0.7 * (hash(i, j, seed) - 0.5);
        let py = (y0 + dy) as f32 + 0.5 + 0.7 * (hash(i, j, seed ^ 0x1F) - 0.5);
        let d = (px - x).hypot(py - y);
        if d < first {
            (second, first, id) = (first, d, hash(i, j, seed ^ 0x3F));
        } else if d < second {
            second = d;
        }
    }
    (first, second, id)
}

/// Cobblestones with dark joints.
pub(super) fn cobbles(u: f32, v: f32, seed: u32) -> Color {
    let (first, second, id) = cells(u, v, 14, seed);
    let grain = fractal(u, v, 48, 4, seed ^ 3);
    let joint = ((second - first) * 6.0).clamp(0.0, 1.0);
    let stone = mix([0.42, 0.41, 0.43], [0.66, 0.60, 0.53], id);
    mix([0.20, 0.18, 0.15], scaled(stone, 0.62 + 0.55 * grain), joint * (1.1 - 0.35 * first))
}

/// Square slabs, worn, each of its own shade.
pub(super) fn slabs(u: f32, v: f32, seed: u32) -> Color {
    let n = 4;
    let (i, j) = ((u * n as f32).floor() as i32, (v * n as f32).floor() as i32);
    let (fx, fy) = (u * n as f32 - i as f32, v * n as f32 - j as f32);
    let grain = fractal(u, v, 24, 5, seed);
    let spot = fractal(u, v, 7, 4, seed ^ 8);
    let joint = fx < 0.03 || fy < 0.03;
    let shade = if joint { 0.45 } else { 0.80 + 0.28 * hash(i, j, seed) };
    scaled([0.70, 0.67, 0.62], shade * (0.62 + 0.5 * grain) * (0.85 + 0.25 * spot))
}

/// Upright boards with grain and nail heads.
pub(super) fn wood(u: f32, v: f32, base: Color, seed: u32) -> Color {
    let boards = 5;
    let board = (u * boards as f32).floor() as i32;
    let f = u * boards as f32 - board as f32;
    let warp = fractal(u, v, 3, 4, seed + board as u32);
    let rings = (0.5 + 0.5 * (60.0 * (f * 0.35 + 0.35 * warp)).sin()) * 0.22;
    let nail = (f - 0.5).abs() < 0.06 && ((v * 2.0).fract() - 0.06).abs() < 0.012;
    if nail || f < 0.04 {
        return scaled(base, 0.25);
    }
    scaled(base, 0.72 + 0.3 * hash(board, 0, seed) + rings + 0.2 * (fractal(u, v, 40, 3, seed) - 0.5))
}

/// Leaves in several greens.
pub(super) fn leaves(u: f32, v: f32, seed: u32) -> Color {
    let (first, second, id) = cells(u, v, 18, seed);
    let (_, _, clump) = cells(u, v, 5, seed ^ 4);
    let edge = ((second - first) * 4.0).clamp(0.0, 1.0);
    let green = mix([0.16, 0.30, 0.10], [0.55, 0.66, 0.22], 0.65 * id + 0.35 * clump);
    scaled(green, 0.35 + 0.75 * edge)
}

/// Rows of rounded tiles.
pub(super) fn roof(u: f32, v: f32, seed: u32) -> Color {
    let (columns, rows) = (10, 10);
    let row = (v * rows as f32).floor() as i32;
    let x = u * columns as f32 + if row % 2 == 0 { 0.5 } else { 0.0 };
    let (fx, fy) = (x - x.floor(), v * rows as f32 - row as f32);
    let id = hash((x.floor() as i32).rem_euclid(columns), row, seed);
    let round = 1.0 - 0.5 * (2.0 * fx - 1.0).powi(2);
    let lip = if fy > 0.86 { 0.5 } else { 0.85 + 0.2 * fy };
    scaled(mix([0.52, 0.24, 0.17], [0.72, 0.38, 0.26], id), round * lip * (0.8 + 0.4 * fractal(u, v, 32, 3, seed)))
}

/// A window: frame, crossbars, sky in the panes and a curtain.
pub(super) fn window(u: f32, v: f32, frame: Color, seed: u32) -> Color {
    let bar = |x: f32, at: f32, half: f32| (x - at).abs() < half;
    if bar(u, 0.0, 0.07) || bar(u, 1.0, 0.07) || bar(v, 0.0, 0.05) || bar(v, 1.0, 0.05) {
        return scaled(frame, 0.9 + 0.1 * noise(u, v, 40, seed));
    }
    if bar(u, 0.5, 0.028) || bar(v, 0.36, 0.022) {
        return scaled(frame, 0.85);
    }
    let pane = hash((u * 2.0) as i32, i32::from(v > 0.36), seed) * 0.06;
    let cloud = fractal(u * 0.5, v * 0.5, 4, 4, seed ^ 2);
    let glass = mix([0.10, 0.13, 0.17], [0.52, 0.60, 0.68], (1.0 - v) * 0.5 * cloud + pane);
    let fold = 0.86 + 0.14 * (u * 90.0).sin();
    let side = (u - 0.5).abs() * 2.0;
    if side > 0.62 + 0.1 * (v * 7.0).sin() { scaled([0.80, 0.76, 0.68], 0.75 * fold) } else { glass }
}

/// A panelled door with a handle.
pub(super) fn door(u: f32, v: f32, base: Color, seed: u32) -> Color {
    let grain = 0.85 + 0.25 * fractal(u * 0.5, v * 0.125, 8, 4, seed);
    let (fu, fv) = ((u * 2.0).fract(), (v * 3.0).fract());
    let inside = (fu - 0.5).abs() < 0.34 && (fv - 0.5).abs() < 0.36;
    let rim = (fu - 0.5).abs() < 0.38 && (fv - 0.5).abs() < 0.40;
    if (u - 0.88).hypot((v - 0.55) * 2.0) < 0.035 {
        return [0.85, 0.72, 0.35];
    }
    scaled(
        base,
        grain
            * if inside {
                0.9
            } else if rim {
                0.6
            } else {
                1.05
            },
    )
}

/// Vertical stripes of an awning.
pub(super) fn stripes(u: f32, v: f32, color: Color) -> Color {
    let cloth = 0.92 + 0.1 * noise(u, v, 64, 3);
    scaled(if (u * 6.0).fract() < 0.5 { color } else { [0.93, 0.91, 0.86] }, cloth)
}

/// Dark painted iron, and checked cloth for clothes.
pub(super) fn speckled(u: f32, v: f32, base: Color, seed: u32) -> Color {
    scaled(base, 0.75 + 0.5 * fractal(u, v, 16, 4, seed))
}

/// Tartan cloth.
pub(super) fn cloth(u: f32, v: f32, base: Color, line: Color) -> Color {
    let band = |x: f32| ((x * 8.0).fract() - 0.5).abs() < 0.13;
    let weave = 0.9 + 0.2 * noise(u, v, 128, 6);
    let color = mix(base, line, 0.5 * (f32::from(band(u)) + f32::from(band(v))));
    scaled(color, weave)
}

/// A poster or a sign: lines of text over a colored ground with a frame, and an ornament below.
pub(super) fn sign(u: f32, v: f32, lines: &[&str], ground: Color, ink: Color, ornament: bool) -> Color {
    let edge = u.min(1.0 - u).min(v.min(1.0 - v));
    let paper = 0.90 + 0.12 * fractal(u, v, 6, 5, 40);
    if edge < 0.02 || (edge > 0.035 && edge < 0.048) {
        return scaled(ink, paper);
    }
    let bottom = if ornament { 0.55 } else { 0.92 };
    let height = (bottom - 0.08) / lines.len() as f32;
    let line = ((v - 0.08) / height).floor();
    if line >= 0.0 && (line as usize) < lines.len() && is_ink(u, (v - 0.08) / height - line, lines[line as usize]) {
        return scaled(ink, paper);
    }
    if ornament && v > 0.58 {
        let (x, y) = (u - 0.5, v - 0.76);
        let (r, angle) = (x.hypot(y), y.atan2(x));
        let petal = 0.10 + 0.055 * (7.0 * angle).sin();
        if r < 0.035 || (r < petal && r > 0.05) {
            return scaled(ink, paper);
        }
        if ((u * 24.0).floor() + (v * 24.0).floor()) as i32 % 2 == 0 && v > 0.90 {
            return scaled(mix(ground, ink, 0.6), paper);
        }
    }
    scaled(ground, paper)
}

/// Whether (`u`, `f`) of a line of text, `f` in [0, 1) from its top, is covered by a letter.
fn is_ink(u: f32, f: f32, text: &str) -> bool {
    let count = text.chars().count();
    let x = (u - 0.08) / 0.84 * count as f32;
    if !(x >= 0.0 && x < count as f32) || f > 0.82 {
        return false;
    }
    let (column, row) = ((x.fract() * 6.0) as usize, (f / 0.82 * 7.0) as usize);
    text.chars().nth(x as usize).is_some_and(|c| font::dots(c).any(|d| d == (column, row)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_meet_without_a_seam() {
        for k in 0..40 {
            let v = k as f32 / 40.0;
            assert!((fractal(0.0, v, 5, 4, 1) - fractal(1.0, v, 5, 4, 1)).abs() < 1e-4);
            assert!((cells(0.0, v, 7, 2).0 - cells(1.0, v, 7, 2).0).abs() < 1e-4);
        }
    }

    #[test]
    fn noise_fills_its_range_evenly() {
        let values: Vec<f32> = (0..4000).map(|i| hash(i, i / 7, 5)).collect();
        let mean = values.iter().sum::<f32>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
    }

    #[test]
    fn a_sign_shows_its_letters_upright() {
        // The stroke of an L stands at the left of its cell and its foot at the bottom.
        let dark = |u, f| is_ink(u, f, "L");
        assert!(dark(0.12, 0.1) && dark(0.12, 0.7) && dark(0.6, 0.78) && !dark(0.6, 0.2));
    }
}
