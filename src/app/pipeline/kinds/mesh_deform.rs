//! `mesh.deform`: moves a few vertices and lets the rest follow.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::surfaces::MethodName;
use plumbline_shape::mesh::operators::CotangentRule;
use plumbline_shape::surface::{Convergence, LaplacianKind, Solver, Start, Turning, Unheld};

/// How the weights of edges are taken from the angles of triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum CotangentWish {
    /// As they are; obtuse triangles may give negative ones
    #[default]
    Raw,
    /// None below 0
    Clamped,
    /// Those of the intrinsic Delaunay triangulation of the same surface
    Delaunay,
}

impl CotangentWish {
    /// The rule of the operators.
    pub fn rule(self) -> CotangentRule {
        match self {
            Self::Raw => CotangentRule::Raw,
            Self::Clamped => CotangentRule::Clamped,
            Self::Delaunay => CotangentRule::IntrinsicDelaunay,
        }
    }
}

/// What happens to parts of the mesh on which no handle is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum UnheldWish {
    /// They stay where they are, and the summary names them
    #[default]
    Still,
    /// The mesh is refused
    Refused,
}

impl UnheldWish {
    /// The option of the methods.
    pub fn option(self) -> Unheld {
        match self {
            Self::Still => Unheld::Still,
            Self::Refused => Unheld::Refused,
        }
    }
}

/// How elastic energies are minimized: all reach the same minimum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum SolverWish {
    /// Rotations and positions in turn, steps lengthened by what the last ones taught
    #[default]
    Accelerated,
    /// Rotations and positions in turn
    LocalGlobal,
    /// Rotations and positions together: few, dear rounds
    GaussNewton,
}

impl SolverWish {
    /// The option of the methods.
    pub fn option(self) -> Solver {
        match self {
            Self::Accelerated => Solver::Accelerated,
            Self::LocalGlobal => Solver::LocalGlobal,
            Self::GaussNewton => Solver::GaussNewton,
        }
    }
}

/// Where rounds start: all end at the same surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum StartWish {
    /// What is quickest for the method
    #[default]
    Auto,
    /// The solution of coarser copies of the mesh
    Coarse,
    /// The handles' rotations, spread smoothly
    Spread,
    /// The mesh as it was read
    Rest,
}

impl StartWish {
    /// The start of the methods.
    pub fn option(self) -> Start<'static> {
        match self {
            Self::Auto => Start::Auto,
            Self::Coarse => Start::Coarse,
            Self::Spread => Start::Spread,
            Self::Rest => Start::Rest,
        }
    }
}

/// What Laplacian editing keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LaplacianWish {
    /// How far vertices stand off the surface around them
    #[default]
    Cotangent,
    /// How far vertices are from the mean of their neighbors
    Uniform,
}

impl LaplacianWish {
    /// The option of the methods.
    pub fn option(self) -> LaplacianKind {
        match self {
            Self::Cotangent => LaplacianKind::Cotangent,
            Self::Uniform => LaplacianKind::Uniform,
        }
    }
}

/// Where Laplacian editing takes its rotations from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum TurningWish {
    /// The handles', spread smoothly
    #[default]
    Spread,
    /// Fitted to a first solve
    FirstSolve,
    /// Fitted again and again
    Alternating,
    /// Linear in the positions: one solve, for small turns
    Linear,
}

impl TurningWish {
    /// The option of the methods.
    pub fn option(self) -> Turning {
        match self {
            Self::Spread => Turning::Spread,
            Self::FirstSolve => Turning::FirstSolve,
            Self::Alternating => Turning::Alternating,
            Self::Linear => Turning::Linear,
        }
    }
}

/// Settings of `mesh.deform`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeshDeformSettings {
    /// What is held and moved: a file of handles (JSON; `plumbline schema handles` describes it)
    #[schemars(extend("format" = "path"))]
    pub handles: String,
    /// How the rest follows
    pub method: MethodName,
    /// Weights of edges
    pub cotangents: CotangentWish,
    /// How the energy of arap methods is minimized
    pub solver: SolverWish,
    /// Where rounds start; a pose after the first one starts from the one before
    pub start: StartWish,
    /// What the method laplacian keeps
    pub laplacian: LaplacianWish,
    /// Where the method laplacian takes its rotations from
    pub turning: TurningWish,
    /// The surface moves up to this far from handles that move, along edges, in units of the mesh; all of it if left out
    #[schemars(range(min = 0.0))]
    pub roi: Option<f64>,
    /// Rounds at most
    #[schemars(range(min = 1, max = 1_000_000))]
    pub iterations: u32,
    /// It has converged when a round lowers the energy by no more than this share of it
    #[schemars(range(min = 0.0, max = 0.5))]
    pub tolerance: f64,
    /// Poses between the first key of the handles and the last; 1: the last alone
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Parts without a handle
    pub unheld: UnheldWish,
    /// Also write how it went, as JSON
    #[schemars(extend("format" = "path"))]
    pub report: Option<String>,
}

/// When a deformation is done. A bar that is twisted by 135 degrees rests on a symmetric saddle first, where rounds gain less
/// than 10⁻⁶ of the energy and end 3.5 % above the minimum; 10⁻⁸ costs half as many rounds again.
const DONE: Convergence = Convergence { max_iterations: 1000, tolerance: 1e-8 };

impl Default for MeshDeformSettings {
    fn default() -> Self {
        Self {
            handles: String::new(),
            method: MethodName::default(),
            cotangents: CotangentWish::default(),
            solver: SolverWish::default(),
            start: StartWish::default(),
            laplacian: LaplacianWish::default(),
            turning: TurningWish::default(),
            roi: None,
            iterations: DONE.max_iterations as u32,
            tolerance: DONE.tolerance,
            frames: 1,
            unheld: UnheldWish::default(),
            report: None,
        }
    }
}

impl StageSettings for MeshDeformSettings {
    const KIND: &'static str = "mesh.deform";
    const SUMMARY: &'static str = "holds and moves a few vertices; the rest of the surface follows and keeps its shape";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh at rest")];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh in its poses")];
    const REQUIRED: &'static [&'static str] = &["handles"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.handles]
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }
}
