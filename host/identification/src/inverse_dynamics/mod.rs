//! Torques of a rigid robot along filtered differences of its positions, and least squares of its parameters on them.
//!
//! ```text
//! position ─▶ low-pass without phase ─▶ central differences: q̇, q̈ ─▶ torque that the motion needs ┐
//! input ───────────────────────────────────────────────────────────▶ torque of the motor ──────────┴─▶ both filtered, every n-th sample
//! ```
//! The recipe of inverse dynamics identification (Gautier; Janot, Vandanjon, Gautier 2014): torques are linear in the parameters, so that the answer does
//! not depend on where it starts. A calibration of a rigid robot starts from it, and `verify --metric torque` compares with it.
//!
//! The corner of the low-pass is chosen from the torques ([`corner`]): the highest one whose motion explains the torques as they were read.

mod corner;
mod lowpass;
mod robust;

use nalgebra::{DMatrix, DVector};

use crate::model::{Dynamics, Input, Model};
pub use corner::{Cornered, HIGHEST_CORNER, corner};
use lowpass::Lowpass;
pub use robust::Loss;

/// Before samples are dropped torques are filtered at this share of what is then half the sampling frequency.
const DECIMATION_SHARE: f64 = 0.8;
/// Fewest torques that are kept of a run.
const FEWEST_KEPT: usize = 200;
/// Samples at the ends of a run that differences do not reach or filters have not settled in.
const MARGIN: usize = 20;
/// Shorter runs are left out.
pub const SHORTEST_RUN: usize = 200;
/// Torques are linear in the parameters of the base model; laws may need a few rounds.
const ROUNDS: usize = 6;
/// Share of what is left that a step still promises to take at which rounds end; weights of a robust loss change a little with every one.
const STILL: f64 = 1e-9;
const STILL_ROBUST: f64 = 1e-3;
/// Directions of the parameters that show less than this share of the strongest one stay where they were.
const LEAST_SHARE: f64 = 1e-9;

/// Readings of a run without a gap: a column for each joint.
#[derive(Debug, Clone, Default)]
pub struct Readings {
    /// rad or m.
    pub positions: Vec<Vec<f64>>,
    /// In the robot's input unit, as they act.
    pub inputs: Vec<Vec<f64>>,
    /// Since the start of the motion, s.
    pub time_s: Vec<f64>,
}

/// A run: states, accelerations and inputs, `[k · joints + j]`.
#[derive(Debug)]
struct Run {
    states: Vec<f64>,
    accelerations: Vec<f64>,
    inputs: Vec<f64>,
    time_s: Vec<f64>,
}

/// A motion by filtered differences.
#[derive(Debug)]
pub struct Motion {
    joints: usize,
    runs: Vec<Run>,
    /// Corner of the positions' filter over the sampling frequency.
    corner: f64,
    /// Of so many samples one is kept.
    decimation: usize,
}

/// The torques that links need along a motion, of each run `[k · joints + j]`: most parameters change the drives alone.
struct Needed<'m> {
    /// Whose links.
    of: Dynamics<'m>,
    runs: Vec<Vec<f64>>,
}

/// Parameters by least squares of torques.
#[derive(Debug)]
pub struct Identified {
    /// Solver coordinates.
    pub z: Vec<f64>,
    /// Of these; zero for those that the torques do not show.
    pub covariance: DMatrix<f64>,
}

