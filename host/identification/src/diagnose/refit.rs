//! Refits: the best laws of a scan, fitted in full on top of the current model, and what they gain out of sample.

use std::sync::Arc;

use super::axes::is_of;
use super::catalogue::{Named, laws};
use super::criteria::{BLOCKS, ENOUGH_OF_SAVED, SCAN_SAMPLES, STATES};
use super::scores::block_scores::left_out;
use super::scores::cross_validation::log_gain;
use crate::calibrate::{Bench, BlockFit, CalibrateError, SavingEffort, Trial, Trimmed};
use crate::model::law::Law;

/// Iterations of a law, of one of an event, and of a model that lost one.
const ITERATIONS: usize = 30;
const EVENT_ITERATIONS: usize = 40;
const DROP_ITERATIONS: usize = 10;

/// A search that gives up above this cost.
fn saving(above: f64) -> SavingEffort {
    SavingEffort { iterations: ITERATIONS, above, enough: ENOUGH_OF_SAVED }
}

/// A model on the bench with what its blocks cost by the others.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// The end of its search.
    pub trial: Trial,
    /// Of each block: Σ r², without its weight, with the parameters that the other blocks show.
    pub left_out: Vec<f64>,
    /// Of each block: the same with the parameters of all.
    pub own: Vec<f64>,
    /// Of each block: rows less states.
    pub freedom: Vec<f64>,
    /// Of each block: ln |H_xx|, the Laplace term of the likelihood with states integrated out.
    pub log_determinants: Vec<f64>,
    /// What the blocks say of its shared unknowns.
    pub fit: BlockFit,
}

impl Fitted {
    /// A trial on `bench`.
    ///
    /// # Errors
    /// One that cannot be factorised, or whose blocks determine nothing.
    pub fn of(bench: &Bench<'_>, contiguous: &[bool], trial: Trial) -> Result<Self, CalibrateError> {
        let fit = bench.block_fit(&trial)?;
        let left_out = left_out(&fit, contiguous).ok_or(CalibrateError::Undetermined)?;
        let unweighted = |squares: f64, weight: &f64| squares / (weight * weight);
        Ok(Fitted {
            left_out: left_out.into_iter().zip(&fit.weights).map(|(squares, w)| unweighted(squares, w)).collect(),
            own: fit.blocks.iter().zip(&fit.weights).map(|(block, w)| unweighted(block.squares, w)).collect(),
            freedom: fit.freedom.clone(),
            log_determinants: fit.log_determinants.clone(),
            trial,
            fit,
        })
    }

    /// What this model gains over `other` in each block out of sample: see [`log_gain`], and the Laplace terms.
    pub fn gains_over(&self, other: &Fitted) -> Vec<f64> {
        self.gains((&other.left_out, &self.left_out), other)
    }

    /// Weighted Σ r² that this model saves over `other` in each block out of sample: what rivals are compared by, since how well they explain the same is a matter of its size.
    pub fn squares_saved_over(&self, other: &Fitted) -> Vec<f64> {
        let saved = other.left_out.iter().zip(&self.left_out).map(|(before, after)| before - after);
        saved.zip(&self.fit.weights).map(|(saved, weight)| saved * weight * weight).collect()
    }

    /// Of each block, the weight that makes the mean square of its rows one, where they are wrong by more than their noise.
    fn block_weights(&self) -> Vec<f64> {
        let dispersion = self.own.iter().zip(&self.freedom).map(|(squares, freedom)| squares / freedom.max(1.0));
        dispersion.map(|dispersion| dispersion.max(1.0).sqrt().recip()).collect()
    }

    /// The same with the parameters of all blocks.
    pub fn own_gains_over(&self, other: &Fitted) -> Vec<f64> {
        self.gains((&other.own, &self.own), other)
    }

