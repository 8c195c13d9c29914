//! Two meshes as two poses of one.

use std::sync::Arc;

use nalgebra::Point3;
use serde_json::{Value as Json, json};

use super::{of_file, report_line};
use crate::pipeline::paths::to_path;
use crate::pipeline::run_error::RunError;
use crate::stages::context::Context;
use crate::stages::values::{Posed, not_finite};
use plumbline_shape::mesh::{Model, TriMesh};
use plumbline_shape::morph::correspondence::{
    CorrespondenceMethod, Landmarks, MapQuality, correspond, measure, refine,
};
use plumbline_shape::morph::{MorphError, same_connectivity};
use plumbline_shape::surface::SolvableMesh;

/// Refinements at most; each halves edges, so that six leave 1/64 of them.
const MAX_REFINEMENTS: usize = 6;

/// Two poses of one mesh without faults, and the model whose vertices follow them.
pub(crate) struct Pair {
    /// What is written: the first mesh as it was read, or as it was refined.
    pub(crate) model: Arc<Model>,
    pub(crate) first: TriMesh,
    pub(crate) second: TriMesh,
    solvable: SolvableMesh,
    /// The model has the vertices of the meshes, not those of the file.
    refined: bool,
    /// Both ends by the vertices of the file.
    ends: Option<[Vec<Point3<f64>>; 2]>,
    /// Method and quality of the map of one to the other, where landmarks were needed.
    pub(crate) quality: Option<(CorrespondenceMethod, MapQuality)>,
}

impl Pair {
    /// Both meshes, the first laid over the second where there are landmarks.
    pub(crate) fn new(
        context: &mut Context<'_, '_>,
        [first, second]: [Posed; 2],
        landmarks: Option<&String>,
        over: CorrespondenceMethod,
        tolerance: Option<f64>,
    ) -> Result<Self, RunError> {
        let [a, b] = [first.mesh()?, second.mesh()?];
        for (which, mesh) in [("first", &a), ("second", &b)] {
            let area = mesh.area();
            if !area.is_finite() {
                return Err(MorphError::Size { which, diagonal: mesh.diagonal() }.into());
            }
            if area <= 0.0 {
                return Err(MorphError::Empty { which }.into());
            }
        }
        let solvable = SolvableMesh::new(&a, &context.job.run())?;
        if let Some(surface) = &mut context.summary.surface {
            surface.repairs = solvable.report.changes().collect();
        }
        match landmarks {
            None if first.model.has_faces_of(&second.model) => {
                // How polygons are cut into triangles depends on the pose: both are cut as the first one.
                let b = a.with_positions(b.positions().to_vec()).map_err(|e| not_finite(&e))?;
                Self::same(first.model, &a, &b, solvable)
            }
            None => Self::same(first.model, &a, &b, solvable),
            Some(path) => {
                let pairs = Landmarks::read(&to_path(path)).and_then(|l| l.vertices(&a, &b)).map_err(of_file(path))?;
                Self::laid(context, first.model, &b, solvable, &pairs, (over, tolerance))
            }
        }
    }

    fn same(model: Arc<Model>, a: &TriMesh, b: &TriMesh, solvable: SolvableMesh) -> Result<Self, RunError> {
        same_connectivity(a, b)?;
        let there = solvable.source_of_vertex.iter().map(|v| b.positions()[*v as usize]).collect();
        let second = solvable.mesh.with_positions(there).map_err(|e| not_finite(&e))?;
        let ends = Some([a.positions().to_vec(), b.positions().to_vec()]);
        Ok(Self { model, first: solvable.mesh.clone(), second, solvable, refined: false, ends, quality: None })
    }

