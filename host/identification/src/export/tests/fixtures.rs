//! Calibrations that no recording was needed for: robots at known values, extended by any effect.

use std::collections::BTreeMap;
use std::path::Path;

use rand::{RngExt, SeedableRng, rngs::StdRng};

use crate::calibrate::{
    Calibration, ChannelNoise, Covariance, NoiseSource, ParameterEstimate, Preset, RecordingUsed, Seconds, Status,
};
use crate::effect::Effect;
use crate::export::Exported;
use crate::model::Model;
use crate::model::law::Form;
use crate::robot::{Friction, InputUnit, Robot, Symbol};

/// Two rigid joints that turn, in the vertical plane, driven by currents; the second is as its file says, with a link encoder and two late sensors.
const RIGID: &str = include_str!("rigid.toml");

/// A built-in robot, or one of the tests'.
pub fn robot(name: &str) -> Robot {
    match name {
        "rigid" => Robot::parse(RIGID).unwrap(),
        "arm7" => {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/robots/arm7.toml");
            Robot::load(path.to_str().unwrap()).unwrap()
        }
        _ => Robot::builtin(name).unwrap(),
    }
}

/// A calibration of `robot` that ended a few per cent off its start values, extended by these effects.
pub fn calibration(robot: &Robot, extensions: &[&str]) -> Calibration {
    let mut rng = StdRng::seed_from_u64(7);
    let mut parameters = Vec::new();
    let mut add = |name: &str, unit: &str, initial: f64, estimate: f64| {
        let (std_error, name, unit) = (0.01 * estimate.abs() + 1e-4, name.to_owned(), unit.to_owned());
        parameters.push(ParameterEstimate {
            name,
            unit,
            initial,
            estimate,
            std_error: Some(std_error),
            ci95: Some([estimate - 2.0 * std_error, estimate + 2.0 * std_error]),
            identifiable: true,
        });
    };
    for spec in robot.parameters().iter().filter(|spec| spec.value.free) {
        let off = match spec.symbol {
            Symbol::Misalignment { .. } => rng.random_range(-0.1..0.1),
            Symbol::Bias { .. } => rng.random_range(-0.02..0.02),
            _ => 0.1 * (spec.value.start.abs() + 0.1) * rng.random_range(0.2..1.0),
        };
        add(&spec.name, spec.unit, spec.value.start, spec.value.start + off);
    }
    let laws: Vec<_> =
        extensions.iter().map(|id| Effect::by_id(id).unwrap().laws(robot).unwrap().swap_remove(0)).collect();
    let model = Model::extended(robot, laws.clone()).unwrap();
    let z = model.coordinates().start();
    for (index, law) in laws.iter().enumerate() {
        let own = model.coordinates().of_law(index, &z);
        let mut values: Vec<f64> = Vec::new();
        for result in &law.parameters().results {
            let start = result.form.value(own).0;
            let value = match &result.form {
                Form::Is(_) if result.range[1] <= 1.0 => start + 0.004,
                Form::Is(_) => start + 0.05 * (1.0 + start.abs()),
                Form::Exp(_) | Form::Scaled(..) => start * 1.1,
                Form::Amplitude(..) | Form::SignedAmplitude(..) => 0.2,
                Form::Phase(..) | Form::SignedPhase(..) => 0.6,
                Form::MinusSum(others) => -values[values.len() - others.len()..].iter().sum::<f64>(),
                Form::Chosen(value) => *value,
            };
            values.push(value);
            add(&result.name, result.unit, start, value);
        }
    }
    let noise = robot.channels().into_iter().map(|channel| ChannelNoise {
        channel: channel.name,
        unit: channel.unit.to_owned(),
        sigma: 1.5 * channel.sigma,
        floor: Some(0.0),
        freedom: None,
        chi2_per_dof: Some(1.0),
        left_out: 0,
    });
    Calibration {
        robot: robot.name.clone(),
        robot_toml: robot.toml().to_owned(),
        preset: Preset::Default,
        noise_source: NoiseSource::Estimated,
        extensions: extensions.iter().map(|id| (*id).to_owned()).collect(),
        recordings: vec![RecordingUsed {
            path: "made up".into(),
            sha256: "0".into(),
            samples: 1000,
            gaps: 0,
            missing_ticks: 0,
        }],
        status: Status::Converged,
        iterations: 7,
        factorisations: 7,
        cost: 1.0,
        dof: 1.0,
        seconds: Seconds { start: 0.0, noise: 0.0, linearise: 0.0, factor: 0.0, solve: 0.0, total: 0.0 },
        parameters,
        covariance: Covariance::default(),
        correlations: Vec::new(),
        unobservable: Vec::new(),
        rotations: BTreeMap::new(),
        noise: noise.collect(),
        fit: Vec::new(),
        misfit: Vec::new(),
        notes: Vec::new(),
        pushes: Vec::new(),
        scatter: None,
        first_states: Vec::new(),
    }
}

/// States, inputs and a time that a robot may meet: links near their motors; joints slow, fast, and within twice the width of friction's smoothed sign, where steps are
/// divided by how far the sign's argument moves.
pub fn random_points(exported: &Exported<'_>, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = StdRng::seed_from_u64(seed);
    let (layout, robot) = (exported.calibrated.model().layout(), exported.calibrated.robot());
    let most = match robot.input.unit {
        InputUnit::Duty => 0.9,
        _ => 20.0,
    };
    let mut point = || {
        let mut x: Vec<f64> = (0..layout.size()).map(|_| rng.random_range(-0.02..0.02)).collect();
        for i in 0..layout.joints() {
            let [low, high] = robot.joints[i].limits;
            let (speed, twist_speed) = match (rng.random_range(0..10), &robot.joints[i].friction) {
                (0..3, Friction::Coulomb { slope_s, .. }) => (4.0 / slope_s, 2.0 / slope_s),
                (0..6, _) => (0.01, 0.5),
                _ => (2.0, 0.5),
            };
            x[layout.q(i)] = rng.random_range(low..high);
            x[layout.qd(i)] = rng.random_range(-speed..speed);
            if layout.is_elastic(i) {
                x[layout.theta(i)] = x[layout.q(i)] + rng.random_range(-0.05..0.05);
                x[layout.thetad(i)] = x[layout.qd(i)] + rng.random_range(-twist_speed..twist_speed);
            }
        }
        let u: Vec<f64> = (0..layout.joints()).map(|_| rng.random_range(-most..most)).collect();
        let p: Vec<f64> = exported.parameters.iter().map(|parameter| parameter.value).collect();
        let time_s: f64 = rng.random_range(0.5..9.0);
        [x, u, p, vec![time_s]].concat()
    };
    (0..count).map(|_| point()).collect()
}
