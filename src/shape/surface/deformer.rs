//! The common interface of the deformation methods: prefactored for a mesh and a set of handles, then solved pose by pose.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use super::arap::{Arap, CellKind};
use super::detail_preserving::LaplacianKind;
use super::laplacian_editing::{LaplacianEditing, RotationEstimation};
use super::multiresolution::Multiresolution;
use super::poisson::Poisson;
use super::primo::{Primo, PrimoOptions, ShellMaterial};
use super::{DeformReport, HandlePose, Handles, SurfaceError, Unconstrained};
use crate::mesh::TriMesh;
use crate::mesh::operators::CotangentRule;
use plumbline_num::energy::Convergence;
use plumbline_num::run::Run;

/// A method of deformation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// As rigid as possible (ARAP), cells of spokes and rims.
    #[default]
    Arap,
    /// ARAP, cells of spokes.
    ArapSpokes,
    /// ARAP, triangles as cells: no resistance to bending.
    ArapElements,
    /// ARAP, cells of spokes and rims, minimized by Gauss–Newton steps.
    GaussNewton,
    /// Laplacian editing.
    Laplacian,
    /// Poisson editing.
    Poisson,
    /// PriMo: rigid prisms with elastic joints.
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

    /// Its name on the command line.
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

/// Minimizer of the ARAP energies. All reach the same minimum; they differ in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Quasi-Newton (L-BFGS) over local/global steps: fewest seconds.
    ///
    /// Preconditioned by the matrix of the global step, hence as many back-substitutions as [`Self::LocalGlobal`].
    #[default]
    Accelerated,
    /// Alternates rotations and positions: the classical method.
    ///
    /// The energy decreases in every iteration, but convergence is slow near the minimum.
    LocalGlobal,
    /// Rotations and positions together: fewer, more expensive iterations.
    GaussNewton,
}

/// Options of the deformation methods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default)]
pub struct DeformOptions {
    /// Cotangent weights of edges; change it where obtuse triangles give negative weights.
    pub cotangents: CotangentRule,
    /// Minimizer of the arap methods; all reach the same minimum in different time.
    pub solver: Solver,
    /// Rotation smoothness of ARAP with vertex cells (`α` of Levi & Gotsman), dimensionless, ≥ 0; 0 disables it. 0.02 keeps the
    /// volume of twisted bars. Minimized by local/global iterations, whatever the solver.
    #[serde(skip)]
    pub smoothness: f64,
    /// Fraction of the bending resistance of ARAP with vertex cells, in (0, 1]. It grows with the square of the cell size, so that
    /// a coarse copy with `1/n` of the vertices needs `1/n` to be as flexible as the original.
    #[serde(skip)]
    pub bending: f64,
    /// Laplacian whose differential coordinates the method laplacian preserves.
    pub laplacian: LaplacianKind,
    /// Rotation estimation of the method laplacian.
    pub rotation_estimation: RotationEstimation,
    /// Connected components without a handle: keep fixed, or reject the mesh.
    pub unconstrained: Unconstrained,
    /// Options of [`Method::Primo`].
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
            rotation_estimation: RotationEstimation::default(),
            unconstrained: Unconstrained::default(),
            primo: PrimoOptions::default(),
        }
    }
}

/// Initial guess of an iterative method. The minimum does not depend on it, except for energies with several minima.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum InitialGuess<'a> {
    /// The fastest choice for the method.
    ///
    /// [`Self::Coarse`] for ARAP without rotation smoothness, [`Self::Spread`] for other methods.
    #[default]
    Auto,
    /// The prolonged solution of coarser levels of the mesh.
    ///
    /// The levels are built at first use. Where handles rotate by more than 45 degrees against one another, several minima are followed
    /// and the lowest is taken. Otherwise the same as [`Self::Spread`] for small meshes, and always for methods with a single solve.
    Coarse,
    /// Handle rotations interpolated harmonically, then one global step.
    Spread,
    /// The rest shape.
    Rest,
    /// The result of the previous call, for interactive dragging; [`Self::Auto`] in the first call.
    #[serde(skip)]
    Last,
    /// Given positions, one per vertex.
    #[serde(skip)]
    At(&'a [Point3<f64>]),
}

/// A deformed surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Deformation {
    /// One position per vertex of the mesh.
    pub positions: Vec<Point3<f64>>,
    /// Convergence and distortion.
    pub report: DeformReport,
}

/// One call of a solver: the arguments of [`Deformer::deform`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Request<'a> {
    pub(super) pose: &'a HandlePose,
    pub(super) guess: InitialGuess<'a>,
    pub(super) convergence: &'a Convergence,
    pub(super) run: &'a Run,
    /// Whether the report has the distortion, and the energy without cancellation.
    pub(super) measured: bool,
}

/// The prefactored solver of a method.
pub(super) trait DeformSolver: Send + std::fmt::Debug {
    /// The method.
    fn method(&self) -> Method;

