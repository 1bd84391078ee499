//! The table against the model's program, and the observer on simulated robots.

use observer::{Input, Model, Sensors, TableModel};
use solve::levenberg::Settings;

use super::{Estimates, Numbers, Observation, ObserveError, Status, Truth, observe};
use crate::calibrate::{Calibration, ChannelNoise, Preset, calibrate, process_names};
use crate::export::tests::fixtures::{self, random_points, robot};
use crate::export::{Exported, Program};
use crate::robot::Robot;
use crate::simulated::{self, Options, SHORT_MOTION};

/// Single precision against double, in shares of the largest number of a kind.
const RTOL_F32: f64 = 2e-4;

/// A made-up calibration that tells process noise.
pub(super) fn made_up(name: &str, extensions: &[&str]) -> Calibration {
    let mut calibration = fixtures::calibration(&robot(name), extensions);
    let names = {
        let exported = Exported::of(&calibration).unwrap();
        process_names(exported.calibrated.robot(), exported.calibrated.model().layout())
    };
    calibration.noise.extend(names.into_iter().map(|(channel, unit)| ChannelNoise {
        channel,
        unit: unit.to_owned(),
        sigma: 1e-5,
        floor: None,
        freedom: None,
        chi2_per_dof: None,
        left_out: 0,
    }));
    calibration
}

fn close(what: &str, found: &[f32], expected: &[f64]) -> f64 {
    let largest = expected.iter().fold(1e-6f64, |most, value| most.max(value.abs()));
    let apart = |(found, expected): (&f32, &f64)| (f64::from(*found) - expected).abs() / largest;
    let worst = found.iter().zip(expected).map(apart).fold(0.0, f64::max);
    assert!(found.len() == expected.len() && worst < RTOL_F32, "{what}: {worst:e}");
    worst
}

/// Everything that the table gives at random states, against the program's own values.
fn table_is_model(name: &str, extensions: &[&str]) {
    let calibration = made_up(name, extensions);
    let exported = Exported::of(&calibration).unwrap();
    let program = Program::of(&exported).unwrap();
    let numbers = Numbers::of(&exported).unwrap();
    let (table, sizes) = (numbers.table(), program.sizes);
    let mut model = TableModel::new(table, vec![0.0_f32; table.memory()]).unwrap();
    let biases: Vec<usize> = super::table::biases(&exported);
    let columns = sizes.columns();
    let block = |slopes: &[f64], rows: usize, of_biases: bool| -> Vec<f64> {
        let row = |row: usize| {
            let own = (0..sizes.states).map(move |column| row * columns + column);
            let constant = biases.iter().map(move |bias| row * columns + sizes.states + sizes.inputs + bias);
            own.chain(constant.filter(move |_| of_biases)).map(|place| slopes[place]).collect::<Vec<_>>()
        };
        (0..rows).flat_map(row).collect()
    };
    let mut worst: f64 = 0.0;
    for point in random_points(&exported, 6, 23) {
        let single: Vec<f32> = point.iter().map(|value| *value as f32).collect();
        let biases_now = biases.iter().map(|bias| single[sizes.states + sizes.inputs + bias]);
        let x: Vec<f32> = single[..sizes.states].iter().copied().chain(biases_now).collect();
        let input = Input { u: &single[sizes.states..sizes.states + sizes.inputs], time_s: single[columns] };
        let mut rates = vec![f32::NAN; table.moving];
        let mut by_x = vec![f32::NAN; table.moving * table.moving];
        let of = |roots: &[crate::model::Expression]| program.evaluate(roots, &point);
        model.rates(&x, input, &mut rates);
        worst = worst.max(close(name, &rates, &of(&program.rates)));
        model.rates_slopes(&x, input, &mut rates, &mut by_x);
        close(name, &rates, &of(&program.rates));
        worst = worst.max(close(name, &by_x, &block(&of(&program.rate_slopes), table.moving, false)));
        let mut y = vec![f32::NAN; table.readings];
        let mut by_x = vec![f32::NAN; table.readings * table.states];
        model.readings_slopes(&x, input, &mut y, &mut by_x);
        worst = worst.max(close(name, &y, &of(&program.readings)));
        worst = worst.max(close(name, &by_x, &block(&of(&program.reading_slopes), table.readings, true)));
    }
    let [slopes, rates, readings] = numbers.operations();
    println!("{name} {extensions:?}: {slopes} + {rates} + {readings} operations, f32 within {worst:.1e}");
}

