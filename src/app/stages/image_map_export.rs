//! `image.map_export`: writes the map of a still picture.
//!
//! `PREFIX_x.npy` and `PREFIX_y.npy` contain, for the pixel at column `i`, row `j` of the output, the column and row of the source that
//! its center comes from, pixel centers at integers as OpenCV has them: `src_from_out(i + ½, j + ½) − ½`, NaN where the map is not
//! defined. `PREFIX_mesh.npy` contains the grid's vertices in the output in the same convention, `(rows, columns, 2)`. `PREFIX.exr` is
//! for compositors: `R = x/W`, `G = 1 − y/H` of the source, both −1 where the map is not defined.
//!
//! Positions are those of the field itself, not of the lattice that it is rendered through.

use std::path::PathBuf;
use std::sync::Arc;

use rayon::prelude::*;

use super::numpy::write_npy;
use super::prelude::*;
use super::values::PhotoMap;
use crate::pipeline::paths::to_path;
use plumbline_image::grid::GridMesh;
use plumbline_image::still::Photo;
use plumbline_image::write_exr;
use plumbline_num::math::{Point2, PointMap};
use plumbline_photo::PhotoWarp;

/// Settings of `image.map_export`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MapExportSettings {
    /// Beginning of the files' names: PREFIX_x.npy, PREFIX_y.npy, PREFIX_mesh.npy and PREFIX.exr
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Also write the map for compositors, as 32-bit EXR: R = x/W, G = 1 - y/H
    pub exr: bool,
}

impl Default for MapExportSettings {
    fn default() -> Self {
        Self { path: String::new(), exr: true }
    }
}

impl MapExportSettings {
    /// The file whose name ends so.
    fn file(&self, end: &str) -> PathBuf {
        to_path(&format!("{}{end}", self.path))
    }
}

impl Stage for MapExportSettings {
    const KIND: &'static str = "image.map_export";
    const SUMMARY: &'static str =
        "writes where each pixel comes from, and the grid: NumPy arrays, and EXR for compositors";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture that the map is of, before it is sampled"),
        Port::one("warp", PortType::Warp, "the map"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Arc<Photo>, Arc<PhotoMap>);
    type Output = (Written,);

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "the map at every pixel", bytes_per_px: 24.0, ..MemoryCost::default() }]
    }

    fn writes(&self) -> Vec<String> {
        let ends = ["_x.npy", "_y.npy", "_mesh.npy"].into_iter().chain(self.exr.then_some(".exr"));
        ends.map(|end| format!("{}{end}", self.path)).collect()
    }

    fn run(&self, (photo, map): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let (width, height) = map.warp.size;
        let [x, y] = positions(&map.warp);
        let mesh = &map.warp.mesh;
        let (pixels, grid) = (vec![height, width], vec![mesh.rows + 1, mesh.cols + 1, 2]);
        let arrays = [("_x.npy", &pixels, &x), ("_y.npy", &pixels, &y), ("_mesh.npy", &grid, &vertices(mesh))];
        for (end, shape, values) in arrays {
            context.fill_file(&self.file(end), |out| write_npy(out, shape, values))?;
        }
        if !self.exr {
            return Ok((Written,));
        }
        let normalized = |values: Vec<f32>, of: usize, up: bool| -> Vec<f32> {
            let one = |v: f32| {
                let part = (f64::from(v) + 0.5) / of as f64;
                if v.is_nan() { -1.0 } else { (if up { 1.0 - part } else { part }) as f32 }
            };
            values.into_par_iter().map(one).collect()
        };
        let source = (photo.frame.width, photo.frame.height);
        drop(photo);
        let channels = [("R", normalized(x, source.0, false)), ("G", normalized(y, source.1, true))];
        context.fill_file(&self.file(".exr"), |out| write_exr((width, height), channels, out))?;
        Ok((Written,))
    }
}

/// Source column and row of every pixel of the output.
fn positions(warp: &PhotoWarp) -> [Vec<f32>; 2] {
    let (width, height) = warp.size;
    let (mut x, mut y) = (vec![f32::NAN; width * height], vec![f32::NAN; width * height]);
    x.par_chunks_mut(width).zip(y.par_chunks_mut(width)).enumerate().for_each(|(j, (xs, ys))| {
        for (i, (x, y)) in xs.iter_mut().zip(ys).enumerate() {
            if let Some(p) = warp.field.map(Point2::new(i as f64 + 0.5, j as f64 + 0.5)) {
                (*x, *y) = ((p.x - 0.5) as f32, (p.y - 0.5) as f32);
            }
        }
    });
    [x, y]
}

fn vertices(mesh: &GridMesh) -> Vec<f32> {
    mesh.vertices.iter().flat_map(|v| [(v.x - 0.5) as f32, (v.y - 0.5) as f32]).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2x3;

    use super::*;
    use plumbline_image::grid::Grid;
    use plumbline_image::warp::{Map, WarpField};

    #[test]
    fn one_pixel_of_the_source_is_found_at_its_own_column_and_row() {
        // The output shows the source from column 7, row 2 on, at half the density.
        let field = WarpField::identity().then(Map::Affine(Matrix2x3::new(2.0, 0.0, 7.0, 0.0, 2.0, 2.0)));
        let mesh = Grid { cols: 2, rows: 1, width: 20.0, height: 10.0 }.to_mesh();
        let forward = Box::new(|p: Point2| Some(p));
        let warp = PhotoWarp::new(field, (20, 10), mesh, forward);
        let [x, y] = positions(&warp);
        assert_eq!((x[0], y[0]), (7.5, 2.5), "the first pixel covers columns 7 and 8, rows 2 and 3");
        assert_eq!((x[3 * 20 + 4], y[3 * 20 + 4]), (15.5, 8.5));
        assert_eq!(vertices(&warp.mesh)[..4], [-0.5, -0.5, 9.5, -0.5]);
    }
}
