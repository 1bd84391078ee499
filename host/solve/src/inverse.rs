//! What of the inverse a factor gives in O(N): the log-determinant, and the blocks of H⁻¹ that lie where H has blocks itself.
//!
//! Stage k was eliminated into its neighbour p on the way to the middle, `U x_k = −(Y x_p + Z β) + ε` with ε of unit covariance, so
//!
//! ```text
//!   [Σ_kp  Σ_kβ] = −U⁻¹ [Y  Z] [Σ_pp  Σ_pβ; Σ_βp  Σ_ββ]          Σ_kk = U⁻¹ U⁻ᵀ − [Σ_kp  Σ_kβ] [Y  Z]ᵀ U⁻ᵀ
//! ```
//! from the middle outwards. Σ_ββ is the covariance of the shared unknowns, zero along directions that are held.

use nalgebra::{DMatrix, DMatrixView};

use super::factor::{Factor, StageFactor};

/// log det of the states' part of H: with log det of the Schur complement, that of the whole matrix.
pub fn log_determinant_of_states(factor: &Factor) -> f64 {
    log_determinants_of_states(factor, &[0]).into_iter().sum()
}

/// The same of the blocks of stages that begin with these, ascending from 0, where the chain breaks.
pub fn log_determinants_of_states(factor: &Factor, starts: &[usize]) -> Vec<f64> {
    let n = factor.columns().shape.stage;
    let mut stage = StageFactor::default();
    let ends = starts.iter().skip(1).copied().chain([factor.columns().shape.stages]);
    let mut of_block = |stages: std::ops::Range<usize>| {
        let mut sum = 0.0;
        for k in stages {
            factor.stage(k, &mut stage);
            sum += (0..n).map(|i| stage.u[i * n + i].ln()).sum::<f64>();
        }
        2.0 * sum
    };
    starts.iter().zip(ends).map(|(start, end)| of_block(*start..end)).collect()
}

/// The blocks of the inverse that belong to one stage.
#[derive(Debug)]
pub struct Blocks<'a> {
    /// The stage.
    pub stage: usize,
    /// Σ_kk, n × n.
    pub own: &'a DMatrix<f64>,
    /// The neighbour p towards the middle with Σ_kp, n × n; none for the middle itself. Behind a gap it is zero but for what the shared
    /// unknowns carry over.
    pub neighbour: Option<(usize, DMatrixView<'a, f64>)>,
    /// Σ_kβ, n × m.
    pub shared: DMatrixView<'a, f64>,
}

/// Calls `visit` with the blocks of every stage, the middle one first, then outwards to either end; `covariance` is Σ_ββ.
pub fn selected_inverse(factor: &Factor, covariance: &DMatrix<f64>, mut visit: impl FnMut(Blocks<'_>)) {
    let (shape, middle) = (factor.columns().shape, factor.middle());
    let (n, m) = (shape.stage, shape.border);
    let mut stage = StageFactor::default();
    // Σ of [p, β] as far as it is known: the neighbour's own block, and its coupling to the border.
    let mut step = |k: usize, parent: Option<(usize, &DMatrix<f64>)>| -> DMatrix<f64> {
        factor.stage(k, &mut stage);
        let width = if parent.is_some() { n + m } else { m };
        let mut known = DMatrix::zeros(width, width);
        let mut coupling = DMatrix::zeros(n, width);
        if let Some((_, sigma)) = parent {
            known.view_mut((0, 0), (n, n + m)).copy_from(&sigma.rows(0, n));
            known.view_mut((n, 0), (m, n)).copy_from(&sigma.view((0, n), (n, m)).transpose());
            coupling.view_mut((0, 0), (n, n)).copy_from(&DMatrix::from_row_slice(n, n, &stage.y));
        }
        known.view_mut((width - m, width - m), (m, m)).copy_from(covariance);
        coupling.view_mut((0, width - m), (n, m)).copy_from(&DMatrix::from_row_slice(n, m, &stage.z));
        let u = DMatrix::from_row_slice(n, n, &stage.u);
        let mut inverse = DMatrix::identity(n, n);
        let solved = u.solve_upper_triangular_mut(&mut inverse);
        debug_assert!(solved, "the diagonal of a factor is positive");
        let weights = inverse.clone() * coupling;
        let across = -(&weights * known);
        let own = &inverse * inverse.transpose() - &across * weights.transpose();
        let own = (&own + own.transpose()) * 0.5;
        let neighbour = parent.map(|(p, _)| (p, across.view((0, 0), (n, n))));
        visit(Blocks { stage: k, own: &own, neighbour, shared: across.view((0, width - m), (n, m)) });
        let mut sigma = DMatrix::zeros(n, n + m);
        sigma.view_mut((0, 0), (n, n)).copy_from(&own);
        sigma.view_mut((0, n), (n, m)).copy_from(&across.view((0, width - m), (n, m)));
        sigma
    };
    let root = step(middle, None);
    let mut sigma = root.clone();
    for k in (0..middle).rev() {
        sigma = step(k, Some((k + 1, &sigma)));
    }
    sigma = root;
    for k in middle + 1..shape.stages {
        sigma = step(k, Some((k - 1, &sigma)));
    }
}
