//! Is it one constant? What each block alone says of a parameter, held against what they say together (Cochran's Q).

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Cochran's Q over blocks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stability {
    /// Σ w_b (γ_b − γ)², weights by the information of each block in units of its own scatter.
    pub q: f64,
    /// Blocks less one.
    pub dof: usize,
    /// Share of constants whose blocks differ as much.
    pub p: f64,
}

/// Of estimates γ_b with information w_b of each block, where noise of the assumed size is `inflation` times too small. `None` of fewer than two blocks.
pub fn stability(estimates: &[f64], information: &[f64], inflation: f64) -> Option<Stability> {
    let known: Vec<(f64, f64)> = estimates
        .iter()
        .zip(information)
        .map(|(estimate, information)| (*estimate, information / inflation.max(f64::MIN_POSITIVE)))
        .filter(|(estimate, weight)| estimate.is_finite() && *weight > 0.0)
        .collect();
    let (sum, all) =
        known.iter().fold((0.0, 0.0), |(sum, all), (estimate, weight)| (sum + weight * estimate, all + weight));
    let q = known.iter().map(|(estimate, weight)| weight * (estimate - sum / all).powi(2)).sum::<f64>();
    let dof = known.len().checked_sub(1).filter(|dof| *dof > 0)?;
    let p = ChiSquared::new(dof as f64).map_or(1.0, |distribution| distribution.sf(q));
    Some(Stability { q, dof, p })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_that_agree_are_one_constant_and_others_are_not() {
        let alike = stability(&[1.0, 1.1, 0.9, 1.05], &[100.0; 4], 1.0).unwrap();
        assert!(alike.p > 0.3 && alike.dof == 3, "{alike:?}");
        let apart = stability(&[1.0, 3.0, -1.0, 5.0], &[100.0; 4], 1.0).unwrap();
        assert!(apart.p < 1e-6, "{apart:?}");
        // The same scatter is what noise does where it is so much larger.
        assert!(stability(&[1.0, 3.0, -1.0, 5.0], &[100.0; 4], 1000.0).unwrap().p > 0.3);
        assert_eq!(stability(&[1.0], &[1.0], 1.0), None);
    }
}
