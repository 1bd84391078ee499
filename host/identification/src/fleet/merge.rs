//! Weighted means with their test: do the members agree within their errors?
//!
//! Generalised least squares over the members' covariances C_i, each of the parameters that member i has:
//!
//! ```text
//! Λ = Σ C_i⁻¹     m = Λ⁻¹ Σ C_i⁻¹ x_i     χ² = Σ (x_i − m)ᵀ C_i⁻¹ (x_i − m)   on Σ n_i − n degrees of freedom
//! ```
//!
//! Where the members disagree, their spread τ is estimated for each parameter by itself (DerSimonian and Laird, 1986), and
//! the mean over a population of such members has weights 1/(σ² + τ²).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::calibrate::Calibration;

/// Two-sided 95 % of the normal distribution.
const NORMAL_95: f64 = 1.959_963_984_540_054;
/// Members whose disagreement chance brings about less often than this do not share their parameters.
const DISAGREE: f64 = 0.01;

/// Parameters with their covariance.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimates {
    /// Names.
    pub names: Vec<String>,
    /// Units.
    pub units: Vec<String>,
    /// Estimates.
    pub values: Vec<f64>,
    /// Covariance, by rows.
    pub covariance: Vec<Vec<f64>>,
}

/// Members merged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Merged {
    /// Members.
    pub count: usize,
    /// Σ (x − m)ᵀ C⁻¹ (x − m) over all parameters together.
    pub chi2: f64,
    /// Its degrees of freedom; 0 for a single member.
    pub dof: usize,
    /// How often chance gives such a χ² or a larger one. Null for a single member.
    pub p_value: Option<f64>,
    /// Whether the members agree within their errors (p at least 0.01): whether they may be one robot.
    pub consistent: bool,
    /// Every parameter that a member has.
    pub parameters: Vec<MergedParameter>,
    /// Covariance of the `mean`s, by rows.
    pub covariance: Vec<Vec<f64>>,
}

/// One parameter over the members.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MergedParameter {
    /// Name, as `k_s[2]`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Members that have it.
    pub count: usize,
    /// Mean, if all members have one and the same value.
    pub mean: f64,
    /// Its standard error.
    pub std_error: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// Σ ((x − m)/σ)² of this parameter by itself.
    pub chi2: f64,
    /// How often chance gives such a χ² or a larger one; null for a single member.
    pub p_value: Option<f64>,
    /// Standard deviation from member to member beyond what their errors explain; 0 where they agree.
    pub spread: f64,
    /// Mean over members that differ by that spread.
    pub population_mean: f64,
    /// Its standard error.
    pub population_error: f64,
}

impl Estimates {
    /// The identifiable parameters of a calibration that its recordings share. Without a covariance, errors are taken as
    /// independent.
    pub fn of(calibration: &Calibration) -> Self {
        let mut estimates = Self::default();
        let known = &calibration.covariance.parameters;
        let whole = calibration.covariance.matrix.len() == known.len();
        let mut places = Vec::new();
        let mut errors = Vec::new();
        for parameter in &calibration.parameters {
            let Some(error) = parameter.std_error.filter(|error| error.is_finite() && *error > 0.0) else { continue };
            if !parameter.identifiable || parameter.name.starts_with("bias") {
                continue;
            }
            estimates.names.push(parameter.name.clone());
            estimates.units.push(parameter.unit.clone());
            estimates.values.push(parameter.estimate);
            places.push(known.iter().position(|name| *name == parameter.name).filter(|_| whole));
            errors.push(error);
        }
        let element = |i: usize, j: usize| match (places[i], places[j]) {
            (Some(a), Some(b)) => calibration.covariance.matrix[a][b],
            _ if i == j => errors[i] * errors[i],
            _ => 0.0,
        };
        let n = places.len();
        estimates.covariance = (0..n).map(|i| (0..n).map(|j| element(i, j)).collect()).collect();
        estimates
    }

    /// C⁻¹. Units differ by many powers of ten, so it is inverted in standard errors; a covariance that is none counts by
    /// its diagonal.
    fn information(&self) -> DMatrix<f64> {
        let n = self.values.len();
        let sigma = DVector::from_fn(n, |i, _| self.covariance[i][i].sqrt());
        let correlation = DMatrix::from_fn(n, n, |i, j| self.covariance[i][j] / (sigma[i] * sigma[j]));
        let inverse = correlation.cholesky().map_or_else(|| DMatrix::identity(n, n), |factor| factor.inverse());
        DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (sigma[i] * sigma[j]))
    }
}