    /// The same model whose blocks are predicted no better in all than with its own parameters: a step that was not made is no gain.
    fn no_better_than_own(mut self, other: &Fitted) -> Self {
        let sum = |gains: Vec<f64>| gains.iter().sum::<f64>();
        if sum(self.gains_over(other)) > sum(self.own_gains_over(other)) {
            self.left_out = self.left_out.iter().zip(&self.own).map(|(left_out, own)| left_out.max(*own)).collect();
        }
        self
    }

    fn gains(&self, (before, after): (&[f64], &[f64]), other: &Fitted) -> Vec<f64> {
        let of_block = |b: usize| {
            log_gain(before[b], after[b], other.freedom[b]) + other.log_determinants[b] - self.log_determinants[b]
        };
        (0..after.len()).map(of_block).collect()
    }
}

/// As many samples as cost what `of_doggy` samples of a robot with [`STATES`] states do.
pub fn samples_for(states: usize, of_doggy: usize) -> usize {
    match states {
        0..=STATES => (of_doggy * STATES / states.max(1)).min(of_doggy * 2),
        _ => of_doggy * STATES * STATES / (states * states),
    }
}

/// On top of what laws are refitted, and where.
pub struct Refit<'a> {
    /// The samples.
    pub bench: Bench<'a>,
    /// Of every block but the last, whether the next one follows on it.
    pub contiguous: Vec<bool>,
    /// The base model beside events, where the recording shows some.
    pub trimmed: Option<Trimmed>,
}

