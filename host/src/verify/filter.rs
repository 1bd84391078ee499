//! The state at each sample from the readings up to it: an extended Kalman filter running forward.
//!
//! ```text
//!   sample k:   z_k ─▶ update ─▶ x_k|k  (kept: what a prediction may start from)
//!               u_k ─▶ predict ─▶ x_k+1|k            never a smoothed state, nothing from after t_k
//! ```
//!
//! **Process noise.** A filter with the paper's (36) trusts its model so little that velocities follow the gyros' noise,
//! and predictions over 100 ms start wrong. The model's own error in a step is far smaller: the difference between one
//! step of Δt and two of Δt/2 (the integrator's error), and a random push on the velocities of standard deviation
//! [`velocity_sigma`](ProcessNoise::velocity_sigma) a period. How large the latter is depends on how well the model fits
//! the robot, so it is the one of [`CANDIDATES`] under which the readings are most likely. That one number is chosen
//! from the whole recording; the states are not.
//!
//! **Gaps.** Over a gap up to [`BRIDGED_S`] the filter predicts with the last known input and as much uncertainty as an
//! unknown input brings; after a longer one it starts anew. States count as settled [`SETTLING_S`] after a start and
//! [`SETTLING_AFTER_BRIDGE_S`] after a bridge.

use nalgebra::{DMatrix, DVector};

use super::system::{Columns, System};

/// Gaps up to this long are bridged, s.
pub const BRIDGED_S: f64 = 0.05;

/// Time after a start or a gap before predictions start from the filter's states, s.
pub const SETTLING_S: f64 = 0.1;

/// The same after a gap that was bridged, s: the state is known but for what an unknown input did meanwhile.
pub const SETTLING_AFTER_BRIDGE_S: f64 = 0.02;

/// Standard deviations tried for the random push on each velocity in one period, rad/s (m/s).
pub const CANDIDATES: [f64; 6] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1];

/// What the filter allows the model to be wrong by in one step, beside the integrator's own error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProcessNoise {
    /// Standard deviation of the random change of each velocity in one nominal period, rad/s (m/s).
    pub velocity_sigma: f64,
}

/// What the filter made of a recording.
#[derive(Debug, Clone)]
pub struct Track {
    states: usize,
    values: Vec<f64>,
    settled: Vec<bool>,
    started: Vec<bool>,
    /// Σ over all readings of −½ (ν²/S + ln S + ln 2π), ν the difference to the prediction, S its variance.
    pub log_likelihood: f64,
    /// Mean of ν²/S: 1 if the filter's uncertainty is the true one.
    pub mean_nis: f64,
    /// Times that the filter had to start anew.
    pub restarts: usize,
    /// The noise it ran with.
    pub noise: ProcessNoise,
}

impl Track {
    /// The state at sample k from the readings up to and including k.
    pub fn state(&self, k: usize) -> &[f64] {
        &self.values[k * self.states..(k + 1) * self.states]
    }

    /// Whether enough readings came before sample k since the last start and the last gap.
    pub fn is_settled(&self, k: usize) -> bool {
        self.settled[k]
    }

    /// Whether enough readings came before sample k since the last start, gaps that were bridged or not.
    pub fn has_started(&self, k: usize) -> bool {
        self.started[k]
    }
}

/// Runs the filter with the process noise of [`CANDIDATES`] that makes the readings most likely.
///
/// Candidates are tried from the least on, two at a time, until they get less likely.
pub fn run<S: System>(system: &S, columns: &Columns<'_>) -> Track {
    let mut best: Option<Track> = None;
    for pair in CANDIDATES.chunks(2) {
        let tracks: Vec<Track> = std::thread::scope(|scope| {
            let start = |&velocity_sigma: &f64| {
                let own = system.clone();
                scope.spawn(move || run_with(&own, columns, ProcessNoise { velocity_sigma }))
            };
            let handles: Vec<_> = pair.iter().map(start).collect();
            let join = |handle: std::thread::ScopedJoinHandle<'_, Track>| {
                handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            handles.into_iter().map(join).collect()
        });
        let last = pair[pair.len() - 1];
        // A filter that ran away (NaN) is the least likely of all.
        let rank = |track: &Track| if track.log_likelihood.is_nan() { f64::NEG_INFINITY } else { track.log_likelihood };
        best = best.into_iter().chain(tracks).max_by(|a, b| rank(a).total_cmp(&rank(b)));
        if best.as_ref().is_some_and(|best| best.noise.velocity_sigma != last && rank(best).is_finite()) {
            break;
        }
    }
    best.expect("there is at least one candidate")
}

