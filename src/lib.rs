//! **plumbline**: hold shaky video steady (deshake, rolling shutter), make straight lines of wide-angle photos straight (defish,
//! perspective correction), give pictures another shape, and deform, rig, pose and morph meshes.
//!
//! Each of these is one sparse optimization with its limits set by you: vertices `x` of a grid laid over a picture (a *warp*) or
//! of a surface (a *deformation*) minimize an energy under constraints,
//!
//! ```text
//! E(x) = Σᵣ wᵣ ‖Σⱼ aᵣⱼ xⱼ − bᵣ‖²      s.t.  x_f = c_f  for the fixed vertices f,
//! ```
//!
//! whose sparse matrix is factored once and solved many times ([`num::energy`]); pixels are sampled exactly once. [`prelude`] has the names that most programs need.
//!
//! | module | holds | where to begin |
//! | --- | --- | --- |
//! | `clip` | video files for the stabilizer (feature `media`) | `ClipFile` |
//! | [`video`] | tracking, camera motion, the virtual camera | [`Stabilizer`](video::stabilize::Stabilizer) |
//! | [`photo`] | rectifying, retargeting, marked lines, calibration | [`rectify`](photo::rectify::rectify()), [`retarget`](photo::retarget::retarget()) |
//! | [`shape`] | meshes: files, repair, deformation, skeletons, skinning, morphing, drawing | [`deform`](shape::surface::deform), [`skeleton`](shape::character::extraction::skeleton) |
//! | [`camera`] | lenses, lens files, poses | [`read_lens`](camera::read_lens) |
//! | [`image`] | frames, picture files, features, image warps, rendering | [`Photo`](image::still::Photo), [`Renderer`](image::render::Renderer) |
//! | [`num`] | points, time, sparse systems, energies, optimizers | [`Run`](num::run::Run), [`energy`](num::energy) |
//! | `media` | probing, decoding and encoding through FFmpeg (feature `media`) | `VideoReader`, `VideoWriter` |
//! | `app` | pipelines and the command line (feature `cli`) | |
//!
//! Without the features `media` and `cli` (both default) this is a library of Rust alone. Calls that can take long take a
//! [`Run`](num::run::Run), which stops them and hears of their progress; work is done in the caller's rayon pool.
//!
//! # Stabilize a clip
//!
#![cfg_attr(feature = "media", doc = "```")]
#![cfg_attr(not(feature = "media"), doc = "```ignore")]
//! use plumbline::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let clip = ClipFile::open("media/street-walk.mp4")?.trimmed(0.0, 1.0)?;
//! let stabilizer = Stabilizer::new(StabilizerOptions::default().with_keep(0.85))?; // keeps 85 % of the width and height
//! let analysis = stabilizer.analyze(&clip, &Run::default())?; // expensive, and the same for every plan
//! let plan = stabilizer.plan(&analysis, &Run::default())?;
//! clip.render(&plan, std::env::temp_dir().join("steady.mp4"), &Run::default())?;
//! # Ok(())
//! # }
//! ```
//!
//! # Rectify a photo
//!
//! ```
//! use plumbline::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let photo = Photo::load("media/room-kb-125.jpg")?;
//! let lens = read_lens("media/room-kb-125.lens.json".as_ref(), &ExifFacts::default())?.lens;
//! let marked = LinesFile::read("media/room-kb-125.lines.json".as_ref(), photo.size())?;
//! let lines: Vec<Line> = marked.in_use().cloned().collect();
//! let input = RectifyInput { lens: &lens, lines: &lines, soft_lines: &[], found: false, faces: &[], saliency: None };
//! let warp = rectify(&input, &RectifyOptions::default(), &Run::default())?;
//! let straight = photo.rendered(&warp.field, warp.size, &Run::default())?;
//! straight.save(std::env::temp_dir().join("straight.jpg"))?;
//! # Ok(())
//! # }
//! ```
//!
//! # Deform a mesh
//!
//! ```
//! use plumbline::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = read_model("media/mesh-bar.ply".as_ref(), &ReadLimits::default(), &Run::default())?;
//! let rest = model.mesh().positions();
//! let ends = (0..).zip(rest).filter(|(_, p)| p.z <= 0.0 || p.z >= 5.0).map(|(v, _)| v);
//! let handles = Handles::exact(ends)?; // both ends of a bar 5 units long
//! let aside = |p: &Point3| p + Vec3::new(if p.z > 2.5 { 2.0 } else { 0.0 }, 0.0, 0.0);
//! let targets: Vec<Point3> = handles.vertices().iter().map(|v| aside(&rest[*v as usize])).collect();
//! let bent = deform(model.mesh(), &handles, &targets, Method::Arap)?; // as rigid as possible
//! write_model(&std::env::temp_dir().join("bent.ply"), &model.with_positions(bent)?)?;
//! # Ok(())
//! # }
//! ```
//!
//! # Extract a skeleton
//!
//! ```
//! use plumbline::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = read_model("media/dog.ply".as_ref(), &ReadLimits::default(), &Run::default())?;
//! let skeleton = extract_skeleton(model.mesh())?;
//! for (joint, position) in skeleton.joints().iter().zip(skeleton.rest_positions()) {
//!     println!("{} at {position}", joint.name);
//! }
//! let posed = skin(model.mesh(), &skeleton, &skeleton.rest_pose())?; // with automatic weights
//! # assert_eq!(posed.len(), model.mesh().vertex_count());
//! # Ok(())
//! # }
//! ```
//!
//! Programs with arguments that do the same are in `examples/`.

#[cfg(feature = "media")]
pub mod clip;
pub mod prelude;

#[cfg(feature = "cli")]
pub use plumbline_app as app;
pub use plumbline_camera as camera;
pub use plumbline_image as image;
#[cfg(feature = "media")]
pub use plumbline_media as media;
pub use plumbline_num as num;
pub use plumbline_photo as photo;
pub use plumbline_shape as shape;
pub use plumbline_video as video;
