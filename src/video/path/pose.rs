//! The pose of the crop window in a frame, and the exact test that it is inside the part that can be shown.

use nalgebra::Complex;

use super::Margins;
use plumbline_num::math::{Homography, Similarity2, Vec2};

pub(super) type C64 = Complex<f64>;

/// The frame in units of half its diagonal, origin at its center: `|x| ≤ half.0`, `|y| ≤ half.1`.
///
/// These units make the path independent of the resolution.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameUnits {
    /// Half width and half height, `half.0² + half.1² = 1`.
    pub(super) half: (f64, f64),
    unit_px: f64,
    center_px: Vec2,
}

impl FrameUnits {
    pub(super) fn new(width: u32, height: u32) -> Self {
        let center_px = Vec2::new(f64::from(width) / 2.0, f64::from(height) / 2.0);
        let unit_px = center_px.norm();
        Self { half: (center_px.x / unit_px, center_px.y / unit_px), unit_px, center_px }
    }

    /// `x ↦ z x + d` about the center for a similarity in pixels.
    pub(super) fn pose(&self, s: Similarity2) -> Pose {
        let d = s.apply(self.center_px.into()).coords - self.center_px;
        Pose { z: C64::new(s.a, s.b), d: C64::new(d.x, d.y) / self.unit_px }
    }

    /// The inverse of [`FrameUnits::pose`].
    pub(super) fn similarity(&self, p: Pose) -> Similarity2 {
        let linear = Similarity2 { a: p.z.re, b: p.z.im, t: Vec2::zeros() };
        let d = Vec2::new(p.d.re, p.d.im) * self.unit_px;
        Similarity2 { t: self.center_px + d - linear.apply(self.center_px.into()).coords, ..linear }
    }

    /// Corners of the frame.
    pub(super) fn corners(&self) -> [C64; 4] {
        let (w, h) = self.half;
        [C64::new(-w, -h), C64::new(w, -h), C64::new(w, h), C64::new(-w, h)]
    }

    /// The frame with `beyond` around it.
    pub(super) fn room(&self, beyond: &Margins) -> Room {
        let Margins { left, top, right, bottom } = *beyond;
        let grown = |half: f64, px: f64| half + px / self.unit_px;
        Room {
            least: C64::new(-grown(self.half.0, left), -grown(self.half.1, top)),
            most: C64::new(grown(self.half.0, right), grown(self.half.1, bottom)),
        }
    }

    /// Distance by which the window of `scale` times the output's size exceeds the room: ≤ 0 inside.
    pub(super) fn overhang(&self, pose: Pose, scale: f64, room: &Room) -> f64 {
        self.corners().into_iter().map(|q| pose.apply(scale * q)).fold(f64::NEG_INFINITY, |most, p| {
            let (low, high) = (room.least - p, p - room.most);
            [low.re, low.im, high.re, high.im].into_iter().fold(most, f64::max)
        })
    }

    /// The largest zoom factor `c ≤ 1` for which `{c·z, d}` keeps the window inside; ≤ 0 where the center is outside.
    pub(super) fn widest(&self, pose: Pose, room: &Room) -> f64 {
        let side = |room: f64, reach: f64| if reach > 0.0 { room / reach } else { f64::INFINITY };
        let (before, after) = (pose.d - room.least, room.most - pose.d);
        self.corners().into_iter().map(|q| pose.z * q).fold(1.0, |c: f64, r| {
            let along = |r: f64, before: f64, after: f64| side(if r < 0.0 { before } else { after }, r.abs());
            c.min(along(r.re, before.re, after.re)).min(along(r.im, before.im, after.im))
        })
    }
}

/// The rectangle that the window must stay in, in [`FrameUnits`]: the frame, or more where its neighbors show what is beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Room {
    pub(super) least: C64,
    pub(super) most: C64,
}

/// A similarity about the frame's center, `x ↦ z x + d`, in [`FrameUnits`]. As a virtual camera: `src_from_out`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    /// Scale and rotation, `s·e^{iθ}`. For the virtual camera `s` is the linear crop: below 1 the output is zoomed in.
    pub(super) z: C64,
    /// Displacement of the center.
    pub(super) d: C64,
}

impl Pose {
    pub(super) const IDENTITY: Self = Self { z: C64::new(1.0, 0.0), d: C64::new(0.0, 0.0) };

    pub(super) fn apply(&self, x: C64) -> C64 {
        self.z * x + self.d
    }

