//! Elimination orders.

use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::{amd, colamd};

use super::cuthill_mckee::reverse_cuthill_mckee;
use super::dissection::nested_dissection;
use super::{FactorStructure, GeneralMatrix, Pattern, SparseError};

/// Multiplications per `n^1.5` above which a geometric order has missed what a surface allows: a squared Laplacian takes less.
const MULTIPLICATIONS_PER_GROWTH: f64 = 4000.0;

/// How unknowns are renumbered before elimination; it decides fill and speed, never the solution.
#[derive(Clone, Debug, Default)]
pub enum Ordering {
    /// As they are numbered: for chains and other banded systems.
    Natural,
    /// Approximate minimum degree: good without knowing anything of the unknowns.
    #[default]
    Amd,
    /// Reverse Cuthill–McKee: a narrow band. For long, thin systems, and for comparison.
    ReverseCuthillMcKee,
    /// Nested dissection of the graph itself, by multilevel bisection: the least fill on large surfaces, but finding it costs
    /// several factorizations. For systems refactored many times, or too large for the fill of [`Self::Amd`].
    GraphDissection,
    /// Geometric nested dissection by the position of each unknown, in any unit (unknowns of one vertex share it; plane
    /// positions leave the third coordinate 0). The best order for grids and surfaces, and the least expensive to find. Where
    /// positions do not show where to cut, as between layers that lie along each other, [`Self::Amd`] is tried, and taken if it
    /// finds what a surface allows.
    NestedDissection(Vec<[f64; 3]>),
    /// An order of the caller's.
    Given(Permutation),
}

/// A renumbering of `n` unknowns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Permutation {
    old_from_new: Vec<u32>,
    new_from_old: Vec<u32>,
}

impl Permutation {
    /// The renumbering whose `k`-th unknown is `order[k]`; `None` unless every index appears exactly once.
    pub fn new(order: Vec<u32>) -> Option<Self> {
        let mut seen = vec![false; order.len()];
        let each_once =
            order.iter().all(|&old| seen.get_mut(old as usize).is_some_and(|s| !std::mem::replace(s, true)));
        each_once.then(|| Self::from_old_from_new(order))
    }

    /// Leaves every number as it is.
    pub fn identity(n: usize) -> Self {
        Self::from_old_from_new((0..n as u32).collect())
    }

    /// For orders that are permutations by construction.
    pub(super) fn from_old_from_new(old_from_new: Vec<u32>) -> Self {
        let mut new_from_old = vec![0; old_from_new.len()];
        for (new, &old) in old_from_new.iter().enumerate() {
            new_from_old[old as usize] = new as u32;
        }
        Self { old_from_new, new_from_old }
    }

    /// Old number of each new one.
    pub fn old_from_new(&self) -> &[u32] {
        &self.old_from_new
    }

    /// New number of each old one.
    pub fn new_from_old(&self) -> &[u32] {
        &self.new_from_old
    }

    /// Number of unknowns.
    pub fn len(&self) -> usize {
        self.old_from_new.len()
    }

    /// True for a system without unknowns.
    pub fn is_empty(&self) -> bool {
        self.old_from_new.is_empty()
    }
}

impl Ordering {
    /// The ordering of `n` unknowns for some of them alone: `kept`, ascending.
    pub(crate) fn restricted(&self, kept: &[u32], n: usize) -> Result<Self, SparseError> {
        let other_size = |size: usize| SparseError::OutOfRange { index: size, unknowns: n };
        Ok(match self {
            Self::NestedDissection(p) if p.len() == n => {
                Self::NestedDissection(kept.iter().map(|&i| p[i as usize]).collect())
            }
            Self::Given(p) if p.len() == n => {
                let mut number = vec![None; n];
                kept.iter().zip(0..).for_each(|(&i, k)| number[i as usize] = Some(k));
                let order = p.old_from_new().iter().filter_map(|&old| number[old as usize]).collect();
                Self::Given(Permutation::new(order).ok_or_else(|| other_size(kept.len()))?)
            }
            Self::NestedDissection(p) => return Err(other_size(p.len())),
            Self::Given(p) => return Err(other_size(p.len())),
            other => other.clone(),
        })
    }

