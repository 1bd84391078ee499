//! What a problem hands to the solver: whitened residual rows, transitions and a retraction.

/// Whitened residual rows of one stage, each `[∂r/∂x (n) | ∂r/∂p (m) | r]`.
///
/// The rows are laid out with a stride that the solver's kernels like; fill them through [`Rows::push`].
#[derive(Debug, Clone)]
pub struct Rows {
    values: Vec<f64>,
    stage: usize,
    padded_stage: usize,
    border: usize,
    width: usize,
    count: usize,
}

impl Rows {
    /// Room for rows over `stage` and `border` unknowns, stored `padded_stage` and `width` wide.
    pub(super) fn new(stage: usize, padded_stage: usize, border: usize, width: usize) -> Self {
        Rows { values: Vec::new(), stage, padded_stage, border, width, count: 0 }
    }

    /// Forgets all rows.
    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    /// Appends a row with residual `residual`, all derivatives zero, and gives its two gradient parts `(∂r/∂x, ∂r/∂p)` to fill.
    pub fn push(&mut self, residual: f64) -> (&mut [f64], &mut [f64]) {
        let start = self.count * self.width;
        if self.values.len() < start + self.width {
            self.values.resize(start + self.width, 0.0);
        }
        self.count += 1;
        let row = &mut self.values[start..start + self.width];
        row.fill(0.0);
        let (x, rest) = row.split_at_mut(self.padded_stage);
        rest[self.border] = residual;
        (&mut x[..self.stage], &mut rest[..self.border])
    }

    /// All rows, `count × width`, row-major.
    pub(super) fn values(&self) -> &[f64] {
        &self.values[..self.count * self.width]
    }
}

/// The transition of stage k into stage k+1 with its weights: the residual is `w ∘ (φ(x[k], p) − x[k+1])`, unweighted here.
#[derive(Debug, Clone)]
pub struct Transition {
    /// `n × width`, row i is `[∂φᵢ/∂x (n, padded) | ∂φᵢ/∂p (m) | φᵢ − x[k+1]ᵢ]`.
    pub(super) values: Vec<f64>,
    /// 1/σ of each of the n rows.
    pub(super) weight: Vec<f64>,
    padded_stage: usize,
    border: usize,
    width: usize,
    stage: usize,
}

impl Transition {
    /// An empty transition; the padding unknowns are tied to nothing (weight zero).
    pub(super) fn new(stage: usize, padded_stage: usize, border: usize, width: usize) -> Self {
        Transition {
            values: vec![0.0; padded_stage * width],
            weight: vec![0.0; padded_stage],
            padded_stage,
            border,
            width,
            stage,
        }
    }

    /// Sets row i: its weight 1/σ and its defect φᵢ − x[k+1]ᵢ; gives the zeroed gradient parts `(∂φᵢ/∂x, ∂φᵢ/∂p)` to fill.
    pub fn row(&mut self, i: usize, weight: f64, defect: f64) -> (&mut [f64], &mut [f64]) {
        self.weight[i] = weight;
        let row = &mut self.values[i * self.width..(i + 1) * self.width];
        row.fill(0.0);
        let (x, rest) = row.split_at_mut(self.padded_stage);
        rest[self.border] = defect;
        (&mut x[..self.stage], &mut rest[..self.border])
    }
}

/// A step in tangent space: `states[k·n + i]` and `border[j]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Change of every stage's unknowns, `stages × n`, row-major.
    pub states: Vec<f64>,
    /// Change of the shared unknowns, m.
    pub border: Vec<f64>,
}

/// A least-squares problem on a chain with a border: minimise ½ Σ r² over all stages and the shared unknowns.
pub trait LeastSquares: Sync {
    /// A point of the search space (states and shared unknowns, manifolds included).
    type Point: Clone + Send + Sync;
    /// Room for intermediate values: one a thread.
    type Scratch;

    /// Makes a scratch space.
    fn scratch(&self) -> Self::Scratch;

    /// Number of stages N.
    fn stages(&self) -> usize;
    /// Unknowns of a stage, n.
    fn stage_size(&self) -> usize;
    /// Shared unknowns, m.
    fn border_size(&self) -> usize;
    /// Whether stage k is carried into stage k+1 (false at a gap and at the last stage).
    fn linked(&self, k: usize) -> bool;
    /// Pushes the whitened residual rows of stage k at `point`.
    fn rows(&self, point: &Self::Point, k: usize, scratch: &mut Self::Scratch, rows: &mut Rows);
    /// Fills all n rows of the transition k → k+1 at `point`; only called where [`linked`](Self::linked).
    fn transition(&self, point: &Self::Point, k: usize, scratch: &mut Self::Scratch, transition: &mut Transition);
    /// Whitened residual rows of the border alone (priors on shared unknowns); none by default.
    fn border_rows(&self, _point: &Self::Point, _rows: &mut Rows) {}
    /// ½ Σ r² of the residuals that start at stage k (its rows and its transition).
    fn cost(&self, point: &Self::Point, k: usize, scratch: &mut Self::Scratch) -> f64;
    /// ½ Σ r² of the border's own rows.
    fn border_cost(&self, _point: &Self::Point) -> f64 {
        0.0
    }
    /// The point reached from `point` by `step`, x ⊞ δ.
    fn retract(&self, point: &Self::Point, step: &Step) -> Self::Point;
}
