//! A simulated elastic joint with steep friction: NIS within its band, true errors as large as the covariance says, in single precision.

use std::vec::Vec;

use super::Normal;
use crate::{Input, Model, Observer, Real, Sensors, Settings, Start, Watchdog};

const N: usize = 5;
const R: usize = 2;
const PERIOD_S: f64 = 1e-3;

// About Doggy's third joint. Belt, N m/rad and N m s/rad:
const STIFFNESS: f64 = 600.0;
const DAMPING: f64 = 2.0;
// Inertia of link and motor, kg m²:
const LINK: f64 = 0.51;
const MOTOR: f64 = 2.43;
// Friction, N m; back-EMF, N m s/rad; torque of a unit of duty, N m:
const FRICTION: f64 = 4.85;
const BACK: f64 = 31.3;
const TORQUE: f64 = 150.0;
/// Half the slope of friction's sign, s/rad.
const HALF_SLOPE: f64 = 200.0;

/// x = (q, q̇, θ, θ̇, bias); the encoder reads θ, the gyro q̇ + bias.
struct Joint;

impl<T: Real> Model<T> for Joint {
    fn moving(&self) -> usize {
        4
    }

    fn states(&self) -> usize {
        N
    }

    fn inputs(&self) -> usize {
        1
    }

    fn readings(&self) -> usize {
        R
    }

    fn rates(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T]) {
        let number = T::of;
        let belt = number(STIFFNESS) * (x[0] - x[2]) + number(DAMPING) * (x[1] - x[3]);
        let friction = number(FRICTION) * Real::tanh(number(HALF_SLOPE) * x[3]);
        xdot[0] = x[1];
        xdot[1] = -belt * number(1.0 / LINK);
        xdot[2] = x[3];
        xdot[3] = (belt + number(TORQUE) * input.u[0] - number(BACK) * x[3] - friction) * number(1.0 / MOTOR);
    }

    fn rates_slopes(&mut self, x: &[T], input: Input<'_, T>, xdot: &mut [T], by_x: &mut [T]) {
        self.rates(x, input, xdot);
        let sign = Real::tanh(T::of(HALF_SLOPE) * x[3]);
        let rubbing = T::of(FRICTION * HALF_SLOPE / MOTOR) * (T::of(1.0) - sign * sign);
        let (k, d) = (STIFFNESS, DAMPING);
        let rows = [
            [0.0, 1.0, 0.0, 0.0],
            [-k / LINK, -d / LINK, k / LINK, d / LINK],
            [0.0, 0.0, 0.0, 1.0],
            [k / MOTOR, d / MOTOR, -k / MOTOR, -(d + BACK) / MOTOR],
        ];
        by_x.copy_from_slice(rows.map(|row| row.map(T::of)).as_flattened());
        by_x[15] = by_x[15] - rubbing;
    }

    fn readings_slopes(&mut self, x: &[T], _: Input<'_, T>, y: &mut [T], by_x: &mut [T]) {
        y.copy_from_slice(&[x[2], x[1] + x[4]]);
        let rows = [[0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 1.0]];
        by_x.copy_from_slice(rows.map(|row| row.map(T::of)).as_flattened());
    }
}

const SIGMA: [f64; R] = [6.9e-5, 1.745e-3];
const PROCESS: [f64; N] = [6e-9, 1e-5, 6e-9, 1e-5, 1e-6];
const BIAS: f64 = 0.02;
const START: [f64; N] = [0.0872, 1.0, 0.01, 1.0, 0.05];

