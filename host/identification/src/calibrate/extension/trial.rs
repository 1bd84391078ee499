//! The end of a search on a bench: a model's laws, what they cost, and what the next search needs.

use std::sync::Arc;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::warm_start::Known;
use crate::calibrate::residuals::point::Point;
use crate::calibrate::residuals::problem::Problem;
use crate::model::Layout;
use crate::model::law::Law;
use solve::border::Border;

/// A value with its standard error under the frozen noise.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialValue {
    /// As in results.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Estimate.
    pub estimate: f64,
    /// `None` where the search holds it or nothing shows it.
    pub std_error: Option<f64>,
    /// How much what else is unknown takes of its information: 1 is nothing.
    pub vif: f64,
}

/// The end of a search on a [`Bench`](super::bench::Bench).
#[derive(Debug, Clone)]
pub struct Trial {
    /// What extends the base model.
    pub laws: Vec<Arc<dyn Law>>,
    /// ½ Σ r², weighted.
    pub cost: f64,
    /// What all rows of each block of the bench were multiplied by; empty where that is one.
    pub block_weights: Vec<f64>,
    /// Every parameter of the dynamics, the laws' behind the base model's.
    pub values: Vec<TrialValue>,
    pub(crate) rotations: Vec<Matrix3<f64>>,
    pub(crate) biases: Vec<Vec<Vector3<f64>>>,
    pub(crate) states: Vec<f64>,
    pub(crate) layout: Layout,
}

impl Trial {
    /// The value of this name.
    pub fn value(&self, name: &str) -> Option<&TrialValue> {
        self.values.iter().find(|value| value.name == name)
    }

    /// Position and speed of link and motor of a joint at stage k.
    pub fn joint(&self, k: usize, joint: usize) -> JointState {
        let (x, layout) = (&self.states[k * self.layout.size()..][..self.layout.size()], &self.layout);
        let (q, qd) = (x[layout.q(joint)], x[layout.qd(joint)]);
        let elastic = layout.is_elastic(joint);
        let (theta, thetad) = if elastic { (x[layout.theta(joint)], x[layout.thetad(joint)]) } else { (q, qd) };
        JointState { q, qd, theta, thetad }
    }

    /// Rotations of all gyros, body axes → sensor axes, and their biases in the first recording, rad/s.
    pub fn gyros(&self) -> (&[Matrix3<f64>], &[Vector3<f64>]) {
        (&self.rotations, self.biases.first().map_or(&[], Vec::as_slice))
    }

    /// Whether a joint has a spring between motor and link.
    pub fn is_elastic(&self, joint: usize) -> bool {
        self.layout.is_elastic(joint)
    }

    pub(crate) fn known(&self) -> Known<'_> {
        Known {
            value: Box::new(|name| self.value(name).map(|value| value.estimate)),
            rotations: self.rotations.clone(),
            biases: self.biases.clone(),
            states: &self.states,
            layout: &self.layout,
            laws: &self.laws,
            block_weights: &self.block_weights,
        }
    }
}

/// A joint at one instant, rad or m and per second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Link position.
    pub q: f64,
    /// Link speed.
    pub qd: f64,
    /// Motor position.
    pub theta: f64,
    /// Motor speed.
    pub thetad: f64,
}

/// A product of variance and information, at least one where there is any, that is rounding.
const ROUNDING: f64 = 1e-9;

/// The results of the dynamics with their errors.
pub(crate) fn values(
    problem: &Problem<'_>,
    point: &Point<'_>,
    border: &Border,
    information: &[f64],
) -> Vec<TrialValue> {
    let coordinates = problem.model.coordinates();
    let covariance = border.covariance();
    let size = problem.border().size();
    coordinates
        .names()
        .enumerate()
        .map(|(i, (name, unit))| {
            let (estimate, slopes) = coordinates.physical_and_slopes(&point.z, i);
            let variance = |covariance: &DMatrix<f64>| {
                let sum = slopes.iter().flat_map(|(a, by_a)| slopes.iter().map(move |(b, by_b)| (a, b, by_a * by_b)));
                sum.map(|(a, b, by)| by * covariance[(*a, *b)]).sum::<f64>()
            };
            let inflation = |(a, _): &(usize, f64)| {
                covariance.as_ref().map_or(f64::NAN, |c| c[(*a, *a)] * information[a * size + a])
            };
            let vif = slopes.iter().map(inflation).fold(f64::NAN, f64::max);
            // A direction without any information keeps a variance of rounding.
            let is_shown = vif > ROUNDING;
            let std_error = covariance.as_ref().map(|c| variance(c).sqrt());
            let std_error = std_error.filter(|e| e.is_finite() && *e > 0.0 && is_shown);
            TrialValue { name: name.to_string(), unit, estimate, std_error, vif }
        })
        .collect()
}
