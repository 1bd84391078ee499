//! What a trial's parameters cost on samples that it was not fitted to.

use super::bench::Bench;
use super::trial::{Trial, TrialValue};
use super::warm_start::Known;
use crate::calibrate::data::series::Series;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::residuals::problem::Problem;
use crate::model::Model;
use solve::levenberg;

impl Bench<'_> {
    /// A bench for the same models on other samples of the robot, under the same noise. It knows of no direction that its samples
    /// do not determine.
    pub fn of_others(&self, series: Series) -> Self {
        Bench {
            robot: self.robot,
            block_starts: vec![0],
            series,
            noise: self.noise.clone(),
            easy: self.easy.clone(),
            layout: self.layout.clone(),
            preset: self.preset,
            weak: Vec::new(),
            base_unknowns: self.base_unknowns,
            settings: self.settings.clone(),
        }
    }

    /// The model of a trial with what these samples have of their own: states, biases, mountings, and the parameters of which `is_own` says so by their names.
    /// All else stays. States start where a better model on the same samples has them, `near`, if there is one; its biases and mountings are then taken
    /// for these samples' own where they have no such parameter, and nothing is left to search.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn with_own(
        &self,
        trial: &Trial,
        near: Option<&Trial>,
        is_own: &dyn Fn(&str) -> bool,
    ) -> Result<Trial, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        if let Some(near) = near.filter(|_| !free_of(&model, is_own).contains(&true)) {
            let (rotations, biases) = (near.rotations.clone(), near.biases.clone());
            return Ok(Trial { rotations, biases, states: Vec::new(), block_weights: Vec::new(), ..trial.clone() });
        }
        let known = Known { states: &[], block_weights: &[], ..trial.known() };
        let known = match near {
            Some(near) => Known { states: &near.states, layout: &near.layout, laws: &near.laws, ..known },
            None => known,
        };
        let (mut problem, mut start, mut held) = self.at(&model, &known);
        held.extend(held_but(&model, &problem, is_own));
        if near.is_none() {
            start = self.eased(&mut problem, &start, &held).unwrap_or(start);
        }
        let point = levenberg::minimise(&problem, start, &held, &self.settings, |i, iteration| {
            tracing::trace!(i, cost = iteration.cost, trials = iteration.trials, "own");
        })?
        .point;
        let coordinates = model.coordinates();
        let values = coordinates.names().zip(coordinates.to_physical(&point.z)).map(|((name, _), estimate)| {
            let known = trial.value(name).cloned();
            let unit = known.as_ref().map_or("", |value| value.unit);
            known.map(|value| TrialValue { estimate, ..value }).unwrap_or(TrialValue {
                name: name.to_string(),
                unit,
                estimate,
                std_error: None,
                vif: f64::NAN,
            })
        });
        Ok(Trial {
            values: values.collect(),
            rotations: point.rotations,
            biases: point.biases,
            states: point.states,
            layout: model.layout().clone(),
            block_weights: Vec::new(),
            ..trial.clone()
        })
    }
}

/// Of every coordinate of the dynamics, whether a result depends on it that is these samples' own.
fn free_of(model: &Model, is_own: &dyn Fn(&str) -> bool) -> Vec<bool> {
    let coordinates = model.coordinates();
    let z = vec![1.0; coordinates.len()];
    let mut free = vec![false; coordinates.len()];
    for (i, _) in coordinates.names().enumerate().filter(|(_, (name, _))| is_own(name)) {
        let (_, slopes) = coordinates.physical_and_slopes(&z, i);
        slopes.iter().for_each(|(own, _)| free[*own] = true);
    }
    free
}

/// Directions of the border that hold all coordinates of the dynamics but those on which a result depends that is these samples' own.
fn held_but(model: &Model, problem: &Problem<'_>, is_own: &dyn Fn(&str) -> bool) -> Vec<Vec<f64>> {
    let size = problem.border().size();
    let free = free_of(model, is_own);
    let held = (0..free.len()).filter(|own| !free[*own]);
    held.map(|own| (0..size).map(|i| f64::from(i == own)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::extension::fixture::doggy;
    use solve::levenberg::Settings;

    #[test]
    fn what_is_a_recording_s_own_is_found_again_and_all_else_stays() {
        let (robot, base) = doggy();
        let noise = base.noise.clone();
        let (bench, trial) =
            Bench::new(&robot, (base.series.clone(), vec![0]), &base, noise, Settings::default()).unwrap();
        let others = bench.of_others(base.series.clone());
        let mut off = trial.clone();
        let value = |trial: &Trial, name: &str| trial.value(name).unwrap().estimate;
        for name in ["k_s[2]", "mu[1]"] {
            off.values.iter_mut().find(|value| value.name == name).unwrap().estimate *= 1.01;
        }
        let found = others.with_own(&off, None, &|name| name == "k_s[2]").unwrap();
        // rtol 1e-3: beside a friction that is 1 % off.
        assert!((value(&found, "k_s[2]") / value(&trial, "k_s[2]") - 1.0).abs() < 1e-3);
        // rtol 1e-12: it goes by its logarithm and back.
        assert!((value(&found, "mu[1]") / value(&off, "mu[1]") - 1.0).abs() < 1e-12);
        // rtol 1e-6: where it starts is no matter.
        let again = others.with_own(&off, Some(&trial), &|name| name == "k_s[2]").unwrap();
        assert!((value(&again, "k_s[2]") / value(&found, "k_s[2]") - 1.0).abs() < 1e-6);
        // Without a parameter of its own it has the biases of the better model, to the bit.
        let known = others.with_own(&off, Some(&trial), &|_| false).unwrap();
        assert_eq!((&known.biases, &known.rotations), (&trial.biases, &trial.rotations));
        assert_eq!(value(&known, "k_s[2]"), value(&off, "k_s[2]"));
    }
}
