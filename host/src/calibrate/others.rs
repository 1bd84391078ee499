//! What a trial's parameters cost on samples that it was not fitted to.

use super::CalibrateError;
use super::bench::Bench;
use super::extension::Known;
use super::series::Series;
use super::problem::Problem;
use super::trial::{Trial, TrialValue};
use crate::model::Model;
use solve::LeastSquares;
use solve::levenberg::{self, Settings};

/// Iterations that tell where samples cost much: states need no more, and of a model that is far off every state is.
const ROUGHLY: usize = 4;

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

    /// ½ Σ r² of these samples with the parameters of a trial, which may be another bench's: only states, biases and mountings are fitted.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn cost_as(&self, trial: &Trial) -> Result<f64, CalibrateError> {
        Ok(self.costs(trial, &self.settings)?.0)
    }

    /// The model of a trial with what these samples have of their own: states, biases, mountings, and the parameters of which `is_own` says so by their names.
    /// All else stays.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn with_own(&self, trial: &Trial, is_own: &dyn Fn(&str) -> bool) -> Result<Trial, CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let (mut problem, start, mut held) = self.at(&model, &Known { states: &[], ..trial.known() });
        held.extend(self.held_but(&model, &problem, is_own));
        let start = self.eased(&mut problem, start, &held);
        let point = levenberg::minimise(&problem, start, &held, &self.settings, |_, _| {})?.point;
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
            ..trial.clone()
        })
    }

    /// Directions of the border that hold all coordinates of the dynamics but those on which a result depends that is these samples' own.
    fn held_but(&self, model: &Model, problem: &Problem<'_>, is_own: &dyn Fn(&str) -> bool) -> Vec<Vec<f64>> {
        let (coordinates, size) = (model.coordinates(), problem.border().size());
        let z = vec![1.0; coordinates.len()];
        let mut free = vec![false; coordinates.len()];
        for (i, _) in coordinates.names().enumerate().filter(|(_, (name, _))| is_own(name)) {
            let (_, slopes) = coordinates.physical_and_slopes(&z, i);
            slopes.iter().for_each(|(own, _)| free[*own] = true);
        }
        let held = (0..coordinates.len()).filter(|own| !free[*own]);
        held.map(|own| (0..size).map(|i| f64::from(i == own)).collect()).collect()
    }

    /// The same of every sample, roughly: states are not searched to the end.
    ///
    /// # Errors
    /// A model that cannot be built or solved.
    pub fn costs_as(&self, trial: &Trial) -> Result<Vec<f64>, CalibrateError> {
        Ok(self.costs(trial, &Settings { max_iterations: ROUGHLY, ..self.settings.clone() })?.1)
    }

    fn costs(&self, trial: &Trial, settings: &Settings) -> Result<(f64, Vec<f64>), CalibrateError> {
        let model = Model::extended(self.robot, trial.laws.clone())?;
        let (mut problem, start, mut held) = self.at(&model, &Known { states: &[], ..trial.known() });
        held.extend(self.held_but(&model, &problem, &|_| false));
        let start = self.eased(&mut problem, start, &held);
        let found = levenberg::minimise(&problem, start, &held, settings, |_, _| {})?;
        let mut scratch = problem.scratch();
        let stages = 0..self.series.stages();
        Ok((found.cost, stages.map(|k| problem.cost(&found.point, k..k + 1, &mut scratch)).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::{Preset, fit};
    use crate::robot::Robot;
    use crate::simulate::{Direct, Options, SHORT_MOTION};

    #[test]
    fn the_parameters_of_a_trial_cost_on_their_own_samples_what_the_trial_did() {
        let robot = Robot::builtin("doggy").unwrap();
        let options = Options { seed: 3, ..Options::new(robot.clone()) };
        let whole = Direct::record(&options, SHORT_MOTION).unwrap().recording;
        let recording = whole.part(0..8_000.min(whole.len()));
        let base = fit(&robot, &[&recording], Preset::Default, &Settings::default(), |_, _| {}).unwrap();
        let noise = base.noise.clone();
        let (bench, trial) = Bench::new(&robot, base.series.clone(), &base, noise, Settings::default()).unwrap();
        let others = bench.of_others(base.series.clone());
        let same = others.cost_as(&trial).unwrap();
        // rtol 1e-8 (measured 3e-15): states, biases and mountings are found again from their first guess.
        assert!((same / trial.cost - 1.0).abs() < 1e-8, "{same} for {}", trial.cost);
        let sum = others.costs_as(&trial).unwrap().iter().sum::<f64>();
        assert!((sum / same - 1.0).abs() < 1e-3, "{sum} for {same}");
        let mut off = trial.clone();
        off.values.iter_mut().find(|value| value.name == "k_s[2]").unwrap().estimate *= 1.01;
        let more = others.cost_as(&off).unwrap();
        // Measured 1035 = ½ 45²: alone, the stiffness would be known to a 45th of 1 %.
        let lost = more - trial.cost;
        assert!((900.0..1200.0).contains(&lost), "{lost}");
    }
}
