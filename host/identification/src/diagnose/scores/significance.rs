//! How surprising a score is where residuals are coloured and blocks differ: a test by the scatter between blocks.
//!
//! With whitened scores u_b of a law in block b and what is left of them once the other blocks' estimate is taken off, e_b,
//!
//! ```text
//!   S = |Σ u_b|²        V = Σ e_b e_bᵀ        S / tr V ~ F(ν₁, ν₂)      ν₁ = (tr V)² / tr V²,  ν₂ = (Σ h_b)² / Σ h_b² − 1
//! ```
//! where h_b is the share of the information that block b has (Satterthwaite 1946; Rotnitzky and Jewell 1990). The size of the assumed noise cancels.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Share of worlds without the law in which its blocks would agree as much. `scores` are u_b, `residuals` e_b, `shares` h_b.
pub fn p_of_blocks(scores: &[DVector<f64>], residuals: &[DVector<f64>], shares: &[f64]) -> f64 {
    let Some(freedom) = scores.first().map(|score| score.len()).filter(|freedom| *freedom > 0) else { return 1.0 };
    let sum = scores.iter().fold(DVector::zeros(freedom), |sum, score| sum + score);
    let scatter = residuals.iter().fold(DMatrix::zeros(freedom, freedom), |sum, e| sum + e * e.transpose());
    let trace = scatter.trace();
    let (all, squares) = shares.iter().fold((0.0, 0.0), |(all, squares), share| (all + share, squares + share * share));
    let independent = all * all / squares - 1.0;
    p_of_ratio(sum.norm_squared() / trace, trace * trace / (&scatter * &scatter).trace(), independent)
}

/// Share of noise in which a ratio of two mean squares of so many degrees of freedom is at least this large; 1 where that cannot be told.
pub fn p_of_ratio(ratio: f64, freedom: f64, independent: f64) -> f64 {
    if !(ratio > 0.0 && independent >= 1.0) {
        return 1.0;
    }
    match FisherSnedecor::new(freedom.max(1.0), independent) {
        Ok(distribution) => distribution.sf(ratio).clamp(0.0, 1.0),
        Err(_) => 1.0,
    }
}

/// Share of white noise that gives a score at least this large with so many free parameters (χ²).
pub fn p_of_score(score: f64, freedom: usize) -> f64 {
    match ChiSquared::new(freedom.max(1) as f64) {
        Ok(distribution) if score > 0.0 => distribution.sf(score),
        _ => 1.0,
    }
}

/// Share of worlds in which blocks gain as much though the law gains as often as it loses (Wilcoxon's signed-rank test, one-sided, exact). Blocks differ by orders of magnitude in what
/// there is to gain; a mean over its standard error would be of the few largest.
pub fn p_of_gains(gains: &[f64]) -> f64 {
    let mut ranked: Vec<f64> = gains.iter().copied().filter(|gain| *gain != 0.0).collect();
    if ranked.iter().any(|gain| !gain.is_finite()) {
        return 1.0;
    }
    ranked.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let lost: usize = ranked.iter().zip(1..).filter(|(gain, _)| **gain < 0.0).map(|(_, rank)| rank).sum();
    // The share of all choices of signs whose losses have such a sum of ranks: one rank after the other.
    let mut share = vec![0.0; lost + 1];
    share[0] = 1.0;
    for rank in 1..=ranked.len() {
        for sum in (0..=lost).rev() {
            share[sum] = 0.5 * (share[sum] + sum.checked_sub(rank).map_or(0.0, |other| share[other]));
        }
    }
    share.iter().sum::<f64>().min(1.0)
}

/// The p-value of two tests of the same, of which the smaller is taken (Bonferroni).
pub fn p_of_both(a: f64, b: f64) -> f64 {
    (2.0 * a.min(b)).min(1.0)
}

