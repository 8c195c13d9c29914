//! What flows between stages of pictures and meshes, and the port types that it travels under.
//!
//! Everything is counted by reference and dropped after the last stage that takes it.

use std::sync::{Arc, Weak};

use nalgebra::Point3;

use super::context::Context;
use super::image_render::{Unsampled, render_error};
use super::photo::lens::Found;
use crate::pipeline::graph::Edge;
use crate::pipeline::port::PortType;
use crate::pipeline::port_value::PortValue;
use crate::pipeline::run_error::RunError;
use plumbline_image::feature::{Face, Importance};
use plumbline_image::still::Photo;
use plumbline_photo::line_detection::LineSearch;
use plumbline_photo::{Line, PhotoWarp};
use plumbline_shape::character::io::Rig;
use plumbline_shape::mesh::{MeshError, Model, TriMesh};

/// A picture that the stage that writes it may write while it is made.
#[derive(Clone)]
pub enum Picture {
    /// Its pixels are there.
    Made(Arc<Photo>),
    /// They are made when they are asked for, for the first stage that needs the whole of them.
    Unsampled(Arc<Unsampled>),
}

impl PortValue for Picture {
    const DATA: PortType = PortType::Image;

    fn at(context: &Context<'_, '_>, edge: &Edge) -> Result<Self, RunError> {
        let picture = context.values.get::<Self>(edge).cloned();
        picture.or_else(|_| context.values.get::<Arc<Photo>>(edge).cloned().map(Self::Made))
    }
}

impl PortValue for Arc<Photo> {
    const DATA: PortType = PortType::Image;

    fn at(context: &Context<'_, '_>, edge: &Edge) -> Result<Self, RunError> {
        match Picture::at(context, edge)? {
            Picture::Made(photo) => Ok(photo),
            Picture::Unsampled(unsampled) => unsampled.photo().map_err(|e| render_error(context, &e)),
        }
    }
}

impl PortValue for Arc<[Face]> {
    const DATA: PortType = PortType::Faces;
}

impl PortValue for Arc<Importance> {
    const DATA: PortType = PortType::Importance;
}

impl PortValue for LineSet {
    const DATA: PortType = PortType::Lines;
}

impl PortValue for Arc<PhotoMap> {
    const DATA: PortType = PortType::Warp;
}

impl PortValue for Posed {
    const DATA: PortType = PortType::Mesh;
}

impl PortValue for Arc<Rig> {
    const DATA: PortType = PortType::Skeleton;
}

/// Lines, and the lens under which they were found.
#[derive(Clone, Debug, Default)]
pub struct LineSet {
    pub(crate) lines: Vec<Line>,
    /// `None` for lines that were marked: they may determine the lens themselves.
    pub(crate) lens: Option<Arc<Found>>,
    /// They were found, not marked: each is two ends, and between them as straight as the lens says.
    pub(crate) found: bool,
    /// Where they were searched.
    pub(crate) searched: Option<Searched>,
}

/// The gray levels of a picture in which lines were searched.
#[derive(Clone, Debug)]
pub(crate) struct Searched {
    photo: Weak<Photo>,
    search: LineSearch,
}

impl Searched {
    pub(crate) fn new(photo: &Arc<Photo>, search: LineSearch) -> Self {
        Self { photo: Arc::downgrade(photo), search }
    }

    /// The search, if it was in this picture.
    pub(crate) fn of(self, photo: &Arc<Photo>) -> Option<LineSearch> {
        (self.photo.as_ptr() == Arc::as_ptr(photo)).then_some(self.search)
    }
}

impl LineSet {
    /// The lines of all sets, and the first lens under which any were found.
    pub(crate) fn all(sets: Vec<Self>) -> Self {
        let mut all = Self { found: true, ..Self::default() };
        for set in sets {
            all.lines.extend(set.lines);
            all.lens = all.lens.or(set.lens);
            all.searched = all.searched.or(set.searched);
            all.found &= set.found;
        }
        all
    }
}

/// A map of a picture, and the report on it.
pub struct PhotoMap {
    pub(crate) warp: PhotoWarp,
    /// Further entries of the report.
    pub(crate) report: serde_json::Map<String, serde_json::Value>,
}

/// A pose whose positions are not numbers: translations, scales or the mesh are beyond the range of double precision.
pub(crate) fn not_finite(error: &MeshError) -> RunError {
    RunError::Input(format!("the mesh in its pose: {error}; scale the mesh and its movement to a size near 1"))
}

/// A mesh between stages: the model as it was read, and beside it the poses that it was given. Files are written from the model,
/// so that polygons, texture coordinates, groups and materials are those that were read.
#[derive(Clone)]
pub struct Posed {
    /// As it was read.
    pub(crate) model: Arc<Model>,
    /// Positions of its vertices, pose by pose; none: as it was read.
    pub(crate) poses: Arc<Vec<Vec<Point3<f64>>>>,
    /// Vertices of handles, and whether each moves.
    pub(crate) handles: Arc<Vec<(u32, bool)>>,
}

impl Posed {
    pub(crate) fn at_rest(model: Model) -> Self {
        Self { model: Arc::new(model), poses: Arc::default(), handles: Arc::default() }
    }

    /// The mesh in its last pose.
    ///
    /// # Errors
    /// [`RunError::Input`] where the pose is not finite.
    pub(crate) fn mesh(&self) -> Result<TriMesh, RunError> {
        let moved = self.model.mesh().with_positions(self.last().to_vec());
        moved.map_err(|e| not_finite(&e))
    }

    /// Positions of the last pose.
    pub(crate) fn last(&self) -> &[Point3<f64>] {
        self.poses.last().map_or_else(|| self.model.mesh().positions(), Vec::as_slice)
    }
}