    /// First `inner`, then `self`.
    pub(super) fn after(&self, inner: Self) -> Self {
        Self { z: self.z * inner.z, d: self.apply(inner.d) }
    }

    pub(super) fn inverse(&self) -> Self {
        let z = self.z.inv();
        Self { z, d: -(z * self.d) }
    }

    /// Linear interpolation to `other`. The poses inside the frame are a convex set.
    pub(super) fn toward(&self, other: Self, fraction: f64) -> Self {
        Self { z: self.z + (other.z - self.z) * fraction, d: self.d + (other.d - self.d) * fraction }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.z.is_finite() && self.d.is_finite() && self.z.norm_sqr() > 0.0
    }
}

/// `out_from_src` in pixels for a virtual camera, the window inside the room to the last bit.
///
/// The solver and the change of units leave errors near `1e-9`. The pose is moved toward the centered window of the
/// same scale, which is strictly inside, by doubling steps until the pixel matrix itself passes the test.
pub(super) fn settle(units: &FrameUnits, pose: Pose, window: f64, room: &Room) -> (Pose, Homography) {
    let scale = pose.z.norm().min(1.0 / window);
    let safe = Pose { z: C64::new(scale * (1.0 - 1e-6), 0.0), d: C64::new(0.0, 0.0) };
    let mut fraction = 0.0;
    loop {
        let p = pose.toward(safe, fraction);
        let src_from_out = units.similarity(p);
        if let Some(out_from_src) = src_from_out.inverse()
            && (fraction >= 1.0 || stays_inside(units, out_from_src, window, room))
        {
            return (p, out_from_src.to_homography());
        }
        fraction = if fraction == 0.0 { 1e-9 } else { (fraction * 4.0).min(1.0) };
    }
}

/// Whether the output window's preimage under the final pixel map is in the room.
fn stays_inside(units: &FrameUnits, out_from_src: Similarity2, window: f64, room: &Room) -> bool {
    out_from_src.inverse().is_some_and(|s| units.overhang(units.pose(s), window, room) <= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units() -> FrameUnits {
        FrameUnits::new(640, 360)
    }

    #[test]
    fn poses_and_pixel_similarities_are_the_same_maps() {
        let s = Similarity2::about(plumbline_num::math::Point2::new(100.0, 50.0), 0.2, 0.9, Vec2::new(7.0, -3.0));
        let back = units().similarity(units().pose(s));
        assert!((back.a - s.a).abs() < 1e-15 && (back.b - s.b).abs() < 1e-15 && (back.t - s.t).norm() < 1e-10);
        let moved = Similarity2 { t: Vec2::new(36.7, 0.0), ..Similarity2::IDENTITY };
        let half_diagonal = 320.0_f64.hypot(180.0);
        assert!((units().pose(moved).d.re - 36.7 / half_diagonal).abs() < 1e-15);
    }

    #[test]
    fn the_widest_window_touches_the_edge() {
        let pose = Pose { z: C64::from_polar(1.0, 0.05), d: C64::new(0.03, -0.02) };
        for beyond in [Margins::default(), Margins { left: 3.0, top: 0.0, right: 20.0, bottom: 5.0 }] {
            let room = units().room(&beyond);
            let c = units().widest(pose, &room);
            assert!(c < 1.0);
            assert!(units().overhang(Pose { z: pose.z * c, ..pose }, 1.0, &room).abs() < 1e-12);
        }
    }

    #[test]
    fn an_overhanging_window_is_settled_inside_by_a_hair() {
        let rotated = Pose { z: C64::from_polar(1.0, 0.01), d: C64::new(0.05, 0.01) };
        let frame = units().room(&Margins::default());
        let over = Pose { z: rotated.z * (units().widest(rotated, &frame) * (1.0 + 1e-7)), ..rotated };
        assert!(units().overhang(over, 1.0, &frame) > 0.0);
        let (settled, out_from_src) = settle(&units(), over, 1.0, &frame);
        assert!((settled.d - over.d).norm() + (settled.z - over.z).norm() < 1e-5);
        let src_from_out = out_from_src.inverse().expect("a similarity");
        for (x, y) in [(0.0, 0.0), (640.0, 0.0), (640.0, 360.0), (0.0, 360.0)] {
            let p = src_from_out.apply(plumbline_num::math::Point2::new(x, y)).expect("affine");
            assert!((-1e-10..=640.0 + 1e-10).contains(&p.x) && (-1e-10..=360.0 + 1e-10).contains(&p.y), "{p}");
        }
    }
}
