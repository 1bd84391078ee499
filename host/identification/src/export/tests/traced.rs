//! What is written down is the model: values and derivatives against the estimator's right-hand side and readings.

use super::fixtures::{calibration, random_points, robot};
use crate::effect::CATALOGUE;
use crate::export::{Exported, Program};
use crate::model::{Input, Linear};
use crate::verify::system::System;

/// Relative to the largest entry of its kind: values, derivatives.
const RTOL: f64 = 1e-12;
const RTOL_SLOPES: f64 = 1e-9;

/// The largest difference between two lists, in shares of the largest entry.
fn apart(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(1e-6, |most: f64, e| most.max(e.abs()));
    found.iter().zip(expected).map(|(f, e)| (f - e).abs()).fold(0.0, f64::max) / largest
}

/// Compares the program of a robot with the model that it was written down from; gives the largest differences met.
pub fn compare(name: &str, extensions: &[&str]) -> [f64; 4] {
    let calibration = calibration(&robot(name), extensions);
    let exported = Exported::of(&calibration).unwrap();
    let program = Program::of(&exported).unwrap();
    let (model, z) = (exported.calibrated.model(), exported.calibrated.z());
    let (dynamics, mut system) = (model.at(z), exported.calibrated.system());
    let (n, columns) = (program.sizes.states, program.sizes.columns());
    let mut worst = [0.0f64; 4];
    for point in random_points(&exported, 12, 3) {
        let (x, u) = (&point[..n], &point[n..n + program.sizes.inputs]);
        let input = Input { u, by_delay: &[], time_s: point[columns] };
        let mut xdot = vec![0.0; n];
        dynamics.derivative(x, input, &mut xdot);
        worst[0] = worst[0].max(apart(&program.evaluate(&program.rates, &point), &xdot));

        let mut linear = Linear::default();
        dynamics.linearise(x, input, &mut linear);
        let slopes = program.evaluate(&program.rate_slopes, &point);
        for row in 0..n {
            let found = &slopes[row * columns..(row + 1) * columns];
            let expected = &linear.slopes[row * dynamics.columns()..(row + 1) * dynamics.columns()];
            worst[1] = worst[1].max(apart(&found[..n], &expected[..n]));
            // By coordinates: ∂ẋ/∂p ∂p/∂z, and what depends on parameters through them.
            let mut by_z = vec![0.0; z.len()];
            for (parameter, slope) in exported.parameters.iter().zip(&found[n + program.sizes.inputs..]) {
                if let crate::export::Place::Result(i) = parameter.place {
                    for (coordinate, by) in model.coordinates().physical_and_slopes(z, i).1 {
                        by_z[coordinate] += slope * by;
                    }
                }
            }
            worst[1] = worst[1].max(apart(&by_z, &expected[n..]));
        }

        system.at_time(point[columns]);
        let (mut y, mut jacobian) = (vec![0.0; program.sizes.readings], vec![0.0; program.sizes.readings * n]);
        system.outputs_of(x, u, &mut y);
        worst[2] = worst[2].max(apart(&program.evaluate(&program.readings, &point), &y));
        system.outputs_jacobian(x, u, &mut y, &mut jacobian);
        let slopes = program.evaluate(&program.reading_slopes, &point);
        for (found, expected) in slopes.chunks(columns).zip(jacobian.chunks(n)) {
            worst[3] = worst[3].max(apart(&found[..n], expected));
        }

        // By inputs and by parameters of sensors no one else knows derivatives: central differences.
        for column in n..columns {
            let h = 1e-6 * (1.0 + point[column].abs());
            let moved = |by: f64| {
                let mut point = point.clone();
                point[column] += by;
                program.evaluate(&[&program.rates[..], &program.readings].concat(), &point)
            };
            let (up, down) = (moved(h), moved(-h));
            let expected: Vec<f64> = up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * h)).collect();
            let all = program.evaluate(&[&program.rate_slopes[..], &program.reading_slopes].concat(), &point);
            let found: Vec<f64> = all.iter().skip(column).step_by(columns).copied().collect();
            // rtol 1e-4 of the largest: differences of what is steep near rest; and what rounding makes of a difference
            let rounding = 1e-15 * up.iter().fold(1.0, |most: f64, value| most.max(value.abs())) / h;
            let largest = expected.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            for (found, expected) in found.iter().zip(&expected) {
                let apart = (found - expected).abs();
                assert!(apart <= 1e-4 * largest + rounding, "{name} {extensions:?} {column}: {found} {expected}");
            }
        }
    }
    assert!(
        worst[0].max(worst[2]) <= RTOL && worst[1].max(worst[3]) <= RTOL_SLOPES,
        "{name} {extensions:?}: {worst:?}"
    );
    worst
}

#[test]
fn robots_of_every_kind_are_written_down_as_they_are() {
    for name in ["doggy", "one_joint", "emps", "rigid", "kuka_kr300", "arm7"] {
        let worst = compare(name, &[]);
        println!(
            "{name}: rates {:.1e}, their slopes {:.1e}, readings {:.1e}, their slopes {:.1e}",
            worst[0], worst[1], worst[2], worst[3]
        );
    }
}

#[test]
fn every_effect_of_the_catalogue_is_written_down_as_it_is() {
    for effect in CATALOGUE {
        for name in ["doggy", "rigid"] {
            if effect.laws(&robot(name)).is_ok() {
                let worst = compare(name, &[effect.id]);
                println!("{} {name}: {worst:?}", effect.id);
            }
        }
    }
}

#[test]
fn effects_go_together() {
    compare(
        "doggy",
        &["voltage_sag", "belt_hysteresis", "stribeck", "coriolis", "link_inertia", "base_bearing", "gyro_lag"],
    );
}
