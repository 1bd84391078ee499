//! Sensor models: encoders with dead time, eccentricity, noise and quantisation; gyros with a second-order filter, scale errors, a range and a drifting
//! bias.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use host::robot::{Encoder, Gyro, Side};
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;

use super::machine::Fidelity;
use super::noise::{Coloured, normal};

/// Coloured noise of a sensor in the wrong world, as a share of its σ, and its correlation time, s.
const COLOURED_SHARE: f64 = 0.5;
const COLOURED_S: f64 = 8e-3;
/// Group delay of the filter of a gyro without effects, s.
const GYRO_DELAY_S: f64 = 0.1e-3;
/// Of the two poles of a gyro's filter, the first has this share of the group delay.
const FIRST_POLE: f64 = 0.6;
/// Updates of a gyro's filter in a step.
const FILTER_PARTS: usize = 8;
/// Counts of a gyro to its range.
const GYRO_COUNTS: f64 = 32768.0;
/// The second harmonic of an eccentric disc, as a share of the first.
const SECOND_TURN: f64 = 0.1;

/// An encoder.
#[derive(Debug, Clone)]
pub struct EncoderTruth {
    /// Of the motor or of the link.
    pub side: Side,
    /// Whose, 0-based.
    pub joint: usize,
    /// One count, rad or m.
    pub count: f64,
    /// Noise before it is quantised.
    pub sigma: f64,
    /// What it reads at zero.
    pub zero: f64,
    /// e sin(θ + φ) with a second harmonic: rad.
    pub eccentricity: [f64; 2],
    /// Dead time, s.
    pub lag_s: f64,
}

/// A gyro.
#[derive(Debug, Clone)]
pub struct GyroTruth {
    /// The joint that moves it, 0-based.
    pub body: usize,
    /// Body axes → sensor axes.
    pub rotation: Matrix3<f64>,
    /// rad/s.
    pub bias: Vector3<f64>,
    /// Noise before it is quantised, rad/s.
    pub sigma: f64,
    /// One count, rad/s.
    pub count: f64,
    /// Full scale, rad/s.
    pub range: f64,
    /// Errors of the axes' scales.
    pub scale: Vector3<f64>,
    /// Group delay of its filter, s.
    pub delay_s: f64,
    /// What the bias drifts to, rad/s, and the time constant, s.
    pub drift: (Vector3<f64>, f64),
}

impl EncoderTruth {
    /// As described, without effects.
    pub fn new(side: Side, encoder: &Encoder, gear: f64, zero: f64) -> Self {
        let count = encoder.counts_per_turn.map_or(0.0, |counts| TAU / (f64::from(counts) * gear));
        let mechanical = (encoder.sigma.powi(2) - count * count / 12.0).max(0.0).sqrt();
        Self { side, joint: encoder.joint, count, sigma: mechanical, zero, eccentricity: [0.0; 2], lag_s: 0.0 }
    }
}

impl GyroTruth {
    /// As described, without effects.
    pub fn new(gyro: &Gyro, rotation: Matrix3<f64>, bias: Vector3<f64>) -> Self {
        let range = gyro.range_rad_s.unwrap_or(35.0);
        let count = range / GYRO_COUNTS;
        Self {
            body: gyro.body,
            rotation,
            bias,
            sigma: (gyro.sigma_rad_s.powi(2) - count * count / 12.0).max(0.0).sqrt(),
            count,
            range,
            scale: Vector3::zeros(),
            delay_s: 0.0,
            drift: (Vector3::zeros(), 30.0),
        }
    }

    /// With the filter that every gyro of this plant has.
    pub fn filtered(mut self) -> Self {
        self.delay_s = GYRO_DELAY_S;
        self
    }
}

/// An encoder at work.
#[derive(Debug)]
pub struct EncoderReader {
    truth: EncoderTruth,
    /// Positions, the newest last, one a step.
    past: VecDeque<f64>,
    step_s: f64,
    coloured: Option<Coloured>,
}