/// Runs the filter with the process noise given.
pub fn run_with<S: System>(system: &S, columns: &Columns<'_>, noise: ProcessNoise) -> Track {
    let mut filter = Filter::new(system, columns, noise);
    let n = columns.len();
    let mut values = Vec::with_capacity(n * system.states());
    let mut settled = Vec::with_capacity(n);
    let mut restarts = 0usize;
    let mut started = Vec::with_capacity(n);
    let (mut started_at, mut settled_at) = (0.0_f64, 0.0_f64);
    let mut u = vec![0.0; columns.duty.len()];
    for (number, segment) in columns.segments.iter().enumerate() {
        for k in segment.clone() {
            let t = columns.t_s[k];
            if k == segment.start {
                let bridged = number > 0 && filter.bridge(t - columns.t_s[k - 1], &u);
                if bridged {
                    settled_at = settled_at.max(t + SETTLING_AFTER_BRIDGE_S);
                } else {
                    restarts += 1;
                    started_at = t + SETTLING_S;
                    settled_at = started_at;
                    columns.readings(k, &mut filter.z);
                    filter.start();
                }
            }
            columns.readings(k, &mut filter.z);
            columns.input(k, &mut u);
            filter.system.at_time(t);
            filter.update(&u);
            values.extend_from_slice(filter.x.as_slice());
            // Half a period of tolerance, so that rounding of time stamps does not decide.
            settled.push(t > settled_at - 0.5 * columns.period_s);
            started.push(t > started_at - 0.5 * columns.period_s);
            if k + 1 < segment.end {
                filter.predict(&u, columns.t_s[k + 1] - t);
            }
        }
    }
    Track {
        states: system.states(),
        values,
        settled,
        started,
        log_likelihood: filter.log_likelihood,
        mean_nis: filter.squares / filter.readings.max(1) as f64,
        restarts: restarts.saturating_sub(1),
        noise,
    }
}

struct Filter<'a, S> {
    system: S,
    noise: ProcessNoise,
    period_s: f64,
    sigma: &'a [f64],
    /// Largest |u| of each joint in the recording: what an unknown input may be.
    largest_input: Vec<f64>,
    x: DVector<f64>,
    p: DMatrix<f64>,
    z: Vec<f64>,
    log_likelihood: f64,
    squares: f64,
    readings: usize,
    work: Work,
}

/// Buffers, so that a run does not allocate.
struct Work {
    next: Vec<f64>,
    half: Vec<f64>,
    halves: Vec<f64>,
    jacobian: Vec<f64>,
    transposed: DMatrix<f64>,
    product: DMatrix<f64>,
    outputs: Vec<f64>,
    rows: Vec<f64>,
    gain: Vec<f64>,
    change: Vec<f64>,
}

impl<'a, S: System> Filter<'a, S> {
    fn new(system: &'a S, columns: &'a Columns<'_>, noise: ProcessNoise) -> Self {
        let (n, m) = (system.states(), system.outputs());
        let peak = |u: &&[f64]| u.iter().fold(0.0, |peak: f64, u| peak.max(u.abs()));
        Self {
            system: system.clone(),
            noise,
            period_s: columns.period_s,
            sigma: &columns.sigma,
            largest_input: columns.duty.iter().map(peak).collect(),
            x: DVector::zeros(n),
            p: DMatrix::zeros(n, n),
            z: vec![f64::NAN; m],
            log_likelihood: 0.0,
            squares: 0.0,
            readings: 0,
            work: Work {
                next: vec![0.0; n],
                half: vec![0.0; n],
                halves: vec![0.0; n],
                jacobian: vec![0.0; n * n],
                transposed: DMatrix::zeros(n, n),
                product: DMatrix::zeros(n, n),
                outputs: vec![0.0; m],
                rows: vec![0.0; m * n],
                gain: vec![0.0; n],
                change: vec![0.0; n],
            },
        }
    }

