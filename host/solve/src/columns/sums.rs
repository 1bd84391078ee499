//! What is left of the shared unknowns and the extra columns of a block of stages, with its states eliminated.

use nalgebra::{DMatrix, DVector};

use super::Reduced;
use crate::shape::Columns;
use crate::simd::{LANES, Quad};

/// What one block says of the shared unknowns β and of the extra columns γ, with its states eliminated. Rows of the border's own, which belong to no
/// block, are not in it.
#[derive(Debug)]
pub struct BlockSums<'a> {
    sums: &'a [Quad],
    /// Rows of a group of sums.
    rows: usize,
    /// Shared unknowns, m; the residual is the column behind them.
    shared: usize,
    /// Where the extra columns begin.
    behind: usize,
    /// Extra columns, q.
    count: usize,
}

impl<'a> BlockSums<'a> {
    pub(super) fn new(sums: &'a [Quad], columns: Columns, extra: usize, count: usize) -> Self {
        let groups = columns.groups_with_right();
        BlockSums { sums, rows: (groups + extra) * LANES, shared: columns.shape.border, behind: groups * LANES, count }
    }

    fn sum(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.min(j), i.max(j));
        self.sums[j / LANES * self.rows + i].0[j % LANES]
    }

    /// Number of shared unknowns, m.
    pub fn shared(&self) -> usize {
        self.shared
    }

    /// Number of extra columns, q.
    pub fn count(&self) -> usize {
        self.count
    }

    /// S_ββ of shared unknowns i and j.
    pub fn shared_information(&self, i: usize, j: usize) -> f64 {
        self.sum(i, j)
    }

    /// s_β of shared unknown i: half the slope of Σ r² with the states at their Gauss–Newton step.
    pub fn shared_gradient(&self, i: usize) -> f64 {
        self.sum(i, self.shared)
    }

    /// S_βγ of shared unknown i and column j.
    pub fn coupling(&self, i: usize, j: usize) -> f64 {
        self.sum(i, self.behind + j)
    }

    /// S_γγ of columns i and j.
    pub fn information(&self, i: usize, j: usize) -> f64 {
        self.sum(self.behind + i, self.behind + j)
    }

    /// s_γ of column j.
    pub fn gradient(&self, j: usize) -> f64 {
        self.sum(self.shared, self.behind + j)
    }

    /// Σ r² with the states at their Gauss–Newton step.
    pub fn squares(&self) -> f64 {
        self.sum(self.shared, self.shared)
    }

    pub(super) fn reduced(&self) -> Reduced {
        Reduced {
            coupling: DMatrix::from_fn(self.shared, self.count, |i, j| self.coupling(i, j)),
            information: DMatrix::from_fn(self.count, self.count, |i, j| self.information(i, j)),
            gradient: DVector::from_fn(self.count, |j, _| self.gradient(j)),
        }
    }
}
