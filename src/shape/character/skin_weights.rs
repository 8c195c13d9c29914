//! Skin weights: the influence of each joint on each vertex.

use super::CharacterError;
use plumbline_num::options::OptionError;

/// Largest distance of a weight sum from 1: weights stored in single precision lose 6e-8 each, a row of eight at most 5e-7.
const SUM_TOLERANCE: f64 = 1e-6;

/// A joint and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Influence {
    /// Index of the joint.
    pub joint: u32,
    /// Its weight, above 0.
    pub weight: f64,
}

/// What normalization changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Normalization {
    /// Vertices whose weights did not sum to 1.
    pub changed: usize,
    /// Largest deviation of a sum from 1, signed.
    pub max_deviation: f64,
    /// Vertices without weights that were assigned to the fallback joint.
    pub weightless: usize,
}

/// Sparse skin weights in compressed rows. Invariants of a row: joints are distinct, weights are above 0, in descending order, and
/// sum to 1 within 1e-6.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinWeights {
    joint_count: usize,
    starts: Vec<u32>,
    influences: Vec<Influence>,
}

impl SkinWeights {
    /// Weights that already sum to one; they are stored unchanged. Zeros are dropped, weights of a repeated joint are added.
    ///
    /// # Errors
    /// [`CharacterError::Input`]: a joint that does not exist, a negative weight, a vertex without weights or with another sum.
    pub fn new<R>(joint_count: usize, rows: impl IntoIterator<Item = R>) -> Result<Self, CharacterError>
    where
        R: IntoIterator<Item = (u32, f64)>,
    {
        let weights = Self::collected(joint_count, rows)?;
        weights.check_weightless()?;
        let off = |(_, sum): &(usize, f64)| !((sum - 1.0).abs() <= SUM_TOLERANCE);
        if let Some((vertex, sum)) = weights.sums().enumerate().find(off) {
            let expected = format!("(expected 1 ± {SUM_TOLERANCE:e}); normalize them first");
            return Err(CharacterError::Input(format!("the weights of vertex {vertex} sum to {sum} {expected}")));
        }
        Ok(weights)
    }

    /// Weights of any positive sum, normalized. Vertices without weights are assigned to `weightless`, or rejected if it is `None`.
    ///
    /// # Errors
    /// [`CharacterError::Input`]: a joint that does not exist, a negative weight, a vertex without weights.
    pub fn normalized<R>(
        joint_count: usize,
        rows: impl IntoIterator<Item = R>,
        weightless: Option<u32>,
    ) -> Result<(Self, Normalization), CharacterError>
    where
        R: IntoIterator<Item = (u32, f64)>,
    {
        let mut weights = Self::collected(joint_count, rows)?;
        let mut report = Normalization::default();
        if let Some(joint) = weightless {
            weights.check_joint(0, joint)?;
            report.weightless = weights.give_weightless_to(joint);
        }
        weights.check_weightless()?;
        for v in 0..weights.vertex_count() {
            let row = weights.row_mut(v);
            let sum: f64 = row.iter().map(|i| i.weight).sum();
            if (sum - 1.0).abs() > SUM_TOLERANCE {
                report.changed += 1;
            }
            if (sum - 1.0).abs() > report.max_deviation.abs() {
                report.max_deviation = sum - 1.0;
            }
            for i in row.iter_mut() {
                i.weight /= sum;
            }
        }
        Ok((weights, report))
    }

    /// Rigid skinning: every vertex has a single joint.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a joint that does not exist.
    pub fn rigid(joint_count: usize, joints: &[u32]) -> Result<Self, CharacterError> {
        Self::new(joint_count, joints.iter().map(|&j| [(j, 1.0)]))
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joint_count
    }

    /// Influences on a vertex, in descending order of weight.
    #[inline]
    pub fn row(&self, vertex: usize) -> &[Influence] {
        &self.influences[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// All rows.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[Influence]> + Clone + '_ {
        self.starts.windows(2).map(|s| &self.influences[s[0] as usize..s[1] as usize])
    }

    /// Weight of a joint for a vertex, 0 if it has none.
    pub fn weight(&self, vertex: usize, joint: u32) -> f64 {
        self.row(vertex).iter().find(|i| i.joint == joint).map_or(0.0, |i| i.weight)
    }

    /// Largest number of influences of any vertex.
    pub fn most_influences(&self) -> usize {
        self.rows().map(<[_]>::len).max().unwrap_or(0)
    }

    /// Sum of each row, 1 within 1e-6.
    pub fn sums(&self) -> impl Iterator<Item = f64> + '_ {
        self.rows().map(|r| r.iter().map(|i| i.weight).sum())
    }

