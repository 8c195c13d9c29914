//! One interface to all methods of deformation: prefactored for a mesh and a set of handles once, then solved pose by pose.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::arap::{Arap, CellKind};
use super::detail_preserving::LaplacianKind;
use super::laplacian_editing::{LaplacianEditing, Turning};
use super::multiresolution::Multiresolution;
use super::poisson::Poisson;
use super::primo::{Fabric, Primo, PrimoOptions};
use super::{DeformReport, HandlePose, Handles, SurfaceError, Unheld};
use crate::mesh::TriMesh;
use crate::mesh::operators::CotangentRule;
use plumbline_num::energy::Convergence;
use plumbline_num::run::Run;

/// A method of deformation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// As rigid as possible, spokes and rims.
    #[default]
    Arap,
    /// As rigid as possible, spokes only.
    ArapSpokes,
    /// As rigid as possible, triangle by triangle.
    ArapElements,
    /// As rigid as possible, spokes and rims, minimized by Gauss–Newton steps.
    GaussNewton,
    /// Laplacian editing.
    Laplacian,
    /// Poisson editing.
    Poisson,
    /// Rigid prisms with elastic joints.
    Primo,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 7] = [
        Self::Arap,
        Self::ArapSpokes,
        Self::ArapElements,
        Self::GaussNewton,
        Self::Laplacian,
        Self::Poisson,
        Self::Primo,
    ];

    /// The name a user types.
    pub fn name(self) -> &'static str {
        match self {
            Self::Arap => "arap",
            Self::ArapSpokes => "arap-spokes",
            Self::ArapElements => "arap-elements",
            Self::GaussNewton => "gauss-newton",
            Self::Laplacian => "laplacian",
            Self::Poisson => "poisson",
            Self::Primo => "primo",
        }
    }

    /// The method of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|m| m.name() == name)
    }
}

/// How elastic energies are minimized. All reach the same minimum; they differ in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Rotations and positions in turn, steps lengthened by what the last ones taught.
    ///
    /// A quasi-Newton method over the steps of [`Self::LocalGlobal`].
    #[default]
    Accelerated,
    /// Rotations and positions in turn.
    ///
    /// The energy falls at every step, slowly near the end.
    LocalGlobal,
    /// Rotations and positions together: few, dear rounds.
    GaussNewton,
}

/// What a method may be told.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct DeformOptions {
    /// How weights of edges are taken from angles.
    pub cotangents: CotangentRule,
    /// How the energy of arap methods is minimized.
    pub solver: Solver,
    /// ARAP with cells at vertices: how much neighbors turn alike (`α` of Levi & Gotsman), dimensionless, 0 for not at all.
    /// 0.02 keeps the volume of twisted bars. Minimized by local–global steps, whatever the solver.
    #[serde(skip)]
    pub smoothness: f64,
    /// ARAP with cells at vertices: share of the resistance to bending, in (0, 1]. Cells resist it by the square of their
    /// size, so that a finer mesh of the same surface bends more easily; a mesh that stands for one of `n` times as many
    /// vertices has `1/n` of it.
    #[serde(skip)]
    pub bending: f64,
    /// What the method laplacian keeps.
    ///
    /// Whose differential coordinates are kept.
    pub laplacian: LaplacianKind,
    /// Where the method laplacian takes its rotations from.
    pub turning: Turning,
    /// What happens to parts on which no handle is.
    pub unheld: Unheld,
    /// What the shell of [`Method::Primo`] is like.
    #[serde(skip)]
    pub primo: PrimoOptions,
}

impl Default for DeformOptions {
    fn default() -> Self {
        Self {
            cotangents: CotangentRule::default(),
            solver: Solver::default(),
            smoothness: 0.0,
            bending: 1.0,
            laplacian: LaplacianKind::default(),
            turning: Turning::default(),
            unheld: Unheld::default(),
            primo: PrimoOptions::default(),
        }
    }
}

/// Where an iteration starts: all end at the same surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Start<'a> {
    /// What is quickest for the method.
    ///
    /// On large surfaces [`Self::Coarse`] for ARAP without smoothness, [`Self::Spread`] for others.
    #[default]
    Auto,
    /// The solution of coarser copies of the mesh.
    ///
    /// They are made when first asked for. As [`Self::Spread`] for surfaces of few vertices, and for methods that need one solve
    /// only.
    Coarse,
    /// The handles' rotations, spread smoothly.
    ///
    /// Near the solution, whatever the pose.
    Spread,
    /// The mesh as it was read.
    ///
    /// The surface at rest.
    Rest,
    /// Where the last call ended: for drags. The first call starts by itself.
    #[serde(skip)]
    Last,
    /// These positions, one per vertex.
    #[serde(skip)]
    At(&'a [Point3<f64>]),
}

/// A surface that was deformed.
#[derive(Clone, Debug, PartialEq)]
pub struct Deformation {
    /// One position per vertex of the mesh.
    pub positions: Vec<Point3<f64>>,
    /// How it went.
    pub report: DeformReport,
}

/// What a method does once its factorizations are done.
pub(super) trait DeformSolver: Send + std::fmt::Debug {
    /// Which method it is.
    fn method(&self) -> Method;

    /// As [`Deformer::deform`].
    fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError>;
}

