//! Closed-loop simulation of a machine and its recording.

use std::collections::VecDeque;

use host::recording::{NO_PHASE, Recorder, Recording, Row, Session, Source, Tick};
use host::robot::{Robot, Side};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::chain::MOST;
use super::dynamics::{Acting, JointView, State};
use super::machine::{Fidelity, Machine};
use super::motion::Motion;
use super::noise::normal;
use super::outsider::Usage;
use super::sensors::{EncoderReader, GyroReader};
use super::unmodelled::Unmodelled;

/// Step of the plant, s.
pub const STEP_S: f64 = 2e-4;
/// Duration of the unrecorded hold before a motion, s.
const HELD_S: f64 = 1.0;
/// Standard deviations of stamps in the wrong world, as shares of the period.
const JITTER: std::ops::Range<f64> = 5e-4..1e-2;

/// A simulated motion.
#[derive(Debug)]
pub struct Played {
    /// What was recorded.
    pub recording: Recording,
    /// What each joint did.
    pub usage: Vec<Usage>,
    /// Largest rate that each gyro saw on an axis, rad/s.
    pub gyro_peaks: Vec<f64>,
}

/// The simulation diverged.
#[derive(Debug)]
pub struct Diverged {
    /// When, s.
    pub time_s: f64,
}

/// Simulates and records a motion. `rng` draws sensor noise and disturbances.
///
/// # Errors
/// [`Diverged`].
///
/// # Panics
/// If the rows do not follow each other as rows of this robot do.
pub fn play(
    (robot, machine): (&Robot, &Machine),
    mut motion: Motion,
    mut unmodelled: Unmodelled,
    fidelity: Fidelity,
    rng: &mut ChaCha8Rng,
) -> Result<Played, Diverged> {
    let period_s = robot.sample_period_s;
    let steps = (period_s / STEP_S).round() as usize;
    let h = period_s / steps as f64;
    let mut loop_ = Loop::new(machine, robot, h, fidelity, rng);
    let jitter_us = match fidelity {
        Fidelity::TrueToFile => 0.0,
        Fidelity::WrongWorld => 1e6 * period_s * rng.random_range(JITTER),
    };
    let mut recorder = Recorder::new(Session::of(robot.clone()));
    let held = (HELD_S / period_s).round() as i64;
    let samples = (motion.duration_s() / period_s).round() as i64;
    for k in -held..samples {
        let time_s = k as f64 * period_s;
        let values = loop_.read(time_s.max(0.0), rng);
        let inputs = motion.input(time_s, &loop_.positions(&values));
        if k >= 0 {
            // Four standard deviations are far from the half period at which stamps would change places.
            let late_us = jitter_us * normal(rng).clamp(-4.0, 4.0);
            let t_us = (1e6 * (1.0 + time_s) + late_us).round() as u64;
            let row =
                Row { t_us, seq: k as u64, phase: NO_PHASE, tick: Tick::default(), duty: &inputs, values: &values };
            recorder.push(&row).expect("stamps rise and widths are the robot's");
            loop_.account(&inputs);
        } else {
            loop_.state.time_s = 0.0;
        }
        let mut acting = inputs;
        unmodelled.spoil_inputs(&mut acting, rng);
        for _ in 0..steps {
            loop_.step(&acting, &mut unmodelled, h, rng);
        }
        if !loop_.state.is_finite() {
            return Err(Diverged { time_s });
        }
    }
    let source = Source { path: "wrong_world".into(), sha256: String::new() };
    let (usage, gyro_peaks) = loop_.used();
    Ok(Played { recording: recorder.finish(source), usage, gyro_peaks })
}

/// State, sensors and statistics of a simulation.
struct Loop<'a> {
    machine: &'a Machine,
    joints: usize,
    state: State,
    acting: Acting,
    views: [JointView; MOST],
    encoders: Vec<EncoderReader>,
    gyros: Vec<GyroReader>,
    /// Inputs of every step, the newest last.
    past: VecDeque<Vec<f64>>,
    sums: Vec<Usage>,
    peaks: Vec<f64>,
    samples: f64,
}

