//! Motion in the formats of other programs: COLMAP models (written and read), glTF scenes and CSV tables (written).

pub mod colmap;
mod csv;
mod gltf;

pub use csv::write_csv;
pub use gltf::{Container, write_gltf};

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use crate::motion::sfm::{SfmFigures, SfmVerdict};
    use crate::motion::{ClipCameras, ClipMotion, FrameCamera, FrameMotion, MotionQuality, ShotCameras, WorldPoint};
    use crate::track::{FrameQuality, FrameTracks, Observation, TrackStore};
    use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
    use plumbline_num::time::{Timebase, Timestamp};

    const SIZE: (u32, u32) = (640, 360);

    /// Six frames, 25 to the second, that look at a few points; the fifth has no camera. Each point is seen 0.1 px off.
    pub(in crate::motion::exchange) fn walk() -> (ClipMotion, TrackStore) {
        let mut random = fastrand::Rng::with_seed(3);
        let mut point = |k: u32| {
            let (x, y) = (4.0 * random.f64() - 2.0, 2.0 * random.f64() - 1.0);
            WorldPoint { shot: 0, id: 3 * k + 1, position: Point3::new(x, y, 4.0 + 3.0 * random.f64()) }
        };
        let points: Vec<WorldPoint> = (0..40).map(&mut point).collect();
        let mut intrinsics = Intrinsics::centered(576.0, SIZE.0, SIZE.1);
        intrinsics.k1 = -0.05;
        let pose = |k: usize| {
            let rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.01, 0.03, -0.02) * k as f64);
            CameraPose::looking_from(Point3::new(0.1 * k as f64, 0.02, -0.05 * k as f64), rotation)
        };
        let camera = |k: usize| (k != 4).then(|| FrameCamera { pose: pose(k), intrinsics });
        let mut store = TrackStore::new().expect("a temporary folder");
        for (k, ticks) in (0..6).zip(0..) {
            let seen = |p: &WorldPoint| {
                let at = intrinsics.project(&pose(k).apply(&p.position)).expect("in front");
                let inside = (0.0..640.0).contains(&at.x) && (0.0..360.0).contains(&at.y);
                inside.then_some(Observation { id: p.id, x: at.x as f32 + 0.1, y: at.y as f32, background: true })
            };
            let observations = points.iter().filter_map(seen).collect();
            let pts = Timestamp(500 * ticks);
            store.push(&FrameTracks { pts, observations, quality: FrameQuality::default() }).expect("in range");
        }
        let quality = |k: i64| if k == 0 { MotionQuality::ShotStart } else { MotionQuality::Measured };
        let frames = (0..6).map(|k| FrameMotion::still(Timestamp(500 * k), quality(k))).collect();
        let mut motion = ClipMotion::new(SIZE.0, SIZE.1, Timebase { num: 1, den: 12_500 }, frames);
        let (verdict, reason) = (SfmVerdict::ThreeD, String::new());
        motion.cameras = Some(ClipCameras {
            frames: (0..6).map(camera).collect(),
            points,
            shots: vec![ShotCameras { frames: 0..6, verdict, reason, figures: SfmFigures::default() }],
        });
        (motion, store)
    }
}