/// A method prefactored for a mesh and a set of handles: takes one pose of the handles after the other.
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::surface::{Convergence, DeformOptions, Deformer, HandlePose, Handles, Method, Start};
///
/// let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
/// let handles = Handles::exact([0, bar.vertex_count() as u32 - 1])?;
/// let (options, run) = (DeformOptions::default(), Run::default());
/// let mut deformer = Deformer::new(Method::Arap, &bar, &handles, &options, &run)?;
/// for step in 1..=3 {
///     let mut targets: Vec<_> = handles.vertices().iter().map(|v| bar.positions()[*v as usize]).collect();
///     targets[1].x += 0.2 * f64::from(step);
///     let done = deformer.deform(&HandlePose::new(targets), Start::Last, &Convergence::default(), &run)?;
///     assert_eq!(done.report.constraint_error, 0.0);
/// }
/// # Ok::<(), plumbline_shape::surface::SurfaceError>(())
/// ```
#[derive(Debug)]
pub struct Deformer {
    solver: Box<dyn DeformSolver>,
}

impl Deformer {
    /// Prefactors a method for a mesh and a set of handles: all but the coarser copies of [`Start::Coarse`], which are made
    /// when an initial guess first asks for them.
    ///
    /// # Errors
    /// [`SurfaceError::NoHandle`], [`SurfaceError::NoSuchVertex`], [`SurfaceError::Unheld`], [`SurfaceError::Option`],
    /// [`SurfaceError::Solve`] where a system has no safe factorization, [`SurfaceError::Interrupted`].
    pub fn new(
        method: Method,
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let solver = single_level(method, mesh, handles, options, run)?;
        let solver = if Multiresolution::iterates(method, options) {
            Box::new(Multiresolution::new(method, mesh, handles, options, solver))
        } else {
            solver
        };
        Ok(Self { solver })
    }

    /// PriMo for a shell whose stiffness or thickness differs from place to place; no coarser copies.
    ///
    /// # Errors
    /// As [`Self::new`]; [`SurfaceError::Option`] for a stiffness that is not positive, or a grain that is not finite.
    ///
    /// # Panics
    /// Where a list of the fabric has not one entry per triangle.
    pub fn of_fabric(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        fabric: &Fabric<'_>,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        Ok(Self { solver: Box::new(Primo::of_fabric(mesh, handles, options, fabric, run)?) })
    }

    /// Which method it is.
    pub fn method(&self) -> Method {
        self.solver.method()
    }

    /// Deforms the surface so that its handles take a pose. The result depends on the arguments alone, but for
    /// [`Start::Last`]. Methods that need one solve only have no use for initial guess and criterion.
    ///
    /// # Errors
    /// [`SurfaceError::Pose`], [`SurfaceError::NotFinite`], [`SurfaceError::Convergence`], [`SurfaceError::Interrupted`]. After
    /// an interrupted call the deformer may be used as if that call had never been; [`Start::Last`] then starts by itself.
    pub fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        self.solver.deform(pose, start, convergence, run)
    }
}

/// Deforms a surface once, with the default options: `targets` are where the vertices of `handles` go, in their ascending order.
/// For one pose after the other, or with a progress report, make a [`Deformer`].
///
/// ```
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::surface::{Handles, Method, deform};
///
/// let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
/// let (low, high) = bar.bounding_box().expect("it has vertices");
/// let at_end = |v: &u32| [low.z, high.z].contains(&bar.positions()[*v as usize].z);
/// let handles = Handles::exact((0..bar.vertex_count() as u32).filter(at_end))?;
/// let mut targets: Vec<_> = handles.vertices().iter().map(|v| bar.positions()[*v as usize]).collect();
/// targets.iter_mut().filter(|p| p.z == high.z).for_each(|p| p.x += 1.0); // the upper end to the side
/// let bent = deform(&bar, &handles, &targets, Method::Arap)?;
/// assert_eq!(bent[handles.vertices()[0] as usize], targets[0]);
/// # Ok::<(), plumbline_shape::surface::SurfaceError>(())
/// ```
///
/// # Errors
/// As for [`Deformer::new`] and [`Deformer::deform`].
pub fn deform(
    mesh: &TriMesh,
    handles: &Handles,
    targets: &[Point3<f64>],
    method: Method,
) -> Result<Vec<Point3<f64>>, SurfaceError> {
    let run = Run::default();
    let mut deformer = Deformer::new(method, mesh, handles, &DeformOptions::default(), &run)?;
    let pose = HandlePose::new(targets.to_vec());
    Ok(deformer.deform(&pose, Start::Auto, &Convergence::default(), &run)?.positions)
}

/// The method without coarser copies.
pub(super) fn single_level(
    method: Method,
    mesh: &TriMesh,
    handles: &Handles,
    options: &DeformOptions,
    run: &Run,
) -> Result<Box<dyn DeformSolver>, SurfaceError> {
    let arap = |kind, solver| -> Result<Box<dyn DeformSolver>, SurfaceError> {
        Ok(Box::new(Arap::new(kind, mesh, handles, &DeformOptions { solver, ..*options }, run)?))
    };
    match method {
        Method::Arap => arap(CellKind::SpokesAndRims, options.solver),
        Method::ArapSpokes => arap(CellKind::Spokes, options.solver),
        Method::ArapElements => arap(CellKind::Elements, options.solver),
        Method::GaussNewton => arap(CellKind::SpokesAndRims, Solver::GaussNewton),
        Method::Laplacian => Ok(Box::new(LaplacianEditing::new(mesh, handles, options, run)?)),
        Method::Poisson => Ok(Box::new(Poisson::new(mesh, handles, options, run)?)),
        Method::Primo => Ok(Box::new(Primo::new(mesh, handles, options, run)?)),
    }
}