impl EncoderReader {
    /// With a step of the plant and a period of sampling.
    pub fn new(truth: &EncoderTruth, step_s: f64, period_s: f64, fidelity: Fidelity, rng: &mut ChaCha8Rng) -> Self {
        let is_wrong = fidelity == Fidelity::WrongWorld;
        let total = truth.sigma.max(truth.count / 12.0_f64.sqrt());
        let coloured = is_wrong.then(|| Coloured::new(COLOURED_SHARE * total, COLOURED_S, period_s, rng));
        Self { truth: truth.clone(), past: VecDeque::new(), step_s, coloured }
    }

    /// Takes the position at the end of a step.
    pub fn pass(&mut self, position: f64) {
        self.past.push_back(position);
        let kept = (self.truth.lag_s / self.step_s) as usize + 3;
        while self.past.len() > kept {
            self.past.pop_front();
        }
    }

    /// A reading now.
    pub fn read(&mut self, rng: &mut ChaCha8Rng) -> f64 {
        let truth = &self.truth;
        let steps = truth.lag_s / self.step_s;
        let (whole, part) = (steps as usize, steps.fract());
        let back = |steps: usize| {
            self.past.iter().rev().nth(steps.min(self.past.len().saturating_sub(1))).copied().unwrap_or(0.0)
        };
        let position = (1.0 - part) * back(whole) + part * back(whole + 1);
        let [error, phase] = truth.eccentricity;
        let turn = position + phase;
        let mut reading = position + error * (turn.sin() + SECOND_TURN * (2.0 * turn + 0.7).sin()) + truth.zero;
        reading += truth.sigma * normal(rng);
        if let Some(coloured) = &mut self.coloured {
            reading += coloured.next(rng);
        }
        if truth.count > 0.0 { (reading / truth.count).round() * truth.count } else { reading }
    }
}

/// A gyro at work.
#[derive(Debug)]
pub struct GyroReader {
    truth: GyroTruth,
    before: Vector3<f64>,
    stages: [Vector3<f64>; 2],
    coloured: Option<[Coloured; 3]>,
}

impl GyroReader {
    /// With a period of sampling.
    pub fn new(truth: &GyroTruth, period_s: f64, fidelity: Fidelity, rng: &mut ChaCha8Rng) -> Self {
        let is_wrong = fidelity == Fidelity::WrongWorld;
        let one = |rng: &mut ChaCha8Rng| Coloured::new(COLOURED_SHARE * truth.sigma, COLOURED_S, period_s, rng);
        let coloured = is_wrong.then(|| [(); 3].map(|()| one(rng)));
        Self { truth: truth.clone(), before: Vector3::zeros(), stages: [Vector3::zeros(); 2], coloured }
    }

    /// Takes the rate of its body at the end of a step of length `h`, rad/s in body axes.
    pub fn pass(&mut self, body_rate: Vector3<f64>, h: f64) {
        let truth = &self.truth;
        let mut seen = truth.rotation * body_rate;
        seen += truth.scale.component_mul(&seen);
        let before = std::mem::replace(&mut self.before, seen);
        if truth.delay_s == 0.0 {
            self.stages = [seen; 2];
            return;
        }
        let poles = [FIRST_POLE * truth.delay_s, (1.0 - FIRST_POLE) * truth.delay_s];
        // Parts of a step that are short against the poles; the mean of a part's input lies in its middle.
        for part in 0..FILTER_PARTS {
            let mut input = before + (seen - before) * ((part as f64 + 0.5) / FILTER_PARTS as f64);
            for (stage, time_s) in self.stages.iter_mut().zip(poles) {
                *stage += (1.0 - (-h / FILTER_PARTS as f64 / time_s).exp()) * (input - *stage);
                input = *stage;
            }
        }
    }

    /// A reading now.
    pub fn read(&mut self, time_s: f64, rng: &mut ChaCha8Rng) -> [f64; 3] {
        let truth = &self.truth;
        let (towards, constant_s) = truth.drift;
        let bias = truth.bias + towards * -(-time_s / constant_s).exp_m1();
        std::array::from_fn(|axis| {
            let coloured = self.coloured.as_mut().map_or(0.0, |coloured| coloured[axis].next(rng));
            let reading = self.stages[1][axis] + bias[axis] + truth.sigma * normal(rng) + coloured;
            (reading.clamp(-truth.range, truth.range) / truth.count).round() * truth.count
        })
    }
}