/// Share of noise in which the least of so many p-values is at most `p` (Šidák: exact for independent tests, and too careful for others).
pub fn p_of_family(p: f64, tests: usize) -> f64 {
    -(tests as f64 * (-p).ln_1p()).exp_m1()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// p of laws that are not there, 24 blocks of unlike sizes whose scores are `inflation` times as large as their information says.
    fn nulls(freedom: usize, inflation: f64, unlike: bool) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        (0..2000)
            .map(|_| {
                let mut normal = |_: usize, _: usize| -> f64 { StandardNormal.sample(&mut rng) };
                let size = |b: usize| if unlike && b.is_multiple_of(3) { 4.0 } else { 1.0 };
                let total: f64 = (0..24).map(size).sum();
                let share = |b: usize| size(b) / total;
                let u: Vec<DVector<f64>> =
                    (0..24).map(|b| DVector::from_fn(freedom, &mut normal) * (inflation * share(b)).sqrt()).collect();
                let sum = u.iter().fold(DVector::zeros(freedom), |sum, u| sum + u);
                let residual = |b: usize| &u[b] - (&sum - &u[b]) * (share(b) / (1.0 - share(b)));
                let e: Vec<DVector<f64>> = (0..24).map(residual).collect();
                p_of_blocks(&u, &e, &(0..24).map(share).collect::<Vec<_>>())
            })
            .collect()
    }

    #[test]
    fn laws_that_are_not_there_pass_as_often_as_the_level_says_whatever_the_noise_is_taken_to_be() {
        for (freedom, inflation, unlike) in [(1, 1.0, false), (1, 400.0, false), (4, 1.0, true), (12, 30.0, true)] {
            let p = nulls(freedom, inflation, unlike);
            for level in [0.05, 0.01] {
                let passed = p.iter().filter(|p| **p < level).count() as f64 / 2000.0;
                // Never half as often again as it should be; the leave-one-out scatter makes it a little too careful.
                let most = 1.5 * level + 3.0 * (level / 2000.0_f64).sqrt();
                assert!(passed <= most, "{freedom}, {inflation}: {passed} below {level}");
                // With half as many directions as blocks it is far too careful: 0.0015 below 0.05 measured.
                assert!(freedom > 4 || passed >= 0.1 * level, "{freedom}, {inflation}: {passed} below {level}");
            }
        }
    }

    #[test]
    fn one_block_alone_shows_nothing() {
        let mut u = vec![DVector::from_element(1, 0.0); 24];
        u[3][0] = 100.0;
        let mut shares = vec![1e-12; 24];
        shares[3] = 1.0;
        assert!(p_of_blocks(&u, &u, &shares) > 0.3);
        assert_eq!(p_of_ratio(f64::NAN, 1.0, 20.0), 1.0);
    }

    #[test]
    fn gains_of_most_blocks_count_however_unlike_they_are_and_those_of_a_few_do_not() {
        let unlike: Vec<f64> = (0..30).map(|b| f64::from(b).exp() * if b % 10 == 3 { -1.0 } else { 1.0 }).collect();
        assert!(p_of_gains(&unlike) < 1e-3, "{}", p_of_gains(&unlike));
        let few: Vec<f64> = (0..30).map(|b| if b < 3 { 1e6 } else { -1.0 - f64::from(b) }).collect();
        assert!(p_of_gains(&few) > 0.9, "{}", p_of_gains(&few));
        // All of n positive: 2⁻ⁿ. All signs of three: 1/8 each.
        assert!((p_of_gains(&[1.0; 12]) - 0.5_f64.powi(12)).abs() < 1e-18);
        assert!((p_of_gains(&[1.0, -2.0, 3.0]) - 3.0 / 8.0).abs() < 1e-15);
        assert_eq!((p_of_gains(&[]), p_of_gains(&[f64::NAN, 1.0])), (1.0, 1.0));
    }

    #[test]
    fn gains_of_nothing_pass_as_often_as_the_level_says() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let p = |rng: &mut ChaCha8Rng| {
            let mut normal = || -> f64 { StandardNormal.sample(rng) };
            p_of_gains(&(0..30).map(|_| normal() * (3.0 * normal()).exp()).collect::<Vec<_>>())
        };
        let passed = (0..4000).filter(|_| p(&mut rng) < 0.01).count();
        // Of 4000 at 1 %: 40 ± 6.3, two sides of three standard errors.
        assert!((21..=59).contains(&passed), "{passed}");
    }

    #[test]
    fn the_family_is_as_strict_as_its_number() {
        assert!((p_of_family(0.01, 1) - 0.01).abs() < 1e-15);
        assert!((p_of_family(1e-4, 60) - 0.005_982).abs() < 1e-6);
        assert!((p_of_family(1e-30, 60) - 6e-29).abs() < 1e-35);
    }
}
