//! The filter, the windows and the free run on a system small enough to know everything about: a spring and a mass.

use std::ops::Range;

use super::filter::{self, ProcessNoise};
use super::free_run;
use super::system::{Columns, System};
use super::window;

/// ẍ = −ω² x + u, exactly discretised; outputs: position and velocity.
#[derive(Clone, Copy)]
struct Oscillator {
    omega: f64,
}

impl Oscillator {
    fn transition(&self, dt: f64) -> [f64; 4] {
        let (s, c) = (self.omega * dt).sin_cos();
        [c, s / self.omega, -s * self.omega, c]
    }
}

impl System for Oscillator {
    fn states(&self) -> usize {
        2
    }

    fn outputs(&self) -> usize {
        2
    }

    fn step(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64]) {
        let rest = u[0] / (self.omega * self.omega);
        let [a, b, c, d] = self.transition(dt_s);
        next[0] = rest + a * (x[0] - rest) + b * x[1];
        next[1] = c * (x[0] - rest) + d * x[1];
    }

    fn step_jacobian(&mut self, x: &[f64], u: &[f64], dt_s: f64, next: &mut [f64], jacobian: &mut [f64]) {
        self.step(x, u, dt_s, next);
        jacobian.copy_from_slice(&self.transition(dt_s));
    }

    fn outputs_of(&mut self, x: &[f64], _: &[f64], outputs: &mut [f64]) {
        outputs.copy_from_slice(x);
    }

    fn outputs_jacobian(&mut self, x: &[f64], _: &[f64], outputs: &mut [f64], jacobian: &mut [f64]) {
        outputs.copy_from_slice(x);
        jacobian.copy_from_slice(&[1.0, 0.0, 0.0, 1.0]);
    }

    fn is_velocity(&self, state: usize) -> bool {
        state == 1
    }

    fn first_guess(&mut self, _: &[f64]) -> (Vec<f64>, Vec<f64>) {
        (vec![0.0; 2], vec![1.0, 10.0])
    }
}

const SIGMA: [f64; 2] = [1e-3, 1e-2];
const PERIOD: f64 = 1e-3;

struct Data {
    t: Vec<f64>,
    duty: Vec<f64>,
    truth: [Vec<f64>; 2],
    measured: [Vec<f64>; 2],
    segments: Vec<Range<usize>>,
}

/// `n` ticks; the ticks of `missing` are lost. `push`: standard deviation of a random change of the velocity per tick.
fn data(n: usize, missing: &[Range<usize>], push: f64) -> Data {
    let mut system = Oscillator { omega: 12.0 };
    let mut noise = Normal(20_160_000);
    let mut x = [0.3, 0.0];
    let mut d = Data { t: vec![], duty: vec![], truth: [vec![], vec![]], measured: [vec![], vec![]], segments: vec![] };
    let mut start = 0;
    for k in 0..n {
        let t = k as f64 * PERIOD;
        let u = 40.0 * (2.0 * t).sin();
        let readings = [x[0] + SIGMA[0] * noise.next(), x[1] + SIGMA[1] * noise.next()];
        if missing.iter().any(|m| m.contains(&k)) {
            if start < d.t.len() {
                d.segments.push(start..d.t.len());
            }
            start = d.t.len();
        } else {
            d.t.push(t);
            d.duty.push(u);
            for i in 0..2 {
                d.truth[i].push(x[i]);
                d.measured[i].push(readings[i]);
            }
        }
        let mut next = [0.0; 2];
        system.step(&x, &[u], PERIOD, &mut next);
        x = [next[0], next[1] + push * noise.next()];
    }
    d.segments.push(start..d.t.len());
    d
}

impl Data {
    fn columns(&self) -> Columns<'_> {
        Columns {
            t_s: &self.t,
            duty: vec![&self.duty],
            measured: self.measured.iter().map(Vec::as_slice).collect(),
            sigma: SIGMA.to_vec(),
            segments: self.segments.clone(),
            period_s: PERIOD,
        }
    }
}

