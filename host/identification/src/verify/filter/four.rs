//! Four extended Kalman filters side by side: the same model and readings, another process noise in each lane.

use solve::simd::{LANES, Quad, vectorised};

use super::super::system::{Columns, Four, System, lane_of, set_lane};
use super::BRIDGED_S;
use super::covariance::{Carry, TakeIn};

/// The filters at one sample.
pub(super) struct Filters<'a, S> {
    system: S,
    columns: &'a Columns<'a>,
    velocity_sigma: Quad,
    /// Largest |u| of each joint in the recording: what an unknown input may be.
    largest_input: Vec<f64>,
    four: Four,
    /// Covariances, states × states.
    p: Vec<Quad>,
    z: Vec<f64>,
    /// See [`Track`](super::Track).
    pub log_likelihood: Quad,
    /// Σ ν²/S.
    pub squares: Quad,
    /// So many readings.
    pub readings: usize,
    room: Room,
}

/// Buffers, so that a run does not allocate.
struct Room {
    next: Vec<Quad>,
    jacobian: Vec<Quad>,
    half: Four,
    halves: Vec<Quad>,
    product: Vec<Quad>,
    outputs: Vec<Quad>,
    rows: Vec<Quad>,
    gain: Vec<Quad>,
    change: Vec<Quad>,
    own_x: Vec<f64>,
    own_u: Vec<f64>,
    own_outputs: Vec<f64>,
    own_rows: Vec<f64>,
}

impl<'a, S: System> Filters<'a, S> {
    /// With these standard deviations; lanes that are left over repeat the last one.
    pub(super) fn new(system: &S, columns: &'a Columns<'_>, velocity_sigma: &[f64]) -> Self {
        let (n, m, inputs) = (system.states(), system.outputs(), columns.duty.len());
        let peak = |u: &&[f64]| u.iter().fold(0.0, |peak: f64, u| peak.max(u.abs()));
        let quads = |count: usize| vec![Quad::default(); count];
        let last = velocity_sigma.len().saturating_sub(1);
        let sigma = |lane: usize| velocity_sigma.get(lane.min(last)).copied().unwrap_or(0.0);
        Self {
            system: system.clone(),
            columns,
            velocity_sigma: Quad(std::array::from_fn(sigma)),
            largest_input: columns.duty.iter().map(peak).collect(),
            four: Four::new(n, inputs),
            p: quads(n * n),
            z: vec![f64::NAN; m],
            log_likelihood: Quad::default(),
            squares: Quad::default(),
            readings: 0,
            room: Room {
                next: quads(n),
                jacobian: quads(n * n),
                half: Four::new(n, inputs),
                halves: quads(n),
                product: quads(n * n),
                outputs: quads(m),
                rows: quads(m * n),
                gain: quads(n),
                change: quads(n),
                own_x: vec![0.0; n],
                own_u: vec![0.0; inputs],
                own_outputs: vec![0.0; m],
                own_rows: vec![0.0; m * n],
            },
        }
    }

    /// The states, one quad a component.
    pub(super) fn states(&self) -> &[Quad] {
        &self.four.x
    }

    /// Takes the readings of sample k up.
    pub(super) fn read(&mut self, k: usize) {
        self.columns.readings(k, &mut self.z);
    }

    /// From the readings alone.
    pub(super) fn start(&mut self) {
        let (mean, deviation) = self.system.first_guess(&self.z);
        let n = mean.len();
        self.p.fill(Quad::default());
        for (i, (mean, deviation)) in mean.iter().zip(&deviation).enumerate() {
            self.four.x[i] = Quad([*mean; LANES]);
            self.p[i * n + i] = Quad([deviation * deviation; LANES]);
        }
    }