impl Motion {
    /// The motion of these runs with positions filtered at `corner`, a share of the sampling frequency. None where no run is long enough.
    pub fn of(readings: &[Readings], corner: f64) -> Option<Self> {
        let filter = Lowpass::butterworth(corner);
        let mut runs = Vec::new();
        for of in readings.iter().filter(|of| of.time_s.len() >= SHORTEST_RUN) {
            let (samples, time) = (of.time_s.len(), &of.time_s);
            let filtered: Vec<Vec<f64>> = of.positions.iter().map(|column| filter.zero_phase(column)).collect();
            let difference = |values: &[f64]| -> Vec<f64> {
                let inner = (1..samples - 1).map(|k| (values[k + 1] - values[k - 1]) / (time[k + 1] - time[k - 1]));
                std::iter::once(0.0).chain(inner).chain(std::iter::once(0.0)).collect()
            };
            let speeds: Vec<Vec<f64>> = filtered.iter().map(|column| difference(column)).collect();
            let accelerations: Vec<Vec<f64>> = speeds.iter().map(|column| difference(column)).collect();
            let inner = MARGIN..samples - MARGIN;
            let by_sample = |columns: &[&[Vec<f64>]]| -> Vec<f64> {
                inner.clone().flat_map(|k| columns.iter().flat_map(move |of| of.iter().map(move |c| c[k]))).collect()
            };
            runs.push(Run {
                states: by_sample(&[&filtered, &speeds]),
                accelerations: by_sample(&[&accelerations]),
                inputs: by_sample(&[&of.inputs]),
                time_s: time[inner.clone()].to_vec(),
            });
        }
        let joints = readings.first()?.positions.len();
        let longest = runs.iter().map(|run| run.time_s.len()).max()?;
        let decimation = ((1.0 / corner).round() as usize).clamp(1, (longest / FEWEST_KEPT).max(1));
        Some(Motion { joints, runs, corner, decimation })
    }

    /// Corner of the positions' filter over the sampling frequency.
    pub fn corner(&self) -> f64 {
        self.corner
    }

    /// Of so many samples one is kept.
    pub fn decimation(&self) -> usize {
        self.decimation
    }

    /// Kept samples of one joint.
    pub fn rows(&self) -> usize {
        self.runs.iter().map(|run| run.time_s.len().div_ceil(self.decimation)).sum()
    }

    /// What the motors' torques miss at `z`, filtered and decimated, joint by joint; without the motors' torque where `driven` is false. The model has no
    /// elastic joints, no states of laws and no errors of inputs.
    pub fn missing(&self, model: &Model, z: &[f64], driven: bool) -> Vec<Vec<f64>> {
        let needed = self.needed(model.at(z));
        self.every(self.decimation, &needed.of, &needed, driven)
    }

    /// Standard deviation of what the motors' torques miss at `z`, joint by joint, with all that inputs have of noise; a few torques that are missed by far do
    /// not count.
    pub fn missing_scale(&self, model: &Model, z: &[f64]) -> Vec<f64> {
        let needed = self.needed(model.at(z));
        self.every(1, &needed.of, &needed, true).iter().map(|missing| robust::scale(missing)).collect()
    }

    /// Of each joint, whether torques that are known set the scale of the others, as those of a body's weight do: with all parameters zero more is missing than at `z`.
    pub fn is_scaled(&self, model: &Model, z: &[f64]) -> Vec<bool> {
        let known = self.missing_scale(model, &vec![0.0; z.len()]);
        known.iter().zip(self.missing_scale(model, z)).map(|(known, left)| *known > left).collect()
    }

