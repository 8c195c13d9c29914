//! `mesh.render`: draws a mesh.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Point3;

use super::numpy::read_npy;
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::job::Job;
use crate::pipeline::paths::to_path;
use crate::pipeline::sizes::PixelSize;
use crate::pipeline::surfaces::BackgroundColor;
use plumbline_image::canvas::Rgb;
use plumbline_image::still::{Photo, frame_of_rgb};
use plumbline_num::document::read_bounded;
use plumbline_shape::character::io::read_rig;
use plumbline_shape::character::skeleton_file::SkeletonFile;
use plumbline_shape::character::{CurveSkeleton, Skeleton};
use plumbline_shape::draw::{
    CLAY, Label, Mark, Paint, Scale, Shape, Style, Surface, SurfaceCamera, UpAxis, ViewDirection, Wireframe,
    branch_marks, draw, draw_labels, node_marks,
};
use plumbline_shape::mesh::{Model, TriMesh};

/// Settings of `mesh.render`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(clippy::struct_excessive_bools, reason = "switches that do not depend on each other")]
pub struct MeshRenderSettings {
    /// Size of the picture, such as 1280x960
    pub size: PixelSize,
    /// From where: corner, front, back, left, right, top, bottom, or YAW,PITCH in degrees
    pub view: ViewDirection,
    /// Axis that points up
    pub up: UpAxis,
    /// Triangles flat; else normals are smooth up to creases
    pub flat: bool,
    /// Edges as lines, of polygons without their diagonals
    pub wireframe: bool,
    /// The vertices' own colors, where the file has any
    pub colors: bool,
    /// Numbers as colors: a NumPy file with one per vertex or triangle, or x, y, z, displacement or stretch
    pub scalar: Option<String>,
    /// Faces seen from behind in another color
    pub mark_back: bool,
    /// A skeleton inside the mesh: json (its curve is drawn too), glb, gltf, fbx, bvh, tgf or skel
    #[schemars(extend("format" = "path"))]
    pub skeleton: Option<String>,
    /// The names of the joints of the skeleton beside them, as far as there is room
    pub labels: bool,
    /// How opaque the mesh is, 0 to 1; what is behind shows through. 0.2 with a skeleton, else 1, if left out
    #[schemars(range(min = 0, max = 1))]
    pub opacity: Option<f64>,
    /// Handles of a deformed mesh as dots: fixed ones dark, moved ones orange
    pub handles: bool,
    /// One color behind the mesh: white, black, gray or #RRGGBB; a light gradient if left out
    pub background: Option<BackgroundColor>,
}

impl Default for MeshRenderSettings {
    fn default() -> Self {
        Self {
            size: PixelSize { width: 1280, height: 960 },
            view: ViewDirection::default(),
            up: UpAxis::default(),
            flat: false,
            wireframe: false,
            colors: false,
            scalar: None,
            mark_back: false,
            skeleton: None,
            labels: false,
            opacity: None,
            handles: true,
            background: None,
        }
    }
}

impl MeshRenderSettings {
    /// Names of numbers that every mesh has, or every deformed one.
    pub const ATTRIBUTES: [&'static str; 5] = ["x", "y", "z", "displacement", "stretch"];

    /// How opaque the surface is drawn.
    pub fn drawn_opacity(&self) -> f64 {
        self.opacity.unwrap_or(if self.skeleton.is_some() { 0.2 } else { 1.0 })
    }

    /// The file that `scalar` names.
    pub fn scalar_file(&self) -> Option<&str> {
        self.scalar.as_deref().filter(|s| !Self::ATTRIBUTES.contains(s))
    }
}

impl Stage for MeshRenderSettings {
    const KIND: &'static str = "mesh.render";
    const SUMMARY: &'static str = "draws a mesh in its last pose, lit, with the camera fitted to it";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh")];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture, 8 bit")];
    type Input = (Posed,);
    type Output = (Arc<Photo>,);

    fn memory(&self) -> Vec<MemoryCost> {
        // Nine samples per pixel, each with a triangle and a depth; of translucent surfaces two layers of them, and depth and
        // opacity of twelve.
        let samples = if self.drawn_opacity() < 1.0 { 2 * 9 * 8 + 12 * 8 } else { 9 * 8 };
        let bytes = u64::from(self.size.width) * u64::from(self.size.height) * (samples + 6 + 16);
        vec![MemoryCost { what: "samples of the picture", bytes, ..MemoryCost::default() }]
    }

    fn conflicts(&self) -> Vec<Conflict> {
        let both = (self.colors && self.scalar.is_some()).then(|| Conflict {
            key: "colors",
            message: "`colors` and `scalar` color the same surface".to_owned(),
            help: "take one of both",
        });
        let nameless = (self.labels && self.skeleton.is_none()).then(|| Conflict {
            key: "labels",
            message: "`labels` are the names of the joints of a skeleton".to_owned(),
            help: "give `skeleton`",
        });
        both.into_iter().chain(nameless).collect()
    }

