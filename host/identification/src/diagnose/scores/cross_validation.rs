//! Cross-validation over blocks in closed form.
//!
//! ```text
//!   Σ r² of all blocks around a fit:  Σ_b squares_b + 2 s_bᵀ x + xᵀ K_b x  + xᵀ P x
//!   without block b (and its neighbours):   x₋b = −(K − K_b + P)⁻¹ (s − s_b)
//!   what block b costs by it:               squares_b + 2 s_bᵀ x₋b + x₋bᵀ K_b x₋b
//! ```
//! Exact for a linear model; one Gauss–Newton step otherwise. Blocks that follow on each other without a pause are left out together with their
//! neighbours, which residuals that are correlated in time would tell of them.

use nalgebra::{DMatrix, DVector};

use crate::calibrate::Quadratic;

/// A block is never taken for better predicted than this share of its degrees of freedom.
const LEAST_COST: f64 = 0.1;
/// What makes up for directions that only the blocks left out know, as a share of each direction's own information.
const LOADED: f64 = 1e-9;

/// Where the other blocks lead, for each block: x₋b. `contiguous` tells of every block but the last whether the next one follows on it. `None` where the blocks
/// determine nothing.
pub fn left_out_steps(blocks: &[Quadratic], prior: &DMatrix<f64>, contiguous: &[bool]) -> Option<Vec<DVector<f64>>> {
    let whole = blocks.iter().fold(prior.clone(), |sum, block| sum + &block.information);
    let slope = blocks.iter().fold(DVector::zeros(prior.nrows()), |sum, block| sum + &block.gradient);
    let size = whole.nrows();
    let scale = DVector::from_fn(size, |i, _| if whole[(i, i)] > 0.0 { whole[(i, i)].sqrt().recip() } else { 0.0 });
    let step = |block: usize| {
        let (mut rest, mut rest_slope) = (whole.clone(), slope.clone());
        let before = block.checked_sub(1).filter(|before| contiguous[*before]);
        let behind = contiguous.get(block).filter(|follows| **follows).map(|_| block + 1);
        for left_out in [Some(block), before, behind].into_iter().flatten() {
            rest -= &blocks[left_out].information;
            rest_slope -= &blocks[left_out].gradient;
        }
        let scaled = DMatrix::from_fn(size, size, |i, j| {
            let loaded = if i == j { if scale[i] > 0.0 { LOADED } else { 1.0 } } else { 0.0 };
            scale[i] * scale[j] * rest[(i, j)] + loaded
        });
        let right = rest_slope.component_mul(&scale);
        let step = match scaled.clone().cholesky() {
            Some(factor) => factor.solve(&right),
            // Rounding has made the rest indefinite along a direction that it does not know.
            None => scaled.svd(true, true).solve(&right, 1e-9).ok()?,
        };
        Some(-step.component_mul(&scale))
    };
    (0..blocks.len()).map(step).collect()
}

/// What a model that costs `with` gains over one that costs `without` in a block of so many degrees of freedom: n ln(without / with), twice the difference of Gaussian log-likelihoods whose scale
/// is each block's own. Where noise is what it is taken to be, that is the difference of Σ r²; where models are wrong it is by which share a block is predicted better, and no
/// block outweighs the others by how wrong they are there.
pub fn log_gain(without: f64, with: f64, freedom: f64) -> f64 {
    let least = LEAST_COST * freedom.max(1.0);
    freedom.max(1.0) * (without.max(least) / with.max(least)).ln()
}

/// Σ r² of each block by what the others say.
pub fn left_out(blocks: &[Quadratic], prior: &DMatrix<f64>, contiguous: &[bool]) -> Option<Vec<f64>> {
    let steps = left_out_steps(blocks, prior, contiguous)?;
    Some(blocks.iter().zip(steps).map(|(block, step)| block.at(&step)).collect())
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Blocks of a linear regression, and their columns and readings.
    fn regression(rng: &mut ChaCha8Rng, blocks: usize) -> Vec<(DMatrix<f64>, DVector<f64>)> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut block = || {
            let columns = DMatrix::from_fn(20, 3, |_, _| normal());
            let readings = &columns * DVector::from_vec(vec![1.0, -2.0, 0.5]) + DVector::from_fn(20, |_, _| normal());
            (columns, readings)
        };
        (0..blocks).map(|_| block()).collect()
    }

    /// Around x = 0.
    fn quadratic((columns, readings): &(DMatrix<f64>, DVector<f64>)) -> Quadratic {
        Quadratic {
            squares: readings.norm_squared(),
            gradient: -columns.transpose() * readings,
            information: columns.transpose() * columns,
        }
    }

    #[test]
    fn a_block_costs_what_a_fit_of_the_others_leaves_of_it() {
        let data = regression(&mut ChaCha8Rng::seed_from_u64(1), 9);
        let blocks: Vec<Quadratic> = data.iter().map(quadratic).collect();
        for guarded in [false, true] {
            let found = left_out(&blocks, &DMatrix::zeros(3, 3), &[guarded; 8]).unwrap();
            for (b, found) in found.iter().enumerate() {
                let others = data.iter().enumerate().filter(|(i, _)| i.abs_diff(b) > usize::from(guarded));
                let (mut normal, mut right) = (DMatrix::zeros(3, 3), DVector::zeros(3));
                for (_, (columns, readings)) in others {
                    normal += columns.transpose() * columns;
                    right += columns.transpose() * readings;
                }
                let fitted = normal.cholesky().unwrap().solve(&right);
                let expected = (&data[b].1 - &data[b].0 * fitted).norm_squared();
                // rtol 1e-6: the loading.
                assert!((found / expected - 1.0).abs() < 1e-6, "block {b}: {found}, {expected}");
            }
        }
    }

    #[test]
    fn gains_are_differences_near_the_noise_and_shares_far_from_it() {
        assert!((log_gain(1010.0, 1000.0, 1000.0) - 10.0).abs() < 0.1);
        // Half of the squares gone, whatever the blocks' own misfit is.
        assert!((log_gain(2e6, 1e6, 1000.0) - log_gain(2e3, 1e3, 1000.0)).abs() < 1e-9);
        assert!(log_gain(f64::NAN, 1.0, 10.0).is_finite() && log_gain(5.0, -1.0, 10.0) > 0.0);
    }

    #[test]
    fn what_no_other_block_knows_stays_where_it_is() {
        let mut data = regression(&mut ChaCha8Rng::seed_from_u64(2), 8);
        data.iter_mut().skip(1).for_each(|(columns, _)| columns.column_mut(2).fill(0.0));
        let blocks: Vec<Quadratic> = data.iter().map(quadratic).collect();
        let steps = left_out_steps(&blocks, &DMatrix::zeros(3, 3), &[false; 7]).unwrap();
        assert!(steps[0][2].abs() < 1e-6 && steps[1][2].abs() > 0.1, "{steps:?}");
        assert!(steps.iter().all(|step| step.iter().all(|x| x.is_finite())));
    }
}
