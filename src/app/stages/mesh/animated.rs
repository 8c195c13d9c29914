//! Poses as one glTF model: the first as its surface, the others as morph targets, and an animation of their weights.
//!
//! Between key `k` and the next the weight of one target falls from 1 to 0 while that of the other rises: every pose is met exactly, and
//! between two the surface goes straight.

use nalgebra::Point3;

use plumbline_shape::mesh::model::articulation::{
    Animation, Articulation, Channel, ChannelInterpolation, Instance, MorphTarget, Node, Property,
};
use plumbline_shape::mesh::{MeshError, Model};

/// A model that goes through poses, evenly in so many seconds: the first as its surface, the others as morph targets.
///
/// # Errors
/// [`MeshError`] for poses that are not finite.
///
/// # Panics
/// If a pose has another number of positions than the model has vertices.
pub fn animated(model: &Model, poses: &[Vec<Point3<f64>>], seconds: f64, name: &str) -> Result<Model, MeshError> {
    let Some((first, others)) = poses.split_first() else { return Ok(model.clone()) };
    let still = model.clone().with_articulation(None)?.with_positions(first.clone())?;
    let target = |(k, pose): (usize, &Vec<Point3<f64>>)| target(&still, pose, k + 1);
    let targets = others.iter().enumerate().map(target).collect::<Result<Vec<_>, MeshError>>()?;
    let steps = others.len().max(1) as f64;
    let weights = (0..poses.len()).flat_map(|k| (1..poses.len()).map(move |j| if j == k { 1.0 } else { 0.0 }));
    let channel = Channel {
        node: 0,
        property: Property::Weights,
        interpolation: ChannelInterpolation::Linear,
        times: (0..poses.len()).map(|k| seconds * k as f64 / steps).collect(),
        values: weights.collect(),
    };
    let articulation = Articulation {
        nodes: vec![Node { name: Some(name.to_owned()), ..Node::default() }],
        roots: vec![0],
        instances: vec![Instance { node: 0, targets, ..Instance::default() }],
        instance_of_vertex: vec![0; first.len()],
        animations: vec![Animation { name: Some(name.to_owned()), channels: vec![channel] }],
        ..Articulation::default()
    };
    still.with_articulation(Some(articulation))
}

/// A pose as differences, with those of the normals for files with normals.
fn target(still: &Model, pose: &[Point3<f64>], number: usize) -> Result<MorphTarget, MeshError> {
    let moved = still.mesh().with_positions(pose.to_vec())?;
    let offsets = pose.iter().zip(still.mesh().positions()).map(|(p, q)| (p - q).into()).collect();
    let normals = moved.vertex_normals().into_iter().zip(still.mesh().vertex_normals()).map(|(n, m)| (n - m).into());
    Ok(MorphTarget {
        name: Some(format!("pose {number}")),
        weight: 0.0,
        vertices: (0..pose.len() as u32).collect(),
        offsets,
        normals: normals.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_shape::mesh::shapes;

    #[test]
    fn at_every_key_the_model_stands_in_that_pose() {
        let mesh = shapes::icosphere(1);
        let pose = |k: f64| mesh.positions().iter().map(|p| Point3::new(p.x + k, p.y * (1.0 + k), p.z)).collect();
        let poses: Vec<Vec<Point3<f64>>> = [0.5, 1.0, 3.0, 2.0].map(pose).to_vec();
        let model = animated(&Model::of_mesh(mesh.clone()), &poses, 6.0, "ball").expect("valid");
        let moving = model.articulation().expect("it moves");
        let channel = &moving.animations[0].channels[0];
        assert_eq!((channel.times.as_slice(), channel.values.len()), (&[0.0, 2.0, 4.0, 6.0][..], 12));
        for (k, pose) in poses.iter().enumerate() {
            for (v, expected) in pose.iter().enumerate() {
                let weights = &channel.values[3 * k..3 * k + 3];
                let offsets = moving.instances[0].targets.iter().zip(weights);
                let moved = offsets
                    .fold(model.mesh().positions()[v], |p, (t, w)| p + nalgebra::Vector3::from(t.offsets[v]) * *w);
                assert!((moved - expected).norm() < 1e-12);
            }
        }
    }
}
