//! Programs that give single parts of the library to the scripts that hold them against other software: `programs NAME ...`.
//!
//! The oracle tests (`tests/oracle/`) and the benchmarks beside this folder run them; each file says what its program takes and
//! prints.

#![allow(clippy::print_stdout)] // each prints its results

mod cameras_from_tracks;
mod cholesky_times;
mod deform_mesh;
mod faces_of_image;
mod klt_frames;
mod lens_points;
mod lines_of_image;
mod motion_from_tracks;
mod regression_times;
mod retarget_map;
mod segments_of_image;
mod skin_points;
mod tracks_of_clip;
mod transcode;

/// The arguments of the program that runs, its name first.
fn args() -> impl Iterator<Item = String> {
    std::env::args().skip(1)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    match args().next().as_deref().unwrap_or_default() {
        "cameras_from_tracks" => cameras_from_tracks::main(),
        "cholesky_times" => cholesky_times::main(),
        "deform_mesh" => deform_mesh::main(),
        "faces_of_image" => faces_of_image::main(),
        "klt_frames" => klt_frames::main(),
        "lens_points" => lens_points::main(),
        "lines_of_image" => lines_of_image::main(),
        "motion_from_tracks" => motion_from_tracks::main(),
        "regression_times" => regression_times::main(),
        "retarget_map" => retarget_map::main(),
        "segments_of_image" => segments_of_image::main(),
        "skin_points" => skin_points::main(),
        "tracks_of_clip" => tracks_of_clip::main(),
        "transcode" => transcode::main(),
        other => Err(format!("no program `{other}` (expected one of cameras_from_tracks, cholesky_times, deform_mesh, faces_of_image, klt_frames, lens_points, lines_of_image, motion_from_tracks, regression_times, retarget_map, segments_of_image, skin_points, tracks_of_clip, transcode)").into()),
    }
}