    /// Solves; the convergence criterion is in its range.
    fn solve(&mut self, request: &Request<'_>) -> Result<Deformation, SurfaceError>;

    /// Called where initial guesses will be given: a factor that then is only a preconditioner may be kept in single precision. It costs no
    /// digit of a result; initial guesses of the method's own are then off by
    /// some 10⁻⁷ of the diagonal, more on large surfaces.
    fn round(&mut self) {}

    /// Largest rotation of a handle against another of its component, in radians; 0 for methods that do not estimate it.
    fn largest_rotation(&self, _pose: &HandlePose) -> Result<f64, SurfaceError> {
        Ok(0.0)
    }

    /// The pose at a fraction of the way from rest, along screw motions.
    fn partway(&self, pose: &HandlePose, _fraction: f64) -> Result<HandlePose, SurfaceError> {
        Ok(pose.clone())
    }

    /// As [`Deformer::deform`].
    fn deform(
        &mut self,
        pose: &HandlePose,
        guess: InitialGuess<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        self.solve(&Request { pose, guess, convergence, run, measured: true })
    }
}

/// A method prefactored for a mesh and a set of handles, for any number of poses.
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_shape::mesh::shapes;
/// use plumbline_shape::surface::{Convergence, DeformOptions, Deformer, HandlePose, Handles, Method, InitialGuess};
///
/// let bar = shapes::bar([2, 2, 10], [1.0, 1.0, 5.0]);
/// let handles = Handles::exact([0, bar.vertex_count() as u32 - 1])?;
/// let (options, run) = (DeformOptions::default(), Run::default());
/// let mut deformer = Deformer::new(Method::Arap, &bar, &handles, &options, &run)?;
/// for step in 1..=3 {
///     let mut targets: Vec<_> = handles.vertices().iter().map(|v| bar.positions()[*v as usize]).collect();
///     targets[1].x += 0.2 * f64::from(step);
///     let done = deformer.deform(&HandlePose::new(targets), InitialGuess::Last, &Convergence::default(), &run)?;
///     assert_eq!(done.report.constraint_error, 0.0);
/// }
/// # Ok::<(), plumbline_shape::surface::SurfaceError>(())
/// ```
#[derive(Debug)]
pub struct Deformer {
    solver: Box<dyn DeformSolver>,
}

impl Deformer {
    /// Prefactors a method for a mesh and a set of handles. The coarse levels of [`InitialGuess::Coarse`] are built at first use.
    ///
    /// # Errors
    /// [`SurfaceError::NoHandle`], [`SurfaceError::NoSuchVertex`], [`SurfaceError::Unconstrained`], [`SurfaceError::Option`],
    /// [`SurfaceError::IllConditioned`] where a system has no safe factorization, [`SurfaceError::TooDense`] or [`SurfaceError::Solve`] where
    /// that is out of proportion to the surface, [`SurfaceError::Interrupted`].
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

    /// PriMo for a shell with a given material, without coarse levels.
    ///
    /// # Errors
    /// As [`Self::new`]; [`SurfaceError::Option`] for a stiffness that is not positive, or a direction that is not finite.
    ///
    /// # Panics
    /// If a list of the material does not have one entry per triangle.
    pub fn with_material(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        material: &ShellMaterial<'_>,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        Ok(Self { solver: Box::new(Primo::new(mesh, handles, options, material, run)?) })
    }

    /// The method.
    pub fn method(&self) -> Method {
        self.solver.method()
    }

    /// Solves for a pose of the handles. The result depends on the arguments alone, except with [`InitialGuess::Last`]. Methods
    /// with a single solve ignore `guess` and `convergence`.
    ///
    /// # Errors
    /// [`SurfaceError::Pose`], [`SurfaceError::NotFinite`], [`SurfaceError::Convergence`], [`SurfaceError::Diverged`],
    /// [`SurfaceError::Interrupted`]. After an interrupted call the deformer remains usable; [`InitialGuess::Last`] is then [`InitialGuess::Auto`].
    pub fn deform(
        &mut self,
        pose: &HandlePose,
        guess: InitialGuess<'_>,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        finite(self.solver.deform(pose, guess, convergence, run)?)
    }

    /// A few iterations from the result of the last call: for a hand that drags. As [`Self::deform`] with [`InitialGuess::Last`], but
    /// for ARAP with [`Solver::Accelerated`] or [`Solver::GaussNewton`] the report has no distortion (all zero), and its energies are
    /// rounded to 10⁻¹² of the elastic scale of the mesh: measuring takes as long as an iteration. Calls in a row go on with what the
    /// solver learnt of the energy, and a run that ends after an iteration gives the surface so far.
    ///
    /// # Errors
    /// As [`Self::deform`].
    pub fn follow(
        &mut self,
        pose: &HandlePose,
        convergence: &Convergence,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        finite(self.solver.solve(&Request { pose, guess: InitialGuess::Last, convergence, run, measured: false })?)
    }
}

/// A result whose positions are all finite.
fn finite(found: Deformation) -> Result<Deformation, SurfaceError> {
    match found.positions.iter().position(|p| !p.coords.iter().all(|c| c.is_finite())) {
        None => Ok(found),
        Some(vertex) => Err(SurfaceError::Diverged { vertex }),
    }
}

/// Deforms a surface once, with the default options; `targets` are the positions of the handles, in ascending order of their
/// vertices. For several poses, other options or progress reports make a [`Deformer`].
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
/// targets.iter_mut().filter(|p| p.z == high.z).for_each(|p| p.x += 1.0); // shift the upper end
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
    Ok(deformer.deform(&pose, InitialGuess::Auto, &Convergence::default(), &run)?.positions)
}

/// The method without coarse levels.
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
        Method::Primo => Ok(Box::new(Primo::new(mesh, handles, options, &ShellMaterial::default(), run)?)),
    }
}
