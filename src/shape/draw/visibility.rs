//! A z-buffer with depth peeling: the nearest triangle of each sample.
//!
//! The picture is divided into bands of rows, each drawn by one thread in the order of the triangles (`raster.rs`); of equal depths the
//! first is kept. The layer behind a given one is found by drawing again only what is farther.

use nalgebra::Point3;
use rayon::prelude::*;

use super::SurfaceCamera;
use super::raster::{Screen, Target};
use crate::mesh::TriMesh;
use plumbline_num::math::Lists;
use plumbline_num::run::{Run, Stopped};

/// Index of samples without a triangle.
pub(super) const NO_TRIANGLE: u32 = u32::MAX;
/// Rows of samples in a band: small enough to balance threads, large enough that few triangles are in several bands.
const BAND: usize = 48;

/// All triangles projected to the screen.
pub(super) struct View {
    /// Vertices in camera coordinates.
    pub(super) vertices: Vec<Point3<f64>>,
    screen: Vec<Screen>,
    bands: Lists<u32>,
    samples: usize,
    columns: usize,
    rows: usize,
}

/// The nearest triangle of each sample, perhaps behind another layer.
pub(super) struct VisibleLayer {
    /// Samples per pixel and axis.
    pub(super) samples: usize,
    /// Samples per row.
    columns: usize,
    /// The triangle of each sample, or [`NO_TRIANGLE`].
    triangle: Vec<u32>,
    /// `1/z` of each sample, 0 without a triangle.
    inverse_depth: Vec<f32>,
}

impl View {
    pub(super) fn new(mesh: &TriMesh, camera: &SurfaceCamera, samples: usize) -> Self {
        let vertices: Vec<Point3<f64>> = mesh.positions().par_iter().map(|p| camera.pose.apply(p)).collect();
        let (columns, rows) = (camera.size.0 * samples, camera.size.1 * samples);
        let screen: Vec<Screen> = mesh
            .triangles()
            .par_iter()
            .enumerate()
            .flat_map_iter(|(t, corners)| {
                let corners = corners.map(|v| vertices[v as usize]);
                Screen::of(t as u32, &corners, camera, samples as f64)
            })
            .collect();
        Self { vertices, bands: bands(&screen, rows), screen, samples, columns, rows }
    }

    /// The nearest layer.
    pub(super) fn nearest(&self, run: &Run) -> Result<VisibleLayer, Stopped> {
        self.peeled(None, run)
    }

    /// The nearest layer behind a given one (C. Everitt, *Interactive order-independent transparency*, 2001).
    pub(super) fn behind(&self, layer: &VisibleLayer, run: &Run) -> Result<VisibleLayer, Stopped> {
        self.peeled(Some(layer), run)
    }

    fn peeled(&self, layer: Option<&VisibleLayer>, run: &Run) -> Result<VisibleLayer, Stopped> {
        let mut triangle = vec![NO_TRIANGLE; self.columns * self.rows];
        let mut inverse_depth = vec![0.0_f32; self.columns * self.rows];
        let size = self.columns * BAND;
        let targets = triangle.par_chunks_mut(size).zip(inverse_depth.par_chunks_mut(size));
        targets.enumerate().try_for_each(|(band, (triangle, inverse_depth))| {
            run.check()?;
            let before = layer.map(|l| &l.inverse_depth[band * size..][..inverse_depth.len()]);
            let mut target = Target::new(band * BAND, self.columns, triangle, inverse_depth, before);
            self.bands.of(band).iter().try_for_each(|i| {
                run.check()?;
                self.screen[*i as usize].draw(&mut target);
                Ok(())
            })
        })?;
        Ok(VisibleLayer { samples: self.samples, columns: self.columns, triangle, inverse_depth })
    }
}

impl VisibleLayer {
    /// True where no sample has a triangle.
    pub(super) fn is_empty(&self) -> bool {
        self.triangle.iter().all(|t| *t == NO_TRIANGLE)
    }

    /// The triangle of sample (`column`, `line`) of pixel (`x`, `y`).
    #[inline]
    pub(super) fn triangle(&self, x: usize, y: usize, column: usize, line: usize) -> u32 {
        self.triangle[self.index(x, y, column, line)]
    }

    /// `1/z` of that sample.
    #[inline]
    pub(super) fn inverse_depth(&self, x: usize, y: usize, column: usize, line: usize) -> f32 {
        self.inverse_depth[self.index(x, y, column, line)]
    }

    /// Mean `1/z` of the samples of a pixel with a triangle; 0 without any.
    pub(super) fn mean_inverse_depth(&self, x: usize, y: usize) -> f32 {
        let n = self.samples;
        let hits = (0..n * n).map(|i| self.inverse_depth(x, y, i % n, i / n)).filter(|near| *near > 0.0);
        let (sum, count) = hits.fold((0.0, 0.0), |(sum, count), near| (sum + near, count + 1.0));
        if count > 0.0 { sum / count } else { 0.0 }
    }

    #[inline]
    fn index(&self, x: usize, y: usize, column: usize, line: usize) -> usize {
        (y * self.samples + line) * self.columns + x * self.samples + column
    }
}

/// Indices of the triangles that overlap each band.
fn bands(screen: &[Screen], rows: usize) -> Lists<u32> {
    let last = i64::try_from(rows).unwrap_or(i64::MAX) - 1;
    let touched = |s: &Screen| {
        let (top, bottom) = s.rows();
        let (top, bottom) = (top.max(0), bottom.min(last));
        if top > bottom { 0..0 } else { (top as usize / BAND) as u32..(bottom as usize / BAND + 1) as u32 }
    };
    let pairs = (0..).zip(screen).flat_map(|(i, s)| touched(s).map(move |band| (band, i)));
    Lists::new(rows.div_ceil(BAND), pairs)
}