/// Normal deviates from a seed: sum of twelve uniform ones of a linear congruential generator.
struct Normal(u64);

impl Normal {
    fn next(&mut self) -> f64 {
        (0..12)
            .map(|_| {
                self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }
}

#[test]
fn under_the_right_model_predictions_miss_by_the_sensors_noise() {
    let d = data(20_000, &[], 0.0);
    let system = Oscillator { omega: 12.0 };
    let columns = d.columns();
    let track = filter::run(&system, &columns, None);
    assert_eq!(track.noise.velocity_sigma, 1e-6, "the least of the candidates");
    // Measured 1.00; readings are 40,000, so its own deviation is 0.007.
    assert!((0.97..1.03).contains(&track.mean_nis), "{}", track.mean_nis);
    for windows in window::predict(&system, &columns, &track, &[0.01, 0.1, 0.5, 2.0], 2) {
        for (i, sums) in windows.sums.iter().enumerate() {
            let ratio = sums.rmse() / SIGMA[i];
            let (count, horizon) = (sums.count(), windows.horizon_s);
            // Measured 0.94 to 1.06 (the long horizons have 180 windows: deviation 0.05).
            assert!((0.85..1.15).contains(&ratio), "{ratio} sigma over {horizon} s from {count}");
        }
        assert_eq!(windows.touching_gap, 0);
    }
}

#[test]
fn the_noise_that_the_robot_has_is_the_noise_that_the_filter_takes() {
    let d = data(20_000, &[], 1e-3);
    let track = filter::run(&Oscillator { omega: 12.0 }, &d.columns(), None);
    assert_eq!(track.noise.velocity_sigma, 1e-3);
    assert!((0.97..1.03).contains(&track.mean_nis), "{}", track.mean_nis);
    // From what another model needed at least on.
    for (least, taken) in [(1e-5, 1e-3), (1e-3, 1e-3), (1e-2, 1e-2), (1.0, 1e-1)] {
        let least = Some(ProcessNoise { velocity_sigma: least });
        let from_least = filter::run(&Oscillator { omega: 12.0 }, &d.columns(), least);
        assert_eq!(from_least.noise.velocity_sigma, taken);
    }
}

#[test]
fn a_state_knows_nothing_of_what_comes_later() {
    let d = data(4000, &[], 0.0);
    let system = Oscillator { omega: 12.0 };
    let noise = ProcessNoise { velocity_sigma: 1e-4 };
    let whole = filter::run_with(&system, &d.columns(), noise);
    let mut spoilt = data(4000, &[], 0.0);
    for channel in &mut spoilt.measured {
        channel[2001..].fill(99.0);
    }
    spoilt.duty[2001..].fill(-7.0);
    let other = filter::run_with(&system, &spoilt.columns(), noise);
    for k in 0..=2000 {
        assert_eq!(whole.state(k), other.state(k));
    }
    assert_ne!(whole.state(2001), other.state(2001));
}

#[test]
fn a_wrong_model_is_seen_in_the_windows() {
    let d = data(20_000, &[], 0.0);
    let wrong = Oscillator { omega: 12.6 };
    let columns = d.columns();
    let track = filter::run(&wrong, &columns, None);
    let windows = window::predict(&wrong, &columns, &track, &[0.1], 2);
    assert!(windows[0].sums[1].rmse() > 10.0 * SIGMA[1]);
}

#[test]
fn windows_that_touch_a_gap_are_left_out_and_counted() {
    // One lost tick, which the filter bridges, and 0.4 s, after which it starts anew.
    let d = data(10_000, &[3000..3001, 6000..6400], 0.0);
    let system = Oscillator { omega: 12.0 };
    let columns = d.columns();
    let track = filter::run_with(&system, &columns, ProcessNoise { velocity_sigma: 1e-6 });
    assert_eq!(track.restarts, 1);
    let windows = &window::predict(&system, &columns, &track, &[0.1], 2)[0];
    // The starts in the last 100 ms before each gap: five each.
    assert_eq!(windows.touching_gap, 10);
    for &start in &windows.starts {
        let t = d.t[start];
        assert!(!(2.9..3.02).contains(&t) && !(5.9..6.499).contains(&t), "window at {t}");
    }
    for (i, sums) in windows.sums.iter().enumerate() {
        let ratio = sums.rmse() / SIGMA[i];
        assert!((0.85..1.15).contains(&ratio), "{ratio} sigma");
    }
}

#[test]
fn the_free_run_starts_again_after_gaps() {
    let d = data(10_000, &[3000..3001, 6000..6400], 0.0);
    let system = Oscillator { omega: 12.0 };
    let columns = d.columns();
    let track = filter::run_with(&system, &columns, ProcessNoise { velocity_sigma: 1e-6 });
    let first = [d.truth[0][0], d.truth[1][0]];
    let run = free_run::run(&system, &columns, Some(&first), &track);
    assert_eq!(run.pieces, [0..3000, 3000..5999, 6099..9599]);
    assert_eq!(run.left_out, 100, "the filter's settling after the long gap");
    for k in 0..columns.len() {
        let predicted = run.outputs[1][k];
        if (5999..6099).contains(&k) {
            assert!(predicted.is_nan());
        } else {
            // Before the first gap exact to rounding; afterwards to what the filter knows: a few tenths of a sigma.
            let atol = if k < 3000 { 1e-9 } else { 5e-3 };
            assert!((predicted - d.truth[1][k]).abs() < atol, "{k}");
        }
    }
}

/// Shows what time it is, and nothing else.
#[derive(Clone, Copy)]
struct Clock {
    time_s: f64,
}

impl System for Clock {
    fn states(&self) -> usize {
        1
    }

    fn at_time(&mut self, time_s: f64) {
        self.time_s = time_s;
    }

    fn outputs(&self) -> usize {
        1
    }

    fn step(&mut self, x: &[f64], _: &[f64], _: f64, next: &mut [f64]) {
        next.copy_from_slice(x);
    }

    fn step_jacobian(&mut self, x: &[f64], _: &[f64], _: f64, next: &mut [f64], jacobian: &mut [f64]) {
        next.copy_from_slice(x);
        jacobian[0] = 1.0;
    }

    fn outputs_of(&mut self, x: &[f64], _: &[f64], outputs: &mut [f64]) {
        outputs[0] = x[0] + self.time_s;
    }

    fn outputs_jacobian(&mut self, x: &[f64], u: &[f64], outputs: &mut [f64], jacobian: &mut [f64]) {
        self.outputs_of(x, u, outputs);
        jacobian[0] = 1.0;
    }

    fn is_velocity(&self, _: usize) -> bool {
        false
    }

    fn first_guess(&mut self, _: &[f64]) -> (Vec<f64>, Vec<f64>) {
        (vec![0.0], vec![1e-9])
    }
}

/// What changes as a motion goes on goes on in a part of its recording.
#[test]
fn a_part_of_a_recording_is_predicted_at_the_time_of_the_whole() {
    let t: Vec<f64> = (0..3000).map(|k| 16.7 + f64::from(k) * PERIOD).collect();
    let rest = vec![0.0; t.len()];
    let columns = Columns {
        t_s: &t,
        duty: vec![&rest],
        measured: vec![&t],
        sigma: vec![1e-3],
        segments: std::iter::once(0..t.len()).collect(),
        period_s: PERIOD,
    };
    let system = Clock { time_s: f64::NAN };
    let track = filter::run_with(&system, &columns, ProcessNoise { velocity_sigma: 1e-6 });
    let windows = window::predict(&system, &columns, &track, &[0.1], 2);
    assert!(windows[0].starts.len() > 10);
    // A clock that began with the part would be 16.7 s late.
    assert!(windows[0].errors[0].iter().all(|error| error.abs() < 1e-6), "{:?}", windows[0].errors);
    let run = free_run::run(&system, &columns, Some(&[0.0]), &track);
    assert!(run.outputs[0].iter().zip(&t).all(|(shown, t)| (shown - t).abs() < 1e-9));
}
