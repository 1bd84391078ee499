//! Bands in which counts and sums of squares lie if the intervals tell the truth.

use std::ops::RangeInclusive;

use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF};

/// Counts of n trials of probability p that leave at most (1 − level)/2 beyond either end.
///
/// # Panics
/// If p is not a probability.
pub fn binomial_band(n: u64, p: f64, level: f64) -> RangeInclusive<u64> {
    let beyond = 0.5 * (1.0 - level);
    let binomial = Binomial::new(p, n).expect("p is a probability");
    let low = (0..=n).find(|&k| binomial.cdf(k) > beyond).unwrap_or(n);
    // P(more than k) ≤ beyond
    let high = (0..=n).find(|&k| binomial.sf(k) <= beyond).unwrap_or(n);
    low..=high
}

/// The value that χ² with so many degrees of freedom stays below with this probability.
///
/// # Panics
/// If there is no degree of freedom.
pub fn chi_square_quantile(dof: f64, probability: f64) -> f64 {
    ChiSquared::new(dof).expect("some degrees of freedom").inverse_cdf(probability)
}

/// Where χ² lies with probability `level`, as much beyond either end.
pub fn chi_square_band(dof: f64, level: f64) -> RangeInclusive<f64> {
    let beyond = 0.5 * (1.0 - level);
    chi_square_quantile(dof, beyond)..=chi_square_quantile(dof, 1.0 - beyond)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against tables: binom(20, 0.95) has 0.03 % below 15 and 0.26 % below 16, binom(200, 0.95)
    /// 0.04 % above 198 and 0.4 % above 197; χ² of 12 has 5 % above 21.026.
    #[test]
    fn bands_are_those_of_the_tables() {
        assert_eq!(binomial_band(20, 0.95, 0.999), 15..=20);
        assert_eq!(binomial_band(200, 0.95, 0.999), 179..=198);
        assert!((chi_square_quantile(12.0, 0.95) - 21.026).abs() < 1e-3);
        let band = chi_square_band(240.0, 0.999);
        // Wilson and Hilferty's approximation, good to 0.05 here, says 174.35 and 318.75.
        assert!((band.start() - 174.35).abs() < 0.1 && (band.end() - 318.75).abs() < 0.1, "{band:?}");
    }
}