    /// Drops weights below `min_weight` (the largest of a vertex always stays) and renormalizes.
    ///
    /// # Errors
    /// [`CharacterError::Option`] if `min_weight` is outside 0 .. 1.
    pub fn pruned(&self, min_weight: f64) -> Result<Self, CharacterError> {
        OptionError::check((0.0..1.0).contains(&min_weight), "min_weight", min_weight, "0 or more, below 1")?;
        let stays = |&(k, i): &(usize, &Influence)| k == 0 || i.weight >= min_weight;
        Ok(self.kept(|row| row.iter().enumerate().filter(stays).map(|(_, i)| *i).collect()))
    }

    /// Keeps the `most` largest weights of each vertex and renormalizes.
    ///
    /// A kept weight `w` is scaled by `min(1, w / w_out − 1)`, where `w_out` is the largest dropped weight. It thus reaches zero where
    /// the two change rank, and the weights stay continuous over the surface.
    ///
    /// # Errors
    /// [`CharacterError::Option`] if `most` is 0.
    pub fn limited(&self, most: usize) -> Result<Self, CharacterError> {
        OptionError::check(most > 0, "influences", 0.0, "1 or more")?;
        Ok(self.kept(|row| {
            let Some(out) = row.get(most) else { return row.to_vec() };
            let fade = |i: &Influence| Influence { weight: i.weight * (i.weight / out.weight - 1.0).min(1.0), ..*i };
            let faded: Vec<Influence> = row[..most].iter().map(fade).filter(|i| i.weight > 0.0).collect();
            // All kept weights equal the largest dropped one.
            if faded.is_empty() { row[..most].to_vec() } else { faded }
        }))
    }

    /// Applies `keep` to each row (in descending order) and renormalizes the rows that became shorter.
    fn kept(&self, keep: impl Fn(&[Influence]) -> Vec<Influence>) -> Self {
        let (mut starts, mut influences) = (vec![0], Vec::with_capacity(self.influences.len()));
        for row in self.rows() {
            let mut left = keep(row);
            if left.len() < row.len() {
                let sum: f64 = left.iter().map(|i| i.weight).sum();
                for influence in &mut left {
                    influence.weight /= sum;
                }
            }
            influences.append(&mut left);
            starts.push(influences.len() as u32);
        }
        Self { joint_count: self.joint_count, starts, influences }
    }

    /// Rows sorted by weight, then joint; every check except the sums.
    fn collected<R>(joint_count: usize, rows: impl IntoIterator<Item = R>) -> Result<Self, CharacterError>
    where
        R: IntoIterator<Item = (u32, f64)>,
    {
        let mut weights = Self { joint_count, starts: vec![0], influences: Vec::new() };
        let mut one: Vec<Influence> = Vec::new();
        for (vertex, row) in rows.into_iter().enumerate() {
            one.clear();
            for (joint, weight) in row {
                if !(weight >= 0.0 && weight.is_finite()) {
                    let weight = format!("the weight {weight} of vertex {vertex} for joint {joint}");
                    return Err(CharacterError::Input(format!("{weight} is invalid (expected 0 or more, finite)")));
                }
                if weight == 0.0 {
                    continue;
                }
                weights.check_joint(vertex, joint)?;
                match one.iter_mut().find(|i| i.joint == joint) {
                    Some(same) => same.weight += weight,
                    None => one.push(Influence { joint, weight }),
                }
            }
            one.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.joint.cmp(&b.joint)));
            weights.influences.extend_from_slice(&one);
            weights.starts.push(weights.influences.len() as u32);
        }
        Ok(weights)
    }

    fn check_joint(&self, vertex: usize, joint: u32) -> Result<(), CharacterError> {
        if (joint as usize) < self.joint_count {
            return Ok(());
        }
        let there = format!("but the skin has {} joints, numbered from 0", self.joint_count);
        Err(CharacterError::Input(format!("vertex {vertex} follows joint {joint}, {there}")))
    }

    fn check_weightless(&self) -> Result<(), CharacterError> {
        let mut empty = self.rows().enumerate().filter(|(_, r)| r.is_empty()).map(|(v, _)| v);
        match empty.next() {
            None => Ok(()),
            Some(vertex) => {
                let count = 1 + empty.count();
                let first = format!("the first is vertex {vertex}; give each a weight above 0");
                Err(CharacterError::Input(format!("{count} vertices have no weight, {first}")))
            }
        }
    }

    fn give_weightless_to(&mut self, joint: u32) -> usize {
        let mut given = 0;
        let (mut starts, mut influences) = (vec![0], Vec::with_capacity(self.influences.len()));
        for row in self.rows() {
            if row.is_empty() {
                given += 1;
                influences.push(Influence { joint, weight: 1.0 });
            }
            influences.extend_from_slice(row);
            starts.push(influences.len() as u32);
        }
        (self.starts, self.influences) = (starts, influences);
        given
    }

    fn row_mut(&mut self, vertex: usize) -> &mut [Influence] {
        &mut self.influences[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}