    /// From the readings in `z` alone.
    fn start(&mut self) {
        let (mean, deviation) = self.system.first_guess(&self.z);
        self.x.copy_from_slice(&mean);
        self.p.fill(0.0);
        for (i, d) in deviation.iter().enumerate() {
            self.p[(i, i)] = d * d;
        }
    }

    /// Takes in the readings one by one, which is the same as all at once since their noises are independent.
    fn update(&mut self, u: &[f64]) {
        let n = self.x.len();
        let w = &mut self.work;
        self.system.outputs_jacobian(self.x.as_slice(), u, &mut w.outputs, &mut w.rows);
        w.change.fill(0.0);
        for (i, (z, sigma)) in self.z.iter().zip(self.sigma).enumerate() {
            if z.is_nan() {
                continue;
            }
            let row = &w.rows[i * n..(i + 1) * n];
            let mut variance = sigma * sigma;
            for a in 0..n {
                w.gain[a] = (0..n).map(|b| self.p[(a, b)] * row[b]).sum();
                variance += row[a] * w.gain[a];
            }
            let expected: f64 = w.outputs[i] + (0..n).map(|a| row[a] * w.change[a]).sum::<f64>();
            let innovation = z - expected;
            let nis = innovation * innovation / variance;
            self.log_likelihood -= 0.5 * (nis + (std::f64::consts::TAU * variance).ln());
            self.squares += nis;
            self.readings += 1;
            for a in 0..n {
                w.change[a] += w.gain[a] * innovation / variance;
            }
            for b in 0..n {
                for a in 0..n {
                    self.p[(a, b)] -= w.gain[a] * w.gain[b] / variance;
                }
            }
        }
        for (x, change) in self.x.iter_mut().zip(&w.change) {
            *x += change;
        }
    }

    /// One step of the model, and what it may be wrong by.
    fn predict(&mut self, u: &[f64], dt_s: f64) {
        let n = self.x.len();
        let w = &mut self.work;
        let x = self.x.as_slice();
        self.system.step_jacobian(x, u, dt_s, &mut w.next, &mut w.jacobian);
        self.system.step(x, u, 0.5 * dt_s, &mut w.half);
        self.system.step(&w.half, u, 0.5 * dt_s, &mut w.halves);
        // Row-major F read column by column is Fᵀ.
        w.transposed.copy_from_slice(&w.jacobian);
        w.product.gemm_tr(1.0, &w.transposed, &self.p, 0.0);
        self.p.gemm(1.0, &w.product, &w.transposed, 0.0);
        let push = self.noise.velocity_sigma * (dt_s / self.period_s).sqrt();
        for i in 0..n {
            let error = w.next[i] - w.halves[i];
            let push = if self.system.is_velocity(i) { push } else { 0.0 };
            self.p[(i, i)] += error * error + push * push;
        }
        for b in 0..n {
            for a in 0..b {
                let mean = 0.5 * (self.p[(a, b)] + self.p[(b, a)]);
                self.p[(a, b)] = mean;
                self.p[(b, a)] = mean;
            }
        }
        self.x.copy_from_slice(&w.next);
    }

    /// Predicts over a gap of `dt_s` after a sample with the input `u`, which is known for one period only.
    /// `false` if the gap is too long.
    fn bridge(&mut self, dt_s: f64, u: &[f64]) -> bool {
        if dt_s > BRIDGED_S {
            return false;
        }
        let periods = ((dt_s / self.period_s).round() as usize).max(1);
        let dt_s = dt_s / periods as f64;
        self.predict(u, dt_s);
        for _ in 1..periods {
            let before = self.x.clone();
            self.predict(u, dt_s);
            for j in 0..u.len() {
                self.add_unknown_input(before.as_slice(), u, j, dt_s);
            }
        }
        true
    }

    /// P += (∂x/∂u_j · largest u_j)² for an input that may have been anything.
    fn add_unknown_input(&mut self, before: &[f64], u: &[f64], j: usize, dt_s: f64) {
        let largest = self.largest_input[j];
        if largest == 0.0 {
            return;
        }
        let mut other = u.to_vec();
        other[j] += largest;
        let w = &mut self.work;
        self.system.step(before, &other, dt_s, &mut w.next);
        let effect = DVector::from_iterator(self.x.len(), w.next.iter().zip(self.x.iter()).map(|(a, b)| a - b));
        self.p.ger(1.0, &effect, &effect, 1.0);
    }
}