#[test]
fn tables_are_the_models_that_they_are_made_of() {
    table_is_model("doggy", &[]);
    table_is_model("doggy", &["base_bearing"]);
    table_is_model("doggy", &["voltage_sag", "stribeck", "gyro_lag", "backlash", "cogging"]);
    table_is_model("one_joint", &[]);
    table_is_model("rigid", &[]);
    table_is_model("arm7", &[]);
}

#[test]
fn what_cannot_be_observed_is_refused_with_a_reason() {
    let without_noise = fixtures::calibration(&robot("doggy"), &[]);
    let exported = Exported::of(&without_noise).unwrap();
    assert!(matches!(Numbers::of(&exported), Err(ObserveError::MissingNoise { name }) if name == "process.q[1]"));
}

struct Simulated {
    calibration: Calibration,
    direct: simulated::Simulated,
}

/// A simulated Doggy, calibrated on a motion of its own.
fn simulated(seed: u64) -> Simulated {
    let robot = Robot::builtin("doggy").unwrap();
    let direct = simulated::record(&Options { seed, ..Options::new(robot.clone()) }, SHORT_MOTION);
    let recordings = [&direct.recording];
    let calibration = calibrate(&robot, &recordings, Preset::Default, &Settings::default(), |_, _| {}).unwrap();
    Simulated { calibration, direct }
}

fn observed(calibration: &Calibration, direct: &simulated::Simulated, sensors: Sensors) -> (Observation, Estimates) {
    let truth = Truth { t_us: direct.recording.t_us.clone(), columns: direct.states.clone() };
    observe(calibration, &direct.recording, sensors, Some(&truth), |_| {}).unwrap()
}

#[test]
fn a_simulated_robot_is_observed_consistently() {
    let Simulated { calibration, direct } = simulated(3);
    for sensors in [Sensors::Both, Sensors::Encoders, Sensors::Gyros] {
        let (observation, _) = observed(&calibration, &direct, sensors);
        let (nis, nees) = (observation.nis.unwrap(), observation.nees.unwrap());
        println!("{sensors:?}: NIS {nis:?}\n  NEES {nees:?}\n  level {:.2}", observation.highest_level);
        for error in &observation.errors {
            println!("  {}: {:.2e} {}, said {:.2e}", error.name, error.rms, error.unit, error.rms_sigma);
        }
        assert!(observation.events.is_empty() && observation.starts == 1);
        assert_eq!(observation.status, Status::Consistent);
        // Without process noise the filter's steps are better than it says; it is never too sure.
        assert!(nees.mean_per_dof.is_finite() && nees.mean_per_dof < 1.2, "{sensors:?}: {nees:?}");
        assert!(
            (nis.mean_per_dof - 1.0).abs() < 0.03 && (0.93..=0.97).contains(&nis.within_95),
            "{sensors:?}: {nis:?}"
        );
    }
}

#[test]
fn a_hidden_bearing_raises_an_event_within_a_second_of_motion() {
    let Simulated { calibration, direct } = simulated(3);
    let changed = simulated::record(&Options::parse("seed=3,effect=base_bearing").unwrap(), SHORT_MOTION);
    let (observation, _) = observed(&calibration, &changed, Sensors::Both);
    let moves = |k: &usize| changed.recording.duty.iter().any(|duty| duty[*k].abs() > 0.02);
    let begin_s = (0..changed.recording.len()).find(moves).map(|k| changed.recording.time_s(k)).unwrap();
    let event_s = observation.events.first().map(|event| event.t_s);
    assert_eq!(observation.status, Status::TooSure);
    println!("moves from {begin_s} s on, event at {event_s:?} s");
    assert!(event_s.is_some_and(|event_s| (begin_s..begin_s + 1.0).contains(&event_s)), "{event_s:?} {begin_s}");
    assert!(observed(&calibration, &direct, Sensors::Both).0.events.is_empty());
}
