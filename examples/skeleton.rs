//! Extracts the skeleton of a mesh and bends it at a joint: `cargo run --release --example skeleton -- IN OUT [JOINT DEGREES]`.
//!
//! Prints the joints. With a joint (`joint_3`, see the list) the mesh is written with that joint rotated about its z axis,
//! otherwise as it is.

#![allow(clippy::print_stdout, reason = "a program that prints its result")]

use std::env;
use std::error::Error;

use nalgebra::UnitQuaternion;
use plumbline::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = env::args().skip(1).collect();
    let [input, output, rest @ ..] = args.as_slice() else {
        return Err("usage: skeleton IN OUT [JOINT DEGREES]".into());
    };
    let model = read_model(input.as_ref(), &ReadLimits::default(), &Run::default())?;

    // The surface is contracted to a curve; its ends, junctions and bends are the joints.
    let skeleton = extract_skeleton(model.mesh())?;
    for (joint, position) in skeleton.joints().iter().zip(skeleton.rest_positions()) {
        let parent = joint.parent.map_or("–", |parent| skeleton.joints()[parent as usize].name.as_str());
        println!("{:12} below {parent:12} at {position:.3}", joint.name);
    }

    // A pose holds the frame of every joint in that of its parent.
    let mut pose = skeleton.rest_pose();
    if let [joint, degrees] = rest {
        let local = &mut pose.locals[skeleton.named(joint)? as usize];
        let angle = degrees.parse::<f64>()?.to_radians();
        local.rotation *= UnitQuaternion::from_scaled_axis(Vec3::z() * angle);
    }

    // Automatic weights and dual quaternions in one call. For a movement, make the weights once (`bone_weights`) and pose a
    // `Skinner` frame by frame.
    let posed = skin(model.mesh(), &skeleton, &pose)?;
    write_model(output.as_ref(), &model.with_positions(posed)?)?;
    Ok(())
}
