//! PriMo: a surface as rigid prisms with elastic joints, which shells bend like.
//!
//! Every triangle is raised by `±h/2` along the normals of its vertices to a prism; neighbors meet on a face in the rest
//! shape, and are held together there:
//!
//! ```text
//! E(T) = Σ_{i~j} w_ij ∫_{face} ‖T_i(f) − T_j(f)‖² df,     w_ij = ‖e_ij‖² / (A_i + A_j),     T_i ∈ SE(3),
//! ```
//!
//! over the unit square of the bilinear face. `h` is what bending costs: with `h → 0` only stretch and shear do. A vertex is
//! the mean of the copies that the prisms around it carry.
//!
//! Prisms whose corners are all held exactly are fixed. Other held vertices are tied to their targets by springs, stiff ones
//! where the hold is exact (the vertex itself is then put onto its target).
//!
//! The energy is minimized over rigid motions of *clusters* of prisms, from some sixty down to the single prisms: on each level
//! by Gauss–Newton in velocities (`global`) and local shape matching (`sweep`). Clusters move what is posed already, so a
//! finer level starts exactly where the coarser one ended and the energy never rises. (The paper simplifies the mesh
//! instead, and restricts to one level with either solver.)
//!
//! # Reference
//! M. Botsch, M. Pauly, M. Gross, L. Kobbelt, *PriMo: coupled prisms for intuitive surface modeling*, SGP 2006.

mod clusters;
mod global;
mod prisms;
mod shell;
mod solver;
mod sweep;

/// Weight of the springs of a vertex that is held exactly, edges having about 1: a prism is off by a thousandth of what its
/// neighbors pull. Stiffer springs slow local shape matching down.
const STIFF_SPRING: f64 = 1e3;

/// How the shell is made.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimoOptions {
    /// `h` as a multiple of the mean length of the edges, ≥ 0. Thin shells crease, thick ones bend in wide arcs.
    pub thickness: f64,
    /// A factor on the joints of each triangle, > 0; all 1 where not given.
    pub stiffness: Option<Vec<f64>>,
    /// Most clusters that are solved for at once; beyond, levels above it and local shape matching take turns. A system of
    /// 20 000 takes about a second to factor and 200 MB.
    pub largest_system: usize,
}

impl Default for PrimoOptions {
    fn default() -> Self {
        Self { thickness: 1.0, stiffness: None, largest_system: 30_000 }
    }
}

#[cfg(test)]
mod tests;