impl Merged {
    /// Merges at least one member.
    pub fn of(members: &[&Estimates]) -> Self {
        let mut names: Vec<(&str, &str)> = Vec::new();
        for member in members {
            for (name, unit) in member.names.iter().zip(&member.units) {
                if !names.iter().any(|(known, _)| known == name) {
                    names.push((name, unit));
                }
            }
        }
        let n = names.len();
        let place = |name: &str| names.iter().position(|(known, _)| *known == name);
        let places: Vec<Vec<usize>> =
            members.iter().map(|member| member.names.iter().filter_map(|name| place(name)).collect()).collect();
        let information: Vec<DMatrix<f64>> = members.iter().map(|member| member.information()).collect();
        let mut all = DMatrix::<f64>::zeros(n, n);
        let mut weighted = DVector::<f64>::zeros(n);
        for ((member, places), information) in members.iter().zip(&places).zip(&information) {
            for (i, &a) in places.iter().enumerate() {
                for (j, &b) in places.iter().enumerate() {
                    all[(a, b)] += information[(i, j)];
                    weighted[a] += information[(i, j)] * member.values[j];
                }
            }
        }
        let covariance = inverse(&all);
        let mean = &covariance * weighted;
        let mut chi2 = 0.0;
        for ((member, places), information) in members.iter().zip(&places).zip(&information) {
            let off = DVector::from_fn(places.len(), |i, _| member.values[i] - mean[places[i]]);
            chi2 += off.dot(&(information * &off));
        }
        let dof = places.iter().map(Vec::len).sum::<usize>() - n;
        let p_value = tail(chi2, dof);
        let parameters = names.iter().enumerate().map(|(i, (name, unit))| {
            let own: Vec<(f64, f64)> = members
                .iter()
                .filter_map(|member| {
                    let k = member.names.iter().position(|own| own == name)?;
                    Some((member.values[k], member.covariance[k][k]))
                })
                .collect();
            let alone = Alone::of(&own);
            let std_error = covariance[(i, i)].sqrt();
            MergedParameter {
                name: (*name).to_owned(),
                unit: (*unit).to_owned(),
                count: own.len(),
                mean: mean[i],
                std_error,
                ci95: [mean[i] - NORMAL_95 * std_error, mean[i] + NORMAL_95 * std_error],
                chi2: alone.chi2,
                p_value: tail(alone.chi2, own.len() - 1),
                spread: alone.spread,
                population_mean: alone.mean,
                population_error: alone.error,
            }
        });
        Self {
            count: members.len(),
            chi2,
            dof,
            p_value,
            consistent: p_value.is_none_or(|p| p >= DISAGREE),
            parameters: parameters.collect(),
            covariance: (0..n).map(|i| (0..n).map(|j| covariance[(i, j)]).collect()).collect(),
        }
    }

    /// The means with their covariance, to be merged again: of members that disagree, those over a population.
    pub fn estimates(&self) -> Estimates {
        let n = self.parameters.len();
        let of = |value: &dyn Fn(&MergedParameter) -> f64| self.parameters.iter().map(value).collect::<Vec<f64>>();
        let (values, covariance) = match self.consistent {
            true => (of(&|p| p.mean), self.covariance.clone()),
            false => {
                let errors = of(&|p| p.population_error);
                let element = |i: usize, j: usize| if i == j { errors[i] * errors[i] } else { 0.0 };
                (of(&|p| p.population_mean), (0..n).map(|i| (0..n).map(|j| element(i, j)).collect()).collect())
            }
        };
        Estimates {
            names: self.parameters.iter().map(|p| p.name.clone()).collect(),
            units: self.parameters.iter().map(|p| p.unit.clone()).collect(),
            values,
            covariance,
        }
    }
}

impl MergedParameter {
    /// The number to use: the common mean of members that agree, else the mean over the population.
    pub fn best(&self, consistent: bool) -> (f64, f64) {
        if consistent { (self.mean, self.std_error) } else { (self.population_mean, self.population_error) }
    }
}

/// One parameter, its members' other parameters aside.
struct Alone {
    chi2: f64,
    spread: f64,
    mean: f64,
    error: f64,
}

impl Alone {
    /// From values and variances.
    fn of(own: &[(f64, f64)]) -> Self {
        let mean_with = |spread2: f64| {
            let sum: f64 = own.iter().map(|(_, variance)| 1.0 / (variance + spread2)).sum();
            (own.iter().map(|(value, variance)| value / (variance + spread2)).sum::<f64>() / sum, sum)
        };
        let (mean, weights) = mean_with(0.0);
        let chi2: f64 = own.iter().map(|(value, variance)| (value - mean).powi(2) / variance).sum();
        let squares: f64 = own.iter().map(|(_, variance)| variance.powi(-2)).sum();
        let excess = chi2 - (own.len() - 1) as f64;
        let room = weights - squares / weights;
        let spread2 = if own.len() > 1 && room > 0.0 { (excess / room).max(0.0) } else { 0.0 };
        let (mean, weights) = mean_with(spread2);
        Self { chi2, spread: spread2.sqrt(), mean, error: weights.sqrt().recip() }
    }
}

fn inverse(information: &DMatrix<f64>) -> DMatrix<f64> {
    let n = information.nrows();
    let scale = DVector::from_fn(n, |i, _| information[(i, i)].sqrt().recip());
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.cholesky().map_or_else(|| DMatrix::identity(n, n), |factor| factor.inverse());
    DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j])
}

/// How often chance gives this χ² or a larger one.
fn tail(chi2: f64, dof: usize) -> Option<f64> {
    if dof == 0 {
        return None;
    }
    ChiSquared::new(dof as f64).ok().map(|distribution| distribution.sf(chi2))
}
