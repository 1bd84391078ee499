//! What compilers make of the files, against the model: values, derivatives and steps of C and Rust.

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use super::fixtures::{calibration, random_points, robot};
use crate::export::{Exported, Program, c, rust};
use crate::model::{Input, Stepper};

/// Relative to the largest entry of a block.
pub(super) const RTOL: f64 = 1e-12;
pub(super) const RTOL_SLOPES: f64 = 1e-9;
const RTOL_F32: f64 = 2e-4;

/// Over a run of this many steps, in shares of the largest component.
const RTOL_RUN: f64 = 1e-9;
pub(super) const STEPS: usize = 400;

/// What is compared at a point: ẋ, y, the next state, then both Jacobians; and where a run from rest ends whose inputs are those of one point after the other.
pub(super) struct Expected {
    pub(super) points: Vec<Vec<f64>>,
    values: Vec<[Vec<f64>; 5]>,
    end: Vec<f64>,
}

pub(super) fn expected(exported: &Exported<'_>) -> Expected {
    let program = Program::of(exported).unwrap();
    let dynamics = exported.calibrated.model().at(exported.calibrated.z());
    let mut stepper = Stepper::new(exported.integrator());
    let points = random_points(exported, 8, 11);
    let of = |point: &Vec<f64>| {
        let (n, m) = (program.sizes.states, program.sizes.inputs);
        let input = Input { u: &point[n..n + m], by_delay: &[], time_s: point[program.sizes.columns()] };
        let (mut xdot, mut next) = (vec![0.0; n], vec![0.0; n]);
        dynamics.derivative(&point[..n], input, &mut xdot);
        stepper.step(&dynamics, &point[..n], input, exported.calibrated.robot().sample_period_s, &mut next);
        let value = |roots: &[crate::model::Expression]| program.evaluate(roots, point);
        [xdot, value(&program.readings), next, value(&program.rate_slopes), value(&program.reading_slopes)]
    };
    let values = points.iter().map(of).collect();
    let mut runner = Stepper::new(exported.integrator());
    let (mut end, mut next) = (exported.rest(), exported.rest());
    for k in 0..STEPS {
        let u = &points[k / 20 % points.len()][program.sizes.states..][..program.sizes.inputs];
        let input = Input { u, by_delay: &[], time_s: 0.0 };
        runner.step(&dynamics, &end, input, exported.calibrated.robot().sample_period_s, &mut next);
        std::mem::swap(&mut end, &mut next);
    }
    Expected { points, values, end }
}

pub(super) fn compare(what: &str, expected: &Expected, output: &str, tolerances: [f64; 2]) -> [f64; 2] {
    let mut numbers = output.split_whitespace().map(|word| word.parse::<f64>().unwrap());
    let mut worst = [0.0f64; 2];
    for values in &expected.values {
        for (block, values) in values.iter().enumerate() {
            let largest = values.iter().fold(1e-6f64, |most, value| most.max(value.abs()));
            let kind = usize::from(block > 2);
            for value in values {
                let apart = (numbers.next().unwrap() - value).abs() / largest;
                assert!(apart <= tolerances[kind], "{what} block {block}: {apart:e}");
                worst[kind] = worst[kind].max(apart);
            }
        }
    }
    let end: Vec<f64> = numbers.collect();
    let largest = expected.end.iter().fold(1e-6f64, |most, value| most.max(value.abs()));
    let apart = end.iter().zip(&expected.end).map(|(found, value)| (found - value).abs() / largest).fold(0.0, f64::max);
    assert!(end.len() == expected.end.len() && (apart <= RTOL_RUN || tolerances[0] > RTOL), "{what}: {apart:e}");
    println!("{what}: values {:.1e}, derivatives {:.1e}, after {STEPS} steps {apart:.1e}", worst[0], worst[1]);
    worst
}

pub(super) fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

pub(super) fn numbers(points: &[Vec<f64>]) -> String {
    points.iter().flatten().fold(String::new(), |mut text, number| {
        let _ = write!(text, "{number:?}, ");
        text
    })
}