    /// What links need along the motion.
    fn needed<'m>(&self, of: Dynamics<'m>) -> Needed<'m> {
        let n = self.joints;
        let along = |run: &Run| {
            let mut needed = vec![0.0; run.accelerations.len()];
            for (k, needed) in needed.chunks_exact_mut(n).enumerate() {
                let accelerations = &run.accelerations[k * n..(k + 1) * n];
                of.needed_torque(&run.states[2 * k * n..2 * (k + 1) * n], accelerations, needed);
            }
            needed
        };
        let runs = self.runs.iter().map(along).collect();
        Needed { of, runs }
    }

    /// [`Self::missing`] at other coordinates, whose links may be those of `needed`.
    fn missing_beside(&self, model: &Model, z: &[f64], needed: &Needed<'_>) -> Vec<Vec<f64>> {
        let dynamics = model.at(z);
        if dynamics.has_links_of(&needed.of) {
            return self.every(self.decimation, &dynamics, needed, true);
        }
        self.missing(model, z, true)
    }

    fn every(&self, decimation: usize, dynamics: &Dynamics<'_>, needed: &Needed<'_>, driven: bool) -> Vec<Vec<f64>> {
        let n = self.joints;
        let mut out = vec![Vec::with_capacity(self.rows()); n];
        let nothing = vec![0.0; n];
        let decimate = (decimation > 1).then(|| Lowpass::chebyshev(0.5 * DECIMATION_SHARE / decimation as f64));
        for (run, needed) in self.runs.iter().zip(&needed.runs) {
            let mut columns = vec![Vec::with_capacity(run.time_s.len()); n];
            let mut missing = vec![0.0; n];
            for (k, &time_s) in run.time_s.iter().enumerate() {
                let u = if driven { &run.inputs[k * n..(k + 1) * n] } else { &nothing };
                let input = Input { u, by_delay: &[], time_s };
                let accelerations = &run.accelerations[k * n..(k + 1) * n];
                let x = &run.states[2 * k * n..2 * (k + 1) * n];
                dynamics.missing_of(&needed[k * n..(k + 1) * n], (x, input), accelerations, &mut missing);
                columns.iter_mut().zip(&missing).for_each(|(column, missing)| column.push(*missing));
            }
            for (out, column) in out.iter_mut().zip(columns) {
                match &decimate {
                    Some(filter) => out.extend(filter.zero_phase(&column).into_iter().step_by(decimation)),
                    None => out.extend(column),
                }
            }
        }
        out
    }

    /// Least squares of the torques from `z` on, joints weighted by what is left of theirs, equations by `loss`. What is `held` stays.
    pub fn identify(&self, model: &Model, z: &[f64], held: &[usize], loss: Loss) -> Identified {
        let unknowns = z.len();
        let mut z = z.to_vec();
        let mut covariance = DMatrix::zeros(unknowns, unknowns);
        for _ in 0..ROUNDS {
            let needed = self.needed(model.at(&z));
            let missing = self.every(self.decimation, &needed.of, &needed, true);
            let size = |m: &[f64]| {
                let scale = if loss == Loss::Bisquare { robust::scale(m) } else { 0.0 };
                if scale > 0.0 { scale } else { norm(m) / (m.len() as f64).sqrt() }
            };
            let weights: Vec<f64> = missing.iter().map(|m| 1.0 / size(m).max(f64::MIN_POSITIVE)).collect();
            let weighted = |columns: &[Vec<f64>]| -> Vec<f64> {
                columns.iter().zip(&weights).flat_map(|(column, w)| column.iter().map(move |value| w * value)).collect()
            };
            let mut residual = DVector::from_vec(weighted(&missing));
            let mut columns = DMatrix::zeros(residual.len(), unknowns);
            let mut scale = vec![1.0; unknowns];
            for i in (0..unknowns).filter(|i| !held.contains(i)) {
                // The torques are linear in most of them: a large step loses no digits.
                let by = 1e-2 * z[i].abs().max(1e-2);
                let mut moved = z.clone();
                moved[i] += by;
                let column =
                    (DVector::from_vec(weighted(&self.missing_beside(model, &moved, &needed))) - &residual) / by;
                scale[i] = column.norm().max(f64::MIN_POSITIVE);
                columns.set_column(i, &(column / scale[i]));
            }
            let groups: Vec<usize> = missing.iter().map(Vec::len).collect();
            if loss == Loss::Bisquare
                && let Some(roots) = robust::root_weights(&columns, &residual, &groups, LEAST_SHARE)
            {
                residual.component_mul_assign(&roots);
                columns.column_iter_mut().for_each(|mut column| column.component_mul_assign(&roots));
            }
            let svd = columns.clone().svd(true, true);
            let least = LEAST_SHARE.sqrt() * svd.singular_values.max();
            let Ok(step) = svd.solve(&residual, least) else { break };
            let promised = step.norm() / residual.norm().max(f64::MIN_POSITIVE);
            for (z, (step, scale)) in z.iter_mut().zip(step.iter().zip(&scale)) {
                *z -= step / scale;
            }
            if let Some(v_t) = &svd.v_t {
                let seen = svd.singular_values.map(|s| if s > least { 1.0 / (s * s) } else { 0.0 });
                let mut inverse = v_t.transpose() * DMatrix::from_diagonal(&seen) * v_t;
                if loss == Loss::Bisquare {
                    let left = &residual - &columns * &step;
                    inverse = &inverse * robust::between_blocks(&columns, &left, &groups) * &inverse;
                }
                covariance = DMatrix::from_fn(unknowns, unknowns, |i, j| inverse[(i, j)] / (scale[i] * scale[j]));
            }
            if promised < if loss == Loss::Squares { STILL } else { STILL_ROBUST } {
                break;
            }
        }
        Identified { z, covariance }
    }
}

/// √ Σ x².
pub fn norm(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum::<f64>().sqrt()
}
