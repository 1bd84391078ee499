//! How surprising a score is, and a whole catalogue of scores.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Share of noise that gives a score (twice a log-likelihood ratio) at least this large with so many free parameters.
pub fn p_of_score(score: f64, freedom: usize) -> f64 {
    match ChiSquared::new(freedom.max(1) as f64) {
        Ok(distribution) if score > 0.0 => distribution.sf(score),
        _ => 1.0,
    }
}

/// Share of noise in which the least of so many p-values is at most `p` (Šidák: exact for independent tests, and too careful for others).
pub fn p_of_family(p: f64, tests: f64) -> f64 {
    -(tests * (-p).ln_1p()).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_tables() {
        // 3.841 and 6.635 are the 95 % and 99 % points of χ² with one degree of freedom, 7.815 the 95 % point with three.
        for (score, freedom, p) in [(3.841_458_8, 1, 0.05), (6.634_896_6, 1, 0.01), (7.814_727_9, 3, 0.05)] {
            assert!((p_of_score(score, freedom) - p).abs() < 1e-8, "{score}");
        }
        assert_eq!(p_of_score(-1.0, 2), 1.0);
        assert!(p_of_score(1000.0, 3) < 1e-200, "far tails do not end at zero");
    }

    #[test]
    fn the_family_is_as_strict_as_its_number() {
        assert!((p_of_family(0.01, 1.0) - 0.01).abs() < 1e-15);
        assert!((p_of_family(1e-4, 60.0) - 0.005_982).abs() < 1e-6);
        assert!((p_of_family(1e-30, 60.0) - 6e-29).abs() < 1e-35);
    }
}