/// Compiles the C files with a program that prints everything at every point.
fn by_c(folder: &Path, exported: &Exported<'_>, expected: &Expected) {
    let name = exported.identifier();
    let (files, _) = c(exported, "model.h").unwrap();
    std::fs::write(folder.join("model.h"), files.header).unwrap();
    std::fs::write(folder.join("model.c"), files.code).unwrap();
    let upper = name.to_uppercase();
    let (count, size) = (expected.points.len(), expected.points[0].len());
    let main = format!(
        "#include \"model.h\"
#include <stdio.h>
enum {{ N = {upper}_STATES, M = {upper}_INPUTS, P = {upper}_PARAMETERS, Y = {upper}_READINGS }};
typedef {name}_real real;
static const double points[{count} * {size}] = {{ {numbers} }};
static void show(const real *by_x, const real *by_u, const real *by_p, int rows) {{
    for (int i = 0; i < rows; ++i) {{
        for (int j = 0; j < N; ++j) printf(\"%.17g \", (double)by_x[i * N + j]);
        for (int j = 0; j < M; ++j) printf(\"%.17g \", (double)by_u[i * M + j]);
        for (int j = 0; j < P; ++j) printf(\"%.17g \", (double)by_p[i * P + j]);
    }}
}}
int main(void) {{
    static real xdot[N], y[Y], next[N], by_x[2][(N + Y) * N], by_u[2][(N + Y) * M], by_p[2][(N + Y) * P + 1];
    for (int k = 0; k < {count}; ++k) {{
        real v[{size}];
        for (int i = 0; i < {size}; ++i) v[i] = points[k * {size} + i];
        const real *x = v, *u = v + N, *p = v + N + M;
        const real t = v[N + M + P];
        {name}_rates(x, u, p, t, xdot);
        for (int i = 0; i < N; ++i) printf(\"%.17g \", (double)xdot[i]);
        {name}_readings(x, u, p, t, y);
        for (int i = 0; i < Y; ++i) printf(\"%.17g \", (double)y[i]);
        {name}_step(x, u, p, t, {upper}_SAMPLE_PERIOD_S, next);
        for (int i = 0; i < N; ++i) printf(\"%.17g \", (double)next[i]);
        {name}_rates_jacobian(x, u, p, t, xdot, by_x[0], by_u[0], by_p[0]);
        show(by_x[0], by_u[0], by_p[0], N);
        {name}_readings_jacobian(x, u, p, t, y, by_x[1], by_u[1], by_p[1]);
        show(by_x[1], by_u[1], by_p[1], Y);
        printf(\"\\n\");
    }}
    real x[N] = {{0}}, p[P + 1];
    for (int i = 0; i < P; ++i) p[i] = points[N + M + i];
    for (int k = 0; k < {STEPS}; ++k) {{
        real u[M];
        for (int i = 0; i < M; ++i) u[i] = points[k / 20 % {count} * {size} + N + i];
        {name}_step(x, u, p, 0, {upper}_SAMPLE_PERIOD_S, next);
        for (int i = 0; i < N; ++i) x[i] = next[i];
    }}
    for (int i = 0; i < N; ++i) printf(\"%.17g \", (double)x[i]);
    return 0;
}}
",
        numbers = numbers(&expected.points)
    );
    std::fs::write(folder.join("main.c"), main).unwrap();
    for (real, tolerances) in [("double", [RTOL, RTOL_SLOPES]), ("float", [RTOL_F32; 2])] {
        let program = folder.join(format!("c_{real}"));
        let define = format!("-DMODEL_REAL={real}");
        run(Command::new("cc")
            .current_dir(folder)
            .args(["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-o"])
            .arg(&program)
            .args([&*define, "main.c", "model.c", "-lm"]));
        compare(&format!("{name} in C, {real}"), expected, &run(&mut Command::new(program)), tolerances);
    }
}

/// The same of the Rust file, as a part of a crate without the standard library.
fn by_rust(folder: &Path, exported: &Exported<'_>, expected: &Expected) {
    let (text, _) = rust(exported).unwrap();
    std::fs::write(folder.join("model.rs"), text).unwrap();
    std::fs::write(folder.join("robot.rs"), "#![no_std]\n#![deny(warnings)]\npub mod model;\n").unwrap();
    let (count, size) = (expected.points.len(), expected.points[0].len());
    let main = format!(
        "use robot::model::*;
static POINTS: [f64; {count} * {size}] = [{numbers}];
fn show<T: Real + Into<f64>>(values: &[T]) {{
    values.iter().for_each(|value| print!(\"{{:e}} \", (*value).into()));
}}
fn play<T: Real + Into<f64>>() {{
    let zero = T::of(0.0);
    for point in POINTS.chunks({size}) {{
        let v: Vec<T> = point.iter().map(|v| T::of(*v)).collect();
        let x: &[T; STATES] = v[..STATES].try_into().unwrap();
        let u: &[T; INPUTS] = v[STATES..STATES + INPUTS].try_into().unwrap();
        let p: &[T; PARAMETERS] = v[STATES + INPUTS..STATES + INPUTS + PARAMETERS].try_into().unwrap();
        let t = v[STATES + INPUTS + PARAMETERS];
        let (mut xdot, mut y, mut next) = ([zero; STATES], [zero; READINGS], [zero; STATES]);
        rates(x, u, p, t, &mut xdot);
        show(&xdot);
        readings(x, u, p, t, &mut y);
        show(&y);
        step(x, u, p, t, T::of(SAMPLE_PERIOD_S), &mut next);
        show(&next);
        let (mut by_x, mut by_u, mut by_p) = ([[zero; STATES]; STATES], [[zero; INPUTS]; STATES], [[zero; PARAMETERS]; STATES]);
        rates_jacobian(x, u, p, t, &mut xdot, &mut by_x, &mut by_u, &mut by_p);
        (0..STATES).for_each(|i| [&by_x[i][..], &by_u[i], &by_p[i]].into_iter().for_each(show));
        let (mut by_x, mut by_u, mut by_p) = ([[zero; STATES]; READINGS], [[zero; INPUTS]; READINGS], [[zero; PARAMETERS]; READINGS]);
        readings_jacobian(x, u, p, t, &mut y, &mut by_x, &mut by_u, &mut by_p);
        (0..READINGS).for_each(|i| [&by_x[i][..], &by_u[i], &by_p[i]].into_iter().for_each(show));
    }}
    let points: Vec<Vec<T>> = POINTS.chunks({size}).map(|point| point.iter().map(|v| T::of(*v)).collect()).collect();
    let p: &[T; PARAMETERS] = points[0][STATES + INPUTS..STATES + INPUTS + PARAMETERS].try_into().unwrap();
    let (mut x, mut next) = ([zero; STATES], [zero; STATES]);
    for k in 0..{STEPS} {{
        let u: &[T; INPUTS] = points[k / 20 % {count}][STATES..STATES + INPUTS].try_into().unwrap();
        step(&x, u, p, zero, T::of(SAMPLE_PERIOD_S), &mut next);
        x = next;
    }}
    show(&x);
}}
fn main() {{
    if std::env::args().count() > 1 {{ play::<f32>() }} else {{ play::<f64>() }}
}}
",
        numbers = numbers(&expected.points)
    );
    std::fs::write(folder.join("main.rs"), main).unwrap();
    let rustc = || {
        let mut command = Command::new("rustc");
        command.current_dir(folder).args(["--edition", "2024", "-C", "opt-level=1"]);
        command
    };
    run(rustc().args(["--crate-type", "rlib", "--crate-name", "robot", "robot.rs"]));
    run(rustc().args(["--extern", "robot=librobot.rlib", "-o", "in_rust", "main.rs"]));
    let name = exported.identifier();
    let played = |argument: &[&str]| run(Command::new(folder.join("in_rust")).args(argument));
    compare(&format!("{name} in Rust, f64"), expected, &played(&[]), [RTOL, RTOL_SLOPES]);
    compare(&format!("{name} in Rust, f32"), expected, &played(&["f32"]), [RTOL_F32; 2]);
}

fn both(name: &str, extensions: &[&str]) {
    let calibration = calibration(&robot(name), extensions);
    let exported = Exported::of(&calibration).unwrap();
    let expected = expected(&exported);
    let folder = tempfile::tempdir().unwrap();
    by_c(folder.path(), &exported, &expected);
    by_rust(folder.path(), &exported, &expected);
}

#[test]
fn c_and_rust_are_the_model() {
    both("doggy", &[]);
    both("one_joint", &[]);
    both("emps", &[]);
    both("rigid", &[]);
}

#[test]
fn c_and_rust_are_the_model_with_effects() {
    both(
        "doggy",
        &[
            "voltage_sag",
            "belt_hysteresis",
            "stribeck",
            "base_bearing",
            "gyro_lag",
            "gyro_clipping",
            "backlash",
            "cogging",
        ],
    );
    both("one_joint", &["integrator_error", "gyro_lag", "friction_drift"]);
}

#[test]
fn c_and_rust_are_the_model_of_seven_joints() {
    both("arm7", &[]);
}