    fn laid(
        context: &mut Context<'_, '_>,
        model: Arc<Model>,
        b: &TriMesh,
        solvable: SolvableMesh,
        pairs: &[(u32, u32)],
        (over, tolerance): (CorrespondenceMethod, Option<f64>),
    ) -> Result<Self, RunError> {
        let mut pairs: Vec<(u32, u32)> =
            pairs.iter().filter_map(|&(v, w)| Some((solvable.vertex_of_source[v as usize]?, w))).collect();
        // Vertices that repair joined are one landmark.
        let mut seen = std::collections::BTreeSet::new();
        pairs.retain(|p| seen.insert(p.0));
        let laid = correspond(&solvable.mesh, b, &pairs, &over.into(), &context.job.run())?;
        let (mut first, mut second, mut quality) = (solvable.mesh.clone(), laid.mapped, laid.quality);
        context.job.check_cancel()?;
        if let Some(tolerance) = tolerance {
            let refined = refine(&first, &second, b, tolerance, MAX_REFINEMENTS, &context.job.run())?;
            report_line(context, format!("{} vertices added where features would be lost", refined.added));
            (first, second) = (refined.first, refined.mapped);
            quality = measure(&first, &second, b, &pairs, &context.job.run())?;
        }
        report_line(context, quality_line(&quality, laid.method, pairs.len()));
        if let Some(fault) = faults(&quality, laid.method) {
            context.warn(fault);
        }
        let refined = tolerance.is_some();
        let model = if refined { Arc::new(Model::of_mesh(first.clone())) } else { model };
        Ok(Self { model, first, second, solvable, refined, ends: None, quality: Some((laid.method, quality)) })
    }

    /// Shapes by the vertices that are written.
    pub(crate) fn posed(&self, poses: Vec<Vec<Point3<f64>>>) -> Posed {
        Posed { model: Arc::clone(&self.model), poses: Arc::new(poses), handles: Arc::default() }
    }

    /// Positions of the vertices that are written.
    pub(crate) fn written(&self, time: Option<f64>, moved: &[Point3<f64>]) -> Vec<Point3<f64>> {
        match (time, &self.ends) {
            (Some(0.0), Some([first, _])) => first.clone(),
            (Some(1.0), Some([_, second])) => second.clone(),
            _ if self.refined => moved.to_vec(),
            _ => self.solvable.carry_back(self.model.mesh().positions(), moved),
        }
    }

    /// Values of the vertices that are written, for those of the mesh.
    pub(crate) fn gathered(&self, of_file: &[Option<f64>]) -> Vec<Option<f64>> {
        self.solvable.source_of_vertex.iter().map(|v| of_file[*v as usize]).collect()
    }
}

fn quality_line(quality: &MapQuality, method: CorrespondenceMethod, landmarks: usize) -> String {
    let method = name_of(method);
    format!(
        "laid over the other by {landmarks} landmarks ({method}): stretch {:.2}, landmarks missed by {:.2} % at most, features by {:.2} %",
        quality.stretch,
        100.0 * quality.landmark_error,
        100.0 * quality.missed_worst
    )
}

/// A warning of the checks that the map fails.
fn faults(quality: &MapQuality, method: CorrespondenceMethod) -> Option<String> {
    let failed: Vec<String> = quality.failed_checks().iter().map(ToString::to_string).collect();
    let remedy = match method {
        CorrespondenceMethod::Registration => "more landmarks may help",
        _ => "more landmarks, or more triangles of the first mesh, may help",
    };
    (!failed.is_empty()).then(|| format!("the first mesh covers the second badly: {}; {remedy}", failed.join(", ")))
}

/// The name of a method in summaries.
fn name_of(method: CorrespondenceMethod) -> &'static str {
    match method {
        CorrespondenceMethod::Auto => "auto",
        CorrespondenceMethod::Registration => "registration",
        CorrespondenceMethod::Sphere => "over the sphere",
        CorrespondenceMethod::Disk => "over the disk",
    }
}

/// The method and quality of a map as JSON.
pub(crate) fn quality_json((method, quality): &(CorrespondenceMethod, MapQuality)) -> Json {
    json!({
        "method": method,
        "flipped": quality.flipped,
        "collapsed": quality.collapsed,
        "stretch": quality.stretch,
        "stretch_95": quality.stretch_95,
        "landmark_error": quality.landmark_error,
        "missed_rms": quality.missed_rms,
        "missed_worst": quality.missed_worst,
    })
}
