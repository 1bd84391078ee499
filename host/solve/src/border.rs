//! The reduced system of the shared unknowns: damped steps and covariance, with directions held.

use nalgebra::{DMatrix, DVector};

/// Information of a direction, in units of what it would be were all others known, that rounding alone may make.
const UNDETERMINED: f64 = 1e-12;

/// The information matrix S (states eliminated) and gradient g of the shared unknowns, with directions that are held.
#[derive(Debug, Clone)]
pub struct Border {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    /// 1/√S_ii: unknowns are compared in units of their conditional standard deviation.
    scale: DVector<f64>,
    /// Orthonormal columns (scaled coordinates): the held directions.
    held: DMatrix<f64>,
}

impl Border {
    /// From the Schur complement (row-major m × m) and its gradient; `held` are directions in the unknowns' own units that no step may take.
    pub fn new(information: &[f64], gradient: &[f64], held: &[Vec<f64>]) -> Self {
        let m = gradient.len();
        let information = DMatrix::from_row_slice(m, m, information);
        let scale =
            DVector::from_fn(
                m,
                |i, _| if information[(i, i)] > 0.0 { information[(i, i)].sqrt().recip() } else { 1.0 },
            );
        let mut border =
            Border { gradient: DVector::from_row_slice(gradient), information, held: DMatrix::zeros(m, 0), scale };
        for direction in held {
            border.hold(direction);
        }
        border
    }

    /// Holds one more direction (in the unknowns' own units).
    fn hold(&mut self, direction: &[f64]) {
        let mut v = DVector::from_row_slice(direction).component_div(&self.scale);
        // Its length means nothing: where rounding alone makes up the information, the unit is huge.
        let whole = v.norm();
        for q in self.held.column_iter() {
            v -= q * q.dot(&v);
        }
        let norm = v.norm();
        if norm > 1e-9 * whole {
            let column = self.held.ncols();
            self.held = std::mem::replace(&mut self.held, DMatrix::zeros(0, 0)).insert_column(column, 0.0);
            self.held.set_column(column, &(v / norm));
        }
    }

    /// Holds every direction that S does not determine at all, beside what is held already: columns that say the same.
    pub fn hold_undetermined(&mut self) {
        let eigen = self.scaled().symmetric_eigen();
        for (value, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value < UNDETERMINED {
                let own: Vec<f64> = direction.component_mul(&self.scale).iter().copied().collect();
                self.hold(&own);
            }
        }
    }

    /// S in units of the conditional standard deviations, with the held directions made regular and independent of the rest.
    fn scaled(&self) -> DMatrix<f64> {
        let m = self.scale.len();
        let scaled = DMatrix::from_fn(m, m, |i, j| self.information[(i, j)] * self.scale[i] * self.scale[j]);
        let free = DMatrix::identity(m, m) - &self.held * self.held.transpose();
        &free * scaled * &free + &self.held * self.held.transpose()
    }

    /// The step that solves `(S + damping diag S) δ = −g` with no component along held directions, and the decrease of ½ Σ r² that the
    /// quadratic model promises for it. `None` when the damped matrix is not positive definite.
    pub fn step(&self, damping: f64) -> Option<(Vec<f64>, f64)> {
        let m = self.scale.len();
        let scaled = self.scaled();
        let free = DMatrix::identity(m, m) - &self.held * self.held.transpose();
        let gradient = &free * self.gradient.component_mul(&self.scale);
        let damped = &scaled + DMatrix::identity(m, m) * damping;
        let delta = -damped.cholesky()?.solve(&gradient);
        let promised = -gradient.dot(&delta) - 0.5 * delta.dot(&(&scaled * &delta));
        Some((delta.component_mul(&self.scale).as_slice().to_vec(), promised))
    }

    /// Covariance of the shared unknowns, row-major m × m: the inverse of S on the directions that are free, zero along held ones.
    /// `None` when S is singular there.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let m = self.scale.len();
        let inverse = self.scaled().cholesky()?.inverse() - &self.held * self.held.transpose();
        Some(DMatrix::from_fn(m, m, |i, j| inverse[(i, j)] * self.scale[i] * self.scale[j]))
    }

    /// A basis of the directions that are free, in the unknowns' own units: columns of about unit information each, m × f.
    pub fn free_directions(&self) -> DMatrix<f64> {
        let m = self.scale.len();
        let eigen = (&self.held * self.held.transpose()).symmetric_eigen();
        let free: Vec<usize> = (0..m).filter(|&i| eigen.eigenvalues[i] < 0.5).collect();
        DMatrix::from_fn(m, free.len(), |i, j| self.scale[i] * eigen.eigenvectors[(i, free[j])])
    }

    /// log det of S, on the directions that are free in units of the conditional standard deviations where some are held. `None` when S is singular there.
    pub fn log_determinant(&self) -> Option<f64> {
        let scaled = self.scaled().cholesky()?;
        let factor: f64 = scaled.l_dirty().diagonal().iter().map(|v| v.ln()).sum();
        let units: f64 = if self.held.ncols() == 0 { self.scale.iter().map(|v| v.ln()).sum() } else { 0.0 };
        Some(2.0 * (factor - units))
    }
}
