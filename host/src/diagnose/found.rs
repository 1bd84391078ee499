//! What a search handles: laws that were scanned and refitted, curves, accepted causes, and all of them together.

use std::sync::Arc;

use super::curves::Curves;
use crate::calibrate::{Bench, CalibrateError, Trial};
use crate::effect::{CATALOGUE, Effect};
use crate::model::law::Law;

/// Share of noise in which anything is found at all.
pub const LEVEL: f64 = 0.01;
/// Iterations of a model that has lost one of its laws, or has another one in its place.
pub const DROP_ITERATIONS: usize = 8;
/// Iterations of a model that stays.
pub const FINAL_ITERATIONS: usize = 25;

/// An effect with one of its laws.
#[derive(Debug, Clone)]
pub struct Named {
    /// Which.
    pub effect: &'static Effect,
    /// Its law.
    pub law: Arc<dyn Law>,
}

/// One law of the catalogue on top of the current model.
#[derive(Debug, Clone)]
pub struct Scanned {
    /// Which.
    pub named: Named,
    /// Its fit on the samples that decide, if it came so far.
    pub trial: Option<Trial>,
    /// Its fit on few samples.
    pub on_few: Option<Trial>,
    /// Its last fit, where no robot can have it.
    pub bent: Option<Trial>,
    /// Twice the log-likelihood gained.
    pub score: f64,
    /// Parameters that the motion shows.
    pub freedom: usize,
    /// Share of noise that would bring any candidate this far.
    pub p_family: f64,
    /// See [`axes`](super::axes::axes).
    pub axes: Vec<usize>,
    /// Of its parameters, the largest.
    pub vif: Option<f64>,
}

/// Curves on top of the current model.
#[derive(Debug, Clone)]
pub struct CurveFit {
    /// Which.
    pub curves: Curves,
    /// Their fit.
    pub trial: Trial,
    /// Twice the log-likelihood gained, less two for every coefficient.
    pub score: f64,
    /// Share of noise that would bring any of the curves this far.
    pub p_family: f64,
}

/// An accepted cause.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// Which.
    pub named: Named,
    /// Twice the log-likelihood gained when it came in.
    pub score: f64,
    /// See [`Scanned::p_family`].
    pub p_family: f64,
    /// See [`Scanned::freedom`].
    pub freedom: usize,
    /// What was refitted in its place.
    pub rivals: Vec<Rival>,
}

/// A law that was tried in the place of an accepted one.
#[derive(Debug, Clone)]
pub struct Rival {
    /// Which.
    pub named: Named,
    /// See [`Scanned::freedom`].
    pub freedom: usize,
    /// Twice the log-likelihood gained.
    pub score: f64,
    /// See [`axes`](super::axes::axes).
    pub axes: Vec<usize>,
    /// Whether this motion cannot tell it from the accepted one.
    pub is_alias: bool,
}

/// What a search found.
#[derive(Debug, Clone)]
pub struct Search {
    /// In the order in which they were accepted.
    pub accepted: Vec<Accepted>,
    /// The model with all of them.
    pub trial: Trial,
    /// The scan of the base model.
    pub first_scan: Vec<Scanned>,
    /// The best curves on top of the base model.
    pub first_curves: Vec<CurveFit>,
    /// What curves still find on top of the final model, best first.
    pub left: Vec<CurveFit>,
    /// The best law that did not hold its own against a curve, where the search ended for that, or that no robot can have.
    pub refused: Option<Scanned>,
}

/// Laws in the catalogue's order: a plant's line asks them so.
pub fn laws<'a>(named: impl Iterator<Item = &'a Named>) -> Vec<Arc<dyn Law>> {
    let place = |effect: &Effect| CATALOGUE.iter().position(|other| other.id == effect.id);
    let mut sorted: Vec<&Named> = named.collect();
    sorted.sort_by_key(|named| place(named.effect));
    sorted.into_iter().map(|named| named.law.clone()).collect()
}

impl Search {
    /// Nothing found yet beyond the model of `trial`.
    pub fn at(trial: &Trial) -> Self {
        Search {
            accepted: Vec::new(),
            trial: trial.clone(),
            first_scan: Vec::new(),
            first_curves: Vec::new(),
            left: Vec::new(),
            refused: None,
        }
    }

    /// All accepted laws, in the catalogue's order.
    pub fn laws(&self) -> Vec<Arc<dyn Law>> {
        laws(self.accepted.iter().map(|accepted| &accepted.named))
    }

    /// The accepted cause of this law of [`Search::trial`].
    pub fn cause_of(&self, law: usize) -> &'static Effect {
        let of_law = |accepted: &&Accepted| Arc::ptr_eq(&accepted.named.law, &self.trial.laws[law]);
        self.accepted.iter().find(of_law).unwrap_or(&self.accepted[self.accepted.len() - 1]).named.effect
    }

    /// The model without one of the accepted, and what is lost: twice the log-likelihood.
    ///
    /// # Errors
    /// As a calibration's.
    pub fn without(&self, bench: &Bench<'_>, place: usize) -> Result<(Trial, f64), CalibrateError> {
        let others = self.accepted.iter().enumerate().filter(|(other, _)| *other != place);
        let trial = bench.fit(&laws(others.map(|(_, accepted)| &accepted.named)), &self.trial, DROP_ITERATIONS)?;
        let lost = 2.0 * (trial.cost - self.trial.cost);
        Ok((trial, lost))
    }
}