    /// The elimination order for a pattern, not yet postordered.
    pub(super) fn permutation(&self, pattern: &Pattern) -> Result<Permutation, SparseError> {
        let n = pattern.n();
        match self {
            Self::Natural => Ok(Permutation::identity(n)),
            Self::Amd => minimum_degree(pattern),
            Self::ReverseCuthillMcKee => Ok(reverse_cuthill_mckee(pattern)),
            Self::GraphDissection => graph_dissection(pattern),
            Self::NestedDissection(positions) if positions.len() == n => geometric_dissection(pattern, positions),
            Self::NestedDissection(positions) => Err(SparseError::OutOfRange { index: positions.len(), unknowns: n }),
            Self::Given(p) if p.len() == n => Ok(p.clone()),
            Self::Given(p) => Err(SparseError::OutOfRange { index: p.len(), unknowns: n }),
        }
    }
}

/// Nested dissection by positions; where that is out of proportion and minimum degree is not, the latter.
fn geometric_dissection(pattern: &Pattern, positions: &[[f64; 3]]) -> Result<Permutation, SparseError> {
    let (order, separators) = nested_dissection(pattern, positions);
    let most = MULTIPLICATIONS_PER_GROWTH * (pattern.n() as f64).powf(1.5);
    if separators <= most {
        return Ok(order);
    }
    let degree = minimum_degree(pattern)?;
    Ok(if FactorStructure::of_order(pattern, &degree).flops() <= most { degree } else { order })
}

fn minimum_degree(pattern: &Pattern) -> Result<Permutation, SparseError> {
    let n = pattern.n();
    let out_of_memory = || SparseError::out_of_memory(n);
    let symbolic = SymbolicSparseColMatRef::new_checked(n, n, pattern.column_starts(), None, pattern.rows());
    let (mut forward, mut inverse) = (vec![0_u32; n], vec![0_u32; n]);
    let scratch = amd::order_scratch::<u32>(n, pattern.nnz());
    let mut memory = faer::dyn_stack::MemBuffer::try_new(scratch).map_err(|_| out_of_memory())?;
    let stack = faer::dyn_stack::MemStack::new(&mut memory);
    amd::order(&mut forward, &mut inverse, symbolic, amd::Control::default(), stack).map_err(|_| out_of_memory())?;
    Ok(Permutation::from_old_from_new(forward))
}

/// An order of the columns of any matrix whose `AᵀA` fills little, found without forming that product (COLAMD).
pub(super) fn column_degree(a: &GeneralMatrix) -> Result<Permutation, SparseError> {
    let (m, n) = (a.rows(), a.columns());
    let out_of_memory = || SparseError::out_of_memory(n);
    let (starts, rows, _) = a.parts();
    let symbolic = SymbolicSparseColMatRef::new_checked(m, n, starts, None, rows);
    let (mut forward, mut inverse) = (vec![0_u32; n], vec![0_u32; n]);
    let scratch = colamd::order_scratch::<u32>(m, n, a.nnz());
    let mut memory = faer::dyn_stack::MemBuffer::try_new(scratch).map_err(|_| out_of_memory())?;
    let stack = faer::dyn_stack::MemStack::new(&mut memory);
    let control = colamd::Control::default();
    colamd::order(&mut forward, &mut inverse, symbolic, control, stack).map_err(|_| out_of_memory())?;
    Ok(Permutation::from_old_from_new(forward))
}

/// Multilevel nested dissection as METIS does it (Karypis, Kumar 1998), by the crate `feral-metis`.
fn graph_dissection(pattern: &Pattern) -> Result<Permutation, SparseError> {
    let n = pattern.n();
    let adjacency = pattern.adjacency();
    let size = adjacency.items().len();
    if size > i32::MAX as usize {
        return Err(SparseError::TooLarge { size });
    }
    let start: Vec<i32> = adjacency.starts().iter().map(|&start| start as i32).collect();
    let neighbors: Vec<i32> = adjacency.items().iter().map(|&neighbor| neighbor as i32).collect();
    let out_of_memory = || SparseError::out_of_memory(n);
    let graph = feral_metis::CscPattern::new(n, &start, &neighbors).ok_or_else(out_of_memory)?;
    let order = feral_metis::metis_order(&graph).map_err(|_| out_of_memory())?;
    Permutation::new(order.into_iter().map(|v| v as u32).collect()).ok_or_else(out_of_memory)
}
