//! Is a filter's own idea of its errors true?

use std::collections::HashMap;

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Normalised squares against the χ² distribution that they have if the filter is right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Consistency {
    /// Ticks that were counted.
    pub ticks: usize,
    /// Their degrees of freedom together.
    pub dof: usize,
    /// Sum of the squares over `dof`: 1 if the filter is right, above it if it trusts itself too much.
    pub mean_per_dof: f64,
    /// Share of ticks within the central 95 % of χ²; 0.95 if the filter is right.
    pub within_95: f64,
}

/// The sums behind it.
#[derive(Debug, Default)]
pub(super) struct Counter {
    ticks: usize,
    dof: usize,
    sum: f64,
    within: usize,
    /// Central 95 % by degrees of freedom.
    bands: HashMap<usize, [f64; 2]>,
}

impl Counter {
    /// Takes in the square of a tick.
    pub(super) fn add(&mut self, square: f64, dof: usize) {
        if dof == 0 {
            return;
        }
        let [low, high] = *self.bands.entry(dof).or_insert_with(|| band(dof));
        self.ticks += 1;
        self.dof += dof;
        self.sum += square;
        self.within += usize::from((low..=high).contains(&square));
    }

    /// None where nothing was counted.
    pub(super) fn result(&self) -> Option<Consistency> {
        (self.ticks > 0).then(|| Consistency {
            ticks: self.ticks,
            dof: self.dof,
            mean_per_dof: self.sum / self.dof as f64,
            within_95: self.within as f64 / self.ticks as f64,
        })
    }
}

fn band(dof: usize) -> [f64; 2] {
    // Degrees of freedom are positive, so that there is a distribution.
    ChiSquared::new(dof as f64).map_or([0.0, f64::INFINITY], |chi2| [0.025, 0.975].map(|share| chi2.inverse_cdf(share)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_those_of_the_tables() {
        for (dof, low, high) in [(1, 0.000_982, 5.024), (9, 2.700, 19.023), (12, 4.404, 23.337)] {
            let found = band(dof);
            assert!((found[0] - low).abs() < 5e-4 && (found[1] - high).abs() < 5e-4, "{dof}: {found:?}");
        }
        let mut counter = Counter::default();
        assert_eq!(counter.result(), None);
        counter.add(5.0, 0);
        counter.add(9.0, 9);
        counter.add(27.0, 9);
        let result = counter.result().unwrap();
        assert_eq!((result.ticks, result.dof, result.mean_per_dof, result.within_95), (2, 18, 2.0, 0.5));
    }
}
