//! From the axes of the coded picture to those in which a player shows it.

use nalgebra::Matrix3;

use plumbline_media::VideoInfo;
use plumbline_num::math::Vec2;

/// How a player shows the coded picture: mirrored from left to right or not, then rotated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shown {
    /// Clockwise, degrees.
    pub(super) rotation_deg: f64,
    /// Left and right are swapped first.
    pub(super) mirrored: bool,
}

impl Shown {
    pub(super) fn of(video: &VideoInfo) -> Self {
        Self { rotation_deg: video.rotation_deg, mirrored: video.mirrored }
    }

    /// A shift of the coded picture, as a viewer sees it.
    pub(super) fn shift(self, v: Vec2) -> Vec2 {
        let m = self.axes();
        Vec2::new(m[(0, 0)] * v.x + m[(0, 1)] * v.y, m[(1, 0)] * v.x + m[(1, 1)] * v.y)
    }

    /// A clockwise rotation of the coded picture, as a viewer sees it.
    pub(super) fn rotation(self, angle: f64) -> f64 {
        if self.mirrored { -angle } else { angle }
    }

    /// `shown_from_coded` of vectors in the camera's axes.
    pub(super) fn axes(self) -> Matrix3<f64> {
        let (sin, cos) = self.rotation_deg.to_radians().sin_cos();
        let x = if self.mirrored { -1.0 } else { 1.0 };
        #[rustfmt::skip]
        let m = Matrix3::new(
            x * cos, -sin, 0.0,
            x * sin,  cos, 0.0,
            0.0,      0.0, 1.0,
        );
        m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_right_in_a_picture_turned_clockwise_goes_down() {
        let near = |a: Vec2, b: Vec2| assert!((a - b).norm() < 1e-12, "{a} {b}");
        let right = Vec2::new(1.0, 0.0);
        near(Shown { rotation_deg: 0.0, mirrored: false }.shift(right), right);
        near(Shown { rotation_deg: 90.0, mirrored: false }.shift(right), Vec2::new(0.0, 1.0));
        near(Shown { rotation_deg: 90.0, mirrored: true }.shift(right), Vec2::new(0.0, -1.0));
        near(Shown { rotation_deg: -90.0, mirrored: false }.shift(Vec2::new(0.0, 2.0)), Vec2::new(2.0, 0.0));
        assert_eq!(Shown { rotation_deg: 90.0, mirrored: true }.rotation(0.1), -0.1);
    }
}