impl<'a> Loop<'a> {
    fn new(machine: &'a Machine, robot: &Robot, h: f64, fidelity: Fidelity, rng: &mut ChaCha8Rng) -> Self {
        let (joints, period_s) = (robot.joints.len(), robot.sample_period_s);
        let encoders =
            machine.encoders.iter().map(|truth| EncoderReader::new(truth, h, period_s, fidelity, rng)).collect();
        let gyros = machine.gyros.iter().map(|truth| GyroReader::new(truth, period_s, fidelity, rng)).collect();
        let mut new = Self {
            machine,
            joints,
            state: State::at_rest(machine, &vec![0.0; joints]),
            acting: Acting::default(),
            views: [JointView::default(); MOST],
            encoders,
            gyros,
            past: VecDeque::new(),
            sums: vec![Usage::default(); joints],
            peaks: vec![0.0; machine.gyros.len()],
            samples: 0.0,
        };
        new.sense(h);
        new
    }

    /// The channels of a robot, in their order.
    fn read(&mut self, time_s: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut values: Vec<f64> = self.encoders.iter_mut().map(|encoder| encoder.read(rng)).collect();
        for (gyro, peak) in self.gyros.iter_mut().zip(&mut self.peaks) {
            let reading = gyro.read(time_s, rng);
            *peak = reading.iter().fold(*peak, |peak, rate| peak.max(rate.abs()));
            values.extend(reading);
        }
        values
    }

    /// What a controller looks at: every joint's motor encoder.
    fn positions(&self, values: &[f64]) -> Vec<f64> {
        let of = |joint: usize| {
            let encoders = self.machine.encoders.iter().zip(values);
            let mut own = encoders.filter(|(encoder, _)| encoder.joint == joint && encoder.side == Side::Motor);
            own.next().map_or(0.0, |(_, value)| *value)
        };
        (0..self.joints).map(of).collect()
    }

    fn step(&mut self, inputs: &[f64], unmodelled: &mut Unmodelled, h: f64, rng: &mut ChaCha8Rng) {
        self.past.push_back(inputs.to_vec());
        let late = self.machine.input_delay_s / h;
        let (whole, part) = (late as usize, late.fract());
        while self.past.len() > whole + 2 {
            self.past.pop_front();
        }
        let back = |steps: usize, joint: usize| {
            let last = self.past.len() - 1;
            self.past[last.saturating_sub(steps)][joint]
        };
        for joint in 0..self.joints {
            self.acting.input[joint] = (1.0 - part) * back(whole, joint) + part * back(whole + 1, joint);
        }
        unmodelled.act(&self.views, &mut self.acting, rng);
        self.machine.step(&mut self.state, &self.acting, h);
        self.sense(h);
    }

    /// Updates views and sensors from the state.
    fn sense(&mut self, h: f64) {
        for joint in 0..self.joints {
            self.views[joint] = self.machine.view(&self.state, joint, &self.acting);
        }
        for (encoder, truth) in self.encoders.iter_mut().zip(&self.machine.encoders) {
            let view = &self.views[truth.joint];
            encoder.pass(if truth.side == Side::Motor { view.theta } else { view.q });
        }
        if self.gyros.is_empty() {
            return;
        }
        let pose = self.machine.chain.pose(&self.state.chain_positions());
        let rates = self.machine.chain.body_rates(&pose, &self.state.chain_speeds());
        for (gyro, truth) in self.gyros.iter_mut().zip(&self.machine.gyros) {
            gyro.pass(rates[self.machine.bearings.len() + truth.body], h);
        }
    }

    fn account(&mut self, inputs: &[f64]) {
        self.samples += 1.0;
        for (joint, sum) in self.sums.iter_mut().enumerate() {
            let view = &self.views[joint];
            sum.input += inputs[joint].powi(2);
            sum.torque += view.motor_torque.powi(2);
            sum.torque_peak = sum.torque_peak.max(view.motor_torque.abs());
            sum.speed += view.thetad.powi(2);
            sum.position += view.q.powi(2);
            sum.windup = sum.windup.max((view.q - view.theta).abs());
            sum.transmitted += view.transmitted.powi(2);
        }
    }

    fn used(self) -> (Vec<Usage>, Vec<f64>) {
        let rms = |sum: f64| (sum / self.samples).sqrt();
        let usage = self.sums.iter().map(|sum| Usage {
            input: rms(sum.input),
            torque: rms(sum.torque),
            speed: rms(sum.speed),
            position: rms(sum.position),
            transmitted: rms(sum.transmitted),
            ..*sum
        });
        (usage.collect(), self.peaks)
    }
}