    fn reads(&self) -> Vec<&str> {
        self.scalar_file().into_iter().chain(self.skeleton.as_deref()).collect()
    }

    fn run(&self, (posed,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let mesh = posed.mesh()?;
        if mesh.triangle_count() == 0 {
            context.warn("there is no triangle to draw".to_owned());
        }
        let values = values(&posed, &mesh, self)?;
        let own: Option<Vec<Rgb>> = self.colors.then(|| posed.model.colors().map(bytes)).flatten();
        if self.colors && own.is_none() {
            context.warn("the file has no colors of vertices".to_owned());
        }
        let paint = match (&values, &own) {
            (Some(v), _) if v.len() == mesh.vertex_count() => Paint::VertexValues(v, Scale::of(v)),
            (Some(v), _) => Paint::FaceValues(v, Scale::of(v)),
            (None, Some(colors)) => Paint::VertexColors(colors),
            (None, None) => Paint::Plain(CLAY),
        };
        let size = (self.size.width as usize, self.size.height as usize);
        let camera = SurfaceCamera::fit(seen(&mesh), self.view, self.up, size);
        let edges = self.wireframe.then(|| polygon_edges(&posed.model));
        let mut marks = if self.handles { marks(&posed, size) } else { Vec::new() };
        let inside = self.skeleton.as_ref().map(|path| read_skeleton(&to_path(path), context.job)).transpose()?;
        if let Some((skeleton, curve)) = &inside {
            marks.extend(skeleton_marks(skeleton, curve.as_ref(), size));
        }
        let surface = Surface { mesh: &mesh, paint, edges: edges.as_deref(), marks: &marks };
        let mut drawn = draw(&surface, &camera, &style(self), &context.job.run())?;
        if let Some((skeleton, _)) = inside.as_ref().filter(|_| self.labels) {
            let joints = skeleton.joints();
            let named = joints.iter().zip(skeleton.rest_positions());
            let labels: Vec<Label<'_>> = named.map(|(joint, at)| Label { at, text: &joint.name }).collect();
            let shown = draw_labels(&labels, joint_px(size), &camera, &mut drawn);
            if shown < joints.len() {
                let count = joints.len();
                context.warn(format!("names of {shown} of {count} joints: a larger `size` has room for more"));
            }
        }
        let frame = frame_of_rgb(drawn.as_bytes(), size.0, size.1).map_err(|e| RunError::Internal(e.to_string()))?;
        Ok((Arc::new(Photo::new(frame)),))
    }
}

/// Dots of handles that move, and of those that stay fixed.
const MOVED: Rgb = [235, 120, 20];
const FIXED: Rgb = [60, 70, 90];
/// Faces from behind.
const BACK: Rgb = [196, 88, 64];
/// Diameter of a dot as a fraction of the picture's smaller side, of a joint, and width of a bone: 8, 13 and 5 px in the
/// default picture, so that a joint covers the ends of its bones and a handle is seen beside it.
const DOT: f64 = 0.008;
const JOINT: f64 = 0.014;
const BONE: f64 = 0.005;

fn style(settings: &MeshRenderSettings) -> Style {
    let plain = Style::default();
    Style {
        flat: settings.flat,
        wireframe: settings.wireframe.then(|| {
            let side = settings.size.width.min(settings.size.height);
            Wireframe { width_px: (f64::from(side) / 1000.0).max(1.0), ..Wireframe::default() }
        }),
        back: settings.mark_back.then_some(BACK),
        opacity: settings.drawn_opacity(),
        background: settings.background.map_or(plain.background, |color| [color.0; 2]),
        ..plain
    }
}

/// Vertices that belong to triangles; all where there are none.
fn seen(mesh: &TriMesh) -> Vec<&Point3<f64>> {
    let mut named = vec![mesh.triangle_count() == 0; mesh.vertex_count()];
    mesh.triangles().iter().flatten().for_each(|v| named[*v as usize] = true);
    mesh.positions().iter().zip(named).filter_map(|(p, named)| named.then_some(p)).collect()
}

fn bytes(colors: &[[f32; 4]]) -> Vec<Rgb> {
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    colors.iter().map(|[r, g, b, _]| [byte(*r), byte(*g), byte(*b)]).collect()
}

/// Which edges of each triangle are edges of its polygon: corners of a polygon are consecutive.
fn polygon_edges(model: &Model) -> Vec<u8> {
    let mut last_corner = vec![0_u32; model.faces().len()];
    let mut first_corner = vec![u32::MAX; model.faces().len()];
    let faces = model.face_of_triangle().iter().zip(model.triangle_corners());
    for (face, corners) in faces.clone() {
        for corner in corners {
            let face = *face as usize;
            first_corner[face] = first_corner[face].min(*corner);
            last_corner[face] = last_corner[face].max(*corner);
        }
    }
    let flags = |(face, corners): (&u32, &[u32; 3])| {
        let (first, last) = (first_corner[*face as usize], last_corner[*face as usize]);
        let joined = |a: u32, b: u32| {
            let (low, high) = (a.min(b), a.max(b));
            high - low == 1 || (low == first && high == last)
        };
        (0..3).filter(|k| joined(corners[*k], corners[(k + 1) % 3])).fold(0, |bits, k| bits | 1 << k)
    };
    faces.map(flags).collect()
}

/// Dots on the handles.
fn marks(posed: &Posed, size: (usize, usize)) -> Vec<Mark> {
    let width_px = (size.0.min(size.1) as f64 * DOT).max(4.0);
    let positions = posed.last();
    let mark = |(v, moves): &(u32, bool)| Mark {
        shape: Shape::Point(positions[*v as usize]),
        color: if *moves { MOVED } else { FIXED },
        width_px,
    };
    posed.handles.iter().map(mark).collect()
}

/// The skeleton of a file, and the curve that it was made of.
fn read_skeleton(path: &Path, job: &Job<'_>) -> Result<(Skeleton, Option<CurveSkeleton>), RunError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        let read = SkeletonFile::read(path).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
        return Ok((read.skeleton, read.curve));
    }
    let read = read_rig(path, &job.read_limits(), &job.run());
    Ok((read.map_err(|e| RunError::Input(e.to_string()))?.skeleton, None))
}

/// Diameter of a joint, px.
fn joint_px(size: (usize, usize)) -> f64 {
    (size.0.min(size.1) as f64 * JOINT).max(5.0)
}

/// The joints of a skeleton, and the curve that they were made of, or else bones.
fn skeleton_marks(skeleton: &Skeleton, curve: Option<&CurveSkeleton>, size: (usize, usize)) -> Vec<Mark> {
    let joints = skeleton.rest_positions();
    let numbered = skeleton.joints().iter().zip(0..);
    let bones: Vec<[u32; 2]> = numbered.filter_map(|(joint, j)| joint.parent.map(|p| [p, j])).collect();
    let width = (size.0.min(size.1) as f64 * BONE).max(2.0);
    let mut marks = match curve {
        Some(curve) => branch_marks(&curve.nodes, &curve.edges, width),
        None => branch_marks(&joints, &bones, width),
    };
    marks.extend(node_marks(&joints, &bones, joint_px(size)));
    marks
}

/// The numbers that color the mesh: one per vertex, or one per triangle.
fn values(posed: &Posed, mesh: &TriMesh, settings: &MeshRenderSettings) -> Result<Option<Vec<f64>>, RunError> {
    let Some(name) = settings.scalar.as_deref() else { return Ok(None) };
    let (now, rest) = (mesh.positions(), posed.model.mesh().positions());
    let along = |axis: usize| now.iter().map(|p| p[axis]).collect();
    Ok(Some(match name {
        "x" => along(0),
        "y" => along(1),
        "z" => along(2),
        "displacement" => now.iter().zip(rest).map(|(a, b)| nalgebra::distance(a, b)).collect(),
        "stretch" => stretch(mesh, rest),
        file => of_file(&to_path(file), mesh)?,
    }))
}

/// Per triangle, the largest relative change of an edge.
fn stretch(mesh: &TriMesh, rest: &[Point3<f64>]) -> Vec<f64> {
    let length = |p: &[Point3<f64>], a: u32, b: u32| nalgebra::distance(&p[a as usize], &p[b as usize]);
    let change = |a: u32, b: u32| (length(mesh.positions(), a, b) / length(rest, a, b) - 1.0).abs();
    mesh.triangles().iter().map(|&[a, b, c]| change(a, b).max(change(b, c)).max(change(c, a))).collect()
}

/// Size of the largest NumPy file, bytes: doubles for 2²⁷ vertices, more than a mesh file may have.
const MAX_BYTES: u64 = 1 << 30;

fn of_file(path: &Path, mesh: &TriMesh) -> Result<Vec<f64>, RunError> {
    let bad = |what: String| RunError::Input(format!("{}: {what}", path.display()));
    let bytes = read_bounded(path, MAX_BYTES).map_err(|e| {
        let names = MeshRenderSettings::ATTRIBUTES.join(", ");
        bad(format!("{e} (expected a NumPy file, or one of {names})"))
    })?;
    let values = read_npy(&bytes).map_err(bad)?;
    let (vertices, triangles) = (mesh.vertex_count(), mesh.triangle_count());
    if values.len() != vertices && values.len() != triangles {
        let count = values.len();
        return Err(bad(format!(
            "{count} numbers (expected {vertices}, one per vertex, or {triangles}, one per triangle)"
        )));
    }
    Ok(values)
}