    /// Takes in the readings of sample k one by one, which is the same as all at once since their noises are independent.
    pub(super) fn update(&mut self, k: usize) {
        let Filters { system, columns, four, p, z, log_likelihood, squares, readings, room, .. } = self;
        columns.input(k, &mut room.own_u);
        system.at_time(columns.t_s[k]);
        for lane in 0..LANES {
            for (own, x) in room.own_x.iter_mut().zip(&four.x) {
                *own = x.0[lane];
            }
            system.outputs_jacobian(&room.own_x, &room.own_u, &mut room.own_outputs, &mut room.own_rows);
            set_lane(&mut room.outputs, lane, &room.own_outputs);
            set_lane(&mut room.rows, lane, &room.own_rows);
        }
        *readings += z.iter().filter(|z| !z.is_nan()).count();
        let [nis, logs] = vectorised(TakeIn {
            x: &mut four.x,
            p,
            readings: (z, &columns.sigma),
            predicted: (&room.outputs, &room.rows),
            room: (&mut room.gain, &mut room.change),
        });
        for lane in 0..LANES {
            squares.0[lane] += nis.0[lane];
            log_likelihood.0[lane] -= 0.5 * (nis.0[lane] + logs.0[lane]);
        }
    }

    /// One step of the model from sample k, and what it may be wrong by.
    pub(super) fn predict(&mut self, k: usize, dt_s: f64) {
        let Filters { system, columns, velocity_sigma, four, p, room, .. } = self;
        columns.input(k, &mut room.own_u);
        for (u, own) in four.u.iter_mut().zip(&room.own_u) {
            *u = Quad([*own; LANES]);
        }
        (four.time_s, four.dt_s) = (Quad([columns.t_s[k]; LANES]), Quad([dt_s; LANES]));
        system.step_jacobian_four(four, &mut room.next, &mut room.jacobian);
        room.half.x.copy_from_slice(&four.x);
        room.half.u.copy_from_slice(&four.u);
        (room.half.time_s, room.half.dt_s) = (four.time_s, Quad([0.5 * dt_s; LANES]));
        system.step_four(&room.half, &mut room.halves);
        room.half.x.copy_from_slice(&room.halves);
        system.step_four(&room.half, &mut room.halves);
        vectorised(Carry { jacobian: &room.jacobian, p, product: &mut room.product });
        let periods = dt_s / columns.period_s;
        let n = four.x.len();
        for i in 0..n {
            let is_velocity = system.is_velocity(i);
            for lane in 0..LANES {
                let error = room.next[i].0[lane] - room.halves[i].0[lane];
                let push = if is_velocity { velocity_sigma.0[lane].powi(2) * periods } else { 0.0 };
                p[i * n + i].0[lane] += error * error + push;
            }
        }
        std::mem::swap(&mut four.x, &mut room.next);
    }

    /// Predicts over a gap of `dt_s` behind sample k, whose input is known for one period only. `false` if the gap is too long.
    pub(super) fn bridge(&mut self, dt_s: f64, k: usize) -> bool {
        if dt_s > BRIDGED_S {
            return false;
        }
        let periods = ((dt_s / self.columns.period_s).round() as usize).max(1);
        let dt_s = dt_s / periods as f64;
        self.predict(k, dt_s);
        for _ in 1..periods {
            let before = self.four.clone();
            self.predict(k, dt_s);
            for j in 0..self.largest_input.len() {
                self.add_unknown_input(&before, j);
            }
        }
        true
    }

    /// P += (∂x/∂u_j · largest u_j)² for an input that may have been anything in the step from `before`.
    fn add_unknown_input(&mut self, before: &Four, j: usize) {
        let largest = self.largest_input[j];
        if largest == 0.0 {
            return;
        }
        let mut other = before.clone();
        other.u.clone_from(&self.four.u);
        (other.time_s, other.dt_s) = (self.four.time_s, self.four.dt_s);
        other.u[j].0.iter_mut().for_each(|u| *u += largest);
        self.system.step_four(&other, &mut self.room.next);
        let n = self.four.x.len();
        for lane in 0..LANES {
            let [with, without] = [&self.room.next, &self.four.x].map(|quads| lane_of(quads, lane));
            for i in 0..n {
                for l in 0..n {
                    self.p[i * n + l].0[lane] += (with[i] - without[i]) * (with[l] - without[l]);
                }
            }
        }
    }
}