impl Refit<'_> {
    /// How many samples suit a robot with so many states.
    pub fn samples(&self, of_doggy: usize) -> usize {
        samples_for(self.bench.states(), of_doggy)
    }

    /// The bench of a scan and the model there, and how many samples of the whole bench each of its samples stands for.
    pub fn thinned(&self, trial: &Trial) -> (Bench<'_>, Trial, f64) {
        let (bench, trial) = self.bench.thinned(trial, self.samples(SCAN_SAMPLES) / BLOCKS);
        let more = self.bench.series().stages() as f64 / bench.series().stages().max(1) as f64;
        (bench, trial, more)
    }

    /// The same model with every block weighted by what it leaves there, so that what is estimated is what gains are measured by: the largest of Σ n ln(1 / cost) over
    /// blocks, each with a scale of noise of its own. As it was where no search ends in numbers.
    pub fn reweighted(&self, fitted: Fitted) -> Fitted {
        let weighted = self.bench.fit_weighted(&fitted.trial, &fitted.block_weights(), ITERATIONS);
        let measured = weighted.and_then(|trial| Fitted::of(&self.bench, &self.contiguous, trial));
        match measured {
            Ok(weighted) if weighted.left_out.iter().all(|cost| cost.is_finite()) => {
                let gain: f64 = weighted.own_gains_over(&fitted).iter().sum();
                tracing::debug!(gain, "blocks weighted");
                weighted
            }
            Ok(_) => fitted,
            Err(error) => {
                tracing::debug!(%error, "blocks keep their weights");
                fitted
            }
        }
    }

    /// The same model with all samples at their own weight, as the calibration is that users take.
    pub fn unweighted(&self, fitted: &Fitted) -> Trial {
        let trial = self.bench.fit_weighted(&fitted.trial, &[], ITERATIONS);
        trial.unwrap_or_else(|error| {
            tracing::debug!(%error, "blocks keep their weights");
            fitted.trial.clone()
        })
    }

    /// The model of `current`, which has `accepted`, with one more law: searched from the law's start, and again in its other shape where it has one. The one that predicts other
    /// blocks better; none where no search ends in numbers. One that comes to more than a cost of `above` is given up.
    pub fn with(&self, accepted: &[Named], current: &Fitted, named: &Named, above: f64) -> Option<(Named, Fitted)> {
        let effort = saving(above);
        let first =
            self.tried(accepted, current, (named, above), |laws| self.bench.fit_on_top(laws, &current.trial, effort));
        if first.as_ref().is_some_and(|(_, fitted)| fitted.trial.cost > above) {
            return first;
        }
        let from = first.as_ref().map_or(&current.trial, |(_, fitted)| &fitted.trial);
        let other = named.law.other_shape().filter(|_| !named.law.is_event()).map(|law| Named { law, ..named.clone() });
        let other = other.and_then(|named| {
            self.tried(accepted, current, (&named, above), |laws| {
                self.bench.fit_from(laws, (from, from), saving(from.cost))
            })
        });
        let gain = |(_, fitted): &(Named, Fitted)| fitted.gains_over(current).iter().sum::<f64>();
        first.into_iter().chain(other).max_by(|a, b| gain(a).total_cmp(&gain(b)))
    }

    /// A model with these laws, those of `current` and more, searched from there; none where no search ends in numbers.
    pub fn with_laws(&self, laws: &[Arc<dyn Law>], current: &Fitted) -> Option<Fitted> {
        let trial = self.bench.fit_on_top(laws, &current.trial, saving(current.trial.cost));
        let fitted = trial.and_then(|trial| Fitted::of(&self.bench, &self.contiguous, trial));
        let fitted = fitted.inspect_err(|error| tracing::debug!(%error, "a refit failed")).ok()?;
        let is_finite = fitted.left_out.iter().all(|cost| cost.is_finite());
        is_finite.then(|| fitted.no_better_than_own(current))
    }

    /// The same of an event, from what the greater part of the recording shows.
    pub fn with_event(&self, accepted: &[Named], current: &Fitted, named: &Named) -> Option<(Named, Fitted)> {
        let trimmed = self.trimmed.as_ref()?;
        self.tried(accepted, current, (named, f64::INFINITY), |laws| {
            self.bench.fit_trimmed(laws, (trimmed, &current.trial), EVENT_ITERATIONS)
        })
    }

    /// The model of `current` with these laws only.
    ///
    /// # Errors
    /// As a calibration's.
    pub fn of(&self, named: &[&Named], current: &Fitted) -> Result<Fitted, CalibrateError> {
        let trial = self.bench.fit(&laws(named.iter().copied()), &current.trial, DROP_ITERATIONS)?;
        Fitted::of(&self.bench, &self.contiguous, trial)
    }

    fn tried(
        &self,
        accepted: &[Named],
        current: &Fitted,
        (named, above): (&Named, f64),
        search: impl Fn(&[Arc<dyn Law>]) -> Result<Trial, CalibrateError>,
    ) -> Option<(Named, Fitted)> {
        let with = laws(accepted.iter().chain([named]));
        let sum = |gains: Vec<f64>| gains.iter().sum::<f64>();
        let measured = |trial: Trial| Fitted::of(&self.bench, &self.contiguous, trial);
        let mut fitted = search(&with).and_then(measured);
        // Blocks promise more than all of them together have: the search has not ended yet, unless it was given up.
        if let Ok(first) = &fitted
            && first.trial.cost <= above
            && sum(first.gains_over(current)) > (1.0 + ENOUGH_OF_SAVED) * sum(first.own_gains_over(current)).max(0.0)
        {
            let again = self.bench.fit_on_top(&with, &first.trial, saving(above)).and_then(measured);
            let gain = |fitted: &Fitted| sum(fitted.gains_over(current));
            fitted = again.map(|again| if gain(&again) > gain(first) { again } else { first.clone() });
        }
        let fitted = fitted.map(|fitted| fitted.no_better_than_own(current));
        match fitted {
            Ok(fitted) if fitted.left_out.iter().all(|cost| cost.is_finite()) => {
                let gain: f64 = fitted.gains_over(current).iter().sum();
                let own: f64 = fitted.own_gains_over(current).iter().sum();
                let of_law = fitted.trial.values.iter().filter(|value| is_of(named.effect, &value.name));
                let values: Vec<f64> = of_law.map(|value| value.estimate).collect();
                tracing::debug!(effect = named.effect.id, gain, own, ?values, "refit");
                Some((named.clone(), fitted))
            }
            Ok(_) => None,
            Err(error) => {
                tracing::debug!(effect = named.effect.id, %error, "a refit failed");
                None
            }
        }
    }
}
