//! When a model fits its samples worst: where something happened that it does not know of.

use super::bench::Bench;
use super::trial::Trial;
use crate::calibrate::error::CalibrateError;
use crate::model::Model;
use solve::LeastSquares;

/// Samples on either side that count with one: a transmission answers to a blow for so long.
const AROUND: usize = 5;
/// The next worst time is at least so many samples from the one before.
const APART: usize = 50;

impl Bench<'_> {
    /// The times, s after the start of the motion, around which the rows of `trial` are worst, `count` at most and the worst first.
    ///
    /// # Errors
    /// A model that cannot be built.
    pub fn worst_times(&self, trial: &Trial, count: usize) -> Result<Vec<f64>, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let (problem, point, _) = self.at(&model, &trial.known());
        let mut scratch = problem.scratch();
        let costs: Vec<f64> =
            (0..self.series().stages()).map(|k| problem.cost(&point, k..k + 1, &mut scratch)).collect();
        Ok(worst(&costs, count).into_iter().map(|k| self.series().time_s(k)).collect())
    }
}

/// The samples around which the sum is largest, the largest first.
fn worst(costs: &[f64], count: usize) -> Vec<usize> {
    let around = |k: usize| costs[k.saturating_sub(AROUND)..(k + AROUND + 1).min(costs.len())].iter().sum::<f64>();
    let sums: Vec<f64> = (0..costs.len()).map(around).collect();
    let mut by_sum: Vec<usize> = (0..costs.len()).collect();
    by_sum.sort_by(|a, b| sums[*b].total_cmp(&sums[*a]));
    let mut found: Vec<usize> = Vec::new();
    for k in by_sum {
        if found.len() == count {
            break;
        }
        if found.iter().all(|other| other.abs_diff(k) >= APART) {
            found.push(k);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_samples_are_apart_and_the_worst_comes_first() {
        let mut costs = vec![1.0; 1000];
        for (k, cost) in [(300, 40.0), (310, 30.0), (700, 90.0), (0, 20.0), (999, 10.0)] {
            costs[k] = cost;
        }
        let found = worst(&costs, 3);
        let near = |k: usize, at: usize| k.abs_diff(at) <= AROUND;
        assert!(near(found[0], 700) && near(found[1], 305) && near(found[2], 0), "{found:?}");
        assert_eq!(worst(&costs[..3], 5).len(), 1);
        assert!(worst(&[], 5).is_empty());
    }
}