/// The state a period later: classical Runge–Kutta in 20 parts, and the noise of the step.
fn plant(x: &mut [f64; N], u: f64, normal: &mut Normal) {
    const PARTS: usize = 20;
    let h = PERIOD_S / PARTS as f64;
    let rates = |x: &[f64; N]| {
        let mut xdot = [0.0; N];
        Joint.rates(&x[..], Input { u: &[u], time_s: 0.0 }, &mut xdot[..4]);
        xdot
    };
    let along = |x: &[f64; N], h: f64, v: &[f64; N]| std::array::from_fn(|i| x[i] + h * v[i]);
    for _ in 0..PARTS {
        let a = rates(x);
        let b = rates(&along(x, 0.5 * h, &a));
        let c = rates(&along(x, 0.5 * h, &b));
        let d = rates(&along(x, h, &c));
        *x = std::array::from_fn(|i| x[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    for (x, sigma) in x.iter_mut().zip(PROCESS) {
        *x += sigma * normal.next();
    }
}

/// What a run came to.
struct Found {
    /// Mean NIS a reading taken in.
    nis: f64,
    /// Mean of e²/P of each component, after the first second.
    nees: [f64; N],
    left_out: u32,
    events: u32,
    /// Estimates of both precisions apart, in standard deviations.
    apart: f64,
}

/// `seconds` of a robot whose motors give `input_gain` of what the filter believes: slow and fast, with many reversals.
fn run(seed: u64, seconds: usize, sensors: Sensors, input_gain: f64) -> Found {
    let start: Vec<Start<f64>> =
        (0..N).map(|i| Start { reading: (i == 0 || i == 2).then_some(0), value: 0.0, sigma: START[i] }).collect();
    let of_single: Vec<Start<f32>> =
        start.iter().map(|s| Start { reading: s.reading, value: 0.0, sigma: s.sigma as f32 }).collect();
    let (sigma, process) = (SIGMA.map(|s| s as f32), PROCESS.map(|s| s as f32));
    let is_gyro = [false, true];
    let settings = Settings {
        period_s: PERIOD_S as f32,
        sigma: &sigma,
        is_gyro: &is_gyro,
        process: &process,
        start: &of_single,
        sensors,
    };
    let double =
        Settings { period_s: PERIOD_S, sigma: &SIGMA, is_gyro: &is_gyro, process: &PROCESS, start: &start, sensors };
    let mut normal = Normal::of(seed);
    let mut x = [0.3, 0.0, 0.3, 0.0, BIAS];
    let reads = |x: &[f64; N], normal: &mut Normal| {
        [x[2] + SIGMA[0] * normal.next(), x[1] + x[4] + SIGMA[1] * normal.next()].map(|y| y as f32)
    };
    let first = reads(&x, &mut normal);
    let mut filter = Observer::<f32, N, R>::new(&Joint, settings, &first).unwrap();
    let mut reference = Observer::<f64, N, R>::new(&Joint, double, &first.map(f64::from)).unwrap();
    let mut watchdog = Watchdog::default();
    let mut found = Found { nis: 0.0, nees: [0.0; N], left_out: 0, events: 0, apart: 0.0 };
    let (mut taken, mut counted) = (0.0, 0.0);
    for k in 0..seconds * 1000 {
        let t = k as f64 * PERIOD_S;
        let u = 0.3 * (2.0 * t).sin() + 0.2 * (13.0 * t).sin() + if k % 1500 < 700 { 0.15 } else { -0.15 };
        let u = f64::from(u as f32);
        let y = if k == 0 { first } else { reads(&x, &mut normal) };
        let innovation = filter.update(&mut Joint, &y, Input { u: &[u as f32], time_s: 0.0 });
        reference.update(&mut Joint, &y.map(f64::from), Input { u: &[u], time_s: 0.0 });
        found.nis += f64::from(innovation.nis);
        taken += f64::from(innovation.taken);
        found.left_out += u32::from(innovation.left_out);
        found.events += u32::from(watchdog.look(innovation));
        if k >= 1000 {
            counted += 1.0;
            for i in 0..N {
                let variance = f64::from(filter.covariance().covariance(i, i));
                found.nees[i] += (f64::from(filter.state()[i]) - x[i]).powi(2) / variance;
                found.apart =
                    found.apart.max((f64::from(filter.state()[i]) - reference.state()[i]).abs() / variance.sqrt());
            }
        }
        filter.predict(&mut Joint, Input { u: &[u as f32], time_s: 0.0 }, PERIOD_S as f32);
        reference.predict(&mut Joint, Input { u: &[u], time_s: 0.0 }, PERIOD_S);
        plant(&mut x, input_gain * u, &mut normal);
    }
    assert!(filter.is_sound());
    found.nis /= taken;
    found.nees = found.nees.map(|nees| nees / counted);
    found
}

#[test]
fn innovations_and_errors_are_as_large_as_the_filter_says() {
    let runs: Vec<Found> = (0..8).map(|seed| run(seed, 20, Sensors::Both, 1.0)).collect();
    let count = runs.len() as f64;
    let nis = runs.iter().map(|run| run.nis).sum::<f64>() / count;
    let nees: [f64; N] = std::array::from_fn(|i| runs.iter().map(|run| run.nees[i]).sum::<f64>() / count);
    let apart = runs.iter().map(|run| run.apart).fold(0.0, f64::max);
    std::println!("mean NIS a reading {nis:.4}, NEES {nees:.2?}, f32 apart from f64 {apart:.1e} sigma");
    // 320,000 readings: the mean of χ²₁ is 1 ± 3.3 · √(2/320000) = ± 0.008; twice that for steps that are not exact.
    assert!((nis - 1.0).abs() < 0.016, "{nis}");
    // Errors of a component go on for tens to hundreds of ticks, so that eight runs hold some hundred independent ones.
    assert!(nees.iter().all(|nees| (0.5..1.6).contains(nees)), "{nees:?}");
    assert!(runs.iter().all(|run| run.events == 0 && run.left_out == 0));
    assert!(apart < 0.1, "{apart}");
}

#[test]
fn each_kind_of_sensor_alone_is_consistent() {
    for sensors in [Sensors::Gyros, Sensors::Encoders] {
        let found = run(31, 20, sensors, 1.0);
        std::println!("{sensors:?}: NIS {:.4}, NEES {:.2?}", found.nis, found.nees);
        // 20,000 readings: 3.3 · √(2/20000) = 0.033.
        assert!((found.nis - 1.0).abs() < 0.05 && found.events == 0, "{}", found.nis);
        let moving = if sensors == Sensors::Gyros { [1, 3] } else { [1, 2] };
        assert!(moving.iter().all(|i| (0.1..4.0).contains(&found.nees[*i])), "{:?}", found.nees);
    }
}

#[test]
fn a_motor_that_is_weaker_than_the_model_raises_an_event() {
    let found = run(5, 2, Sensors::Both, 0.7);
    assert_eq!(found.events, 1);
}
