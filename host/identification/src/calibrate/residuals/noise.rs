//! The standard deviations that weight the rows of a problem: of every sensor channel, and of every state component's step.

use super::preset::{Assumptions, ProcessNoise};
use crate::calibrate::data::series::Series;
use crate::model::{Layout, Model};
use crate::robot::{InputNoise, JointKind, Robot};

/// Standard deviations, a plain value: taken from a preset or estimated from the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Of one reading of every channel, in the channel's unit.
    pub channels: Vec<f64>,
    /// Of what one step of the model misses, every state component in its own unit, over a sample period; of a measured input its error's own.
    pub process: Vec<f64>,
}

/// White torque noise over a step of T moves the speed by σ and the position by T/√3 σ. Positions are never taken for better known than that …
const POSITION_PER_SPEED: f64 = 0.577_350_269_189_626;

/// … and where the robot file tells accelerations that no equation explains, than by T/√12 σ, which is what a position has beside the speeds before and after.
const POSITION_BESIDE_SPEEDS: f64 = 0.288_675_134_594_813;

impl Noise {
    /// What the robot file says of the sensors, and the process noise that a preset assumes.
    pub fn assumed(robot: &Robot, model: &Model, series: &Series, assumptions: &Assumptions) -> Self {
        let mut noise = Noise {
            channels: series.channels.iter().map(|channel| channel.sigma).collect(),
            process: by_component(model, assumptions.process.over(robot.sample_period_s)),
        };
        let layout = model.layout();
        noise.process[layout.inputs()].copy_from_slice(&of_inputs(robot, layout, series));
        if !layout.inputs().is_empty() {
            for component in exact_steps(layout) {
                noise.process[component] = EXACT_SPEED;
            }
            noise.join_positions(layout, robot.sample_period_s, LEAST_SPEED);
        }
        noise.allow_unmodelled(robot, model.layout());
        noise
    }

    /// The same with these standard deviations of inputs, where the robot file tells none.
    pub(crate) fn with_inputs(mut self, robot: &Robot, layout: &Layout, sigma: &[f64]) -> Self {
        if robot.input_noise() == InputNoise::Unknown {
            for (to, sigma) in self.process[layout.inputs()].iter_mut().zip(sigma).filter(|(_, sigma)| **sigma > 0.0) {
                *to = *sigma;
            }
        }
        self
    }

    /// Steps no better known than the robot file says: an acceleration from sample to sample moves a speed by itself times the period, and the
    /// position with it.
    pub(crate) fn allow_unmodelled(&mut self, robot: &Robot, layout: &Layout) {
        let period_s = robot.sample_period_s;
        for (i, joint) in robot.joints.iter().enumerate() {
            let mut allow = |position: usize, speed: usize, acceleration: f64| {
                let least = acceleration * period_s;
                self.process[speed] = self.process[speed].max(least);
                self.process[position] = self.process[position].max(POSITION_BESIDE_SPEEDS * period_s * least);
            };
            allow(layout.q(i), layout.qd(i), joint.unmodelled.link);
            if layout.is_elastic(i) {
                allow(layout.theta(i), layout.thetad(i), joint.unmodelled.motor);
            }
        }
    }

    /// This noise of a model with the components of `from` for one with those of `to`: of the sensors and of the robot's own joints it is the
    /// same; what else `to` has keeps `assumed`.
    pub(crate) fn carried(&self, from: &Layout, to: &Layout, assumed: Noise) -> Self {
        let mut process = assumed.process;
        for i in 0..to.joints() {
            process[to.q(i)] = self.process[from.q(i)];
            process[to.qd(i)] = self.process[from.qd(i)];
            if to.is_elastic(i) {
                process[to.theta(i)] = self.process[from.theta(i)];
                process[to.thetad(i)] = self.process[from.thetad(i)];
            }
            if let (Some(to), Some(from)) = (to.input(i), from.input(i)) {
                process[to] = self.process[from];
            }
        }
        Noise { channels: self.channels.clone(), process }
    }

    /// How many times as large the noise of the steps is as that of `other`, at most.
    pub fn steps_over(&self, other: &Noise) -> f64 {
        self.process.iter().zip(&other.process).map(|(own, other)| own / other).fold(0.0, f64::max)
    }

    /// Speeds on which measured inputs act as exact as the model makes them: what is missed is the input's error.
    pub(crate) fn exact_where_inputs_err(&mut self, layout: &Layout, period_s: f64) {
        for joint in (0..layout.joints()).filter(|joint| layout.input(*joint).is_some()) {
            self.process[layout.thetad(joint)] = LEAST_SPEED;
            self.process[layout.theta(joint)] = POSITION_PER_SPEED * period_s * LEAST_SPEED;
        }
    }

    /// Speeds no better known than `least_speed`, positions no better than their speeds allow.
    pub(crate) fn join_positions(&mut self, layout: &Layout, period_s: f64, least_speed: f64) {
        let mut join = |position: usize, speed: usize| {
            self.process[speed] = self.process[speed].max(least_speed);
            let least = POSITION_PER_SPEED * period_s * self.process[speed];
            self.process[position] = self.process[position].max(least);
        };
        for i in 0..layout.chain() {
            join(i, layout.chain() + i);
        }
        for i in (0..layout.joints()).filter(|&i| layout.is_elastic(i)) {
            join(layout.theta(i), layout.thetad(i));
        }
        for sigma in &mut self.process {
            *sigma = sigma.max(least_speed * POSITION_PER_SPEED * period_s);
        }
    }
}

/// Components of the robot's own joints whose steps have no noise of their own: positions, since q' is q̇ and nothing else, and speeds on which a measured
/// input acts, whose error is a state.
pub(crate) fn exact_steps(layout: &Layout) -> Vec<usize> {
    let joints = 0..layout.joints();
    let positions = joints.clone().flat_map(|i| [layout.q(i), layout.theta(i)]);
    let driven = joints.filter(|i| layout.input(*i).is_some()).map(|i| layout.thetad(i));
    positions.chain(driven).collect()
}

/// What such a step is taken to miss of a speed before the integrator's own error is known, rad/s or m/s. Half and double have not been tried: that error
/// replaces it after the first search.
const EXACT_SPEED: f64 = 1e-5;

/// Share of an input's root mean square that its error is taken for, before anything is known of it, and in a diagnosis. On EMPS the
/// estimate is 0.08; half and double have not been tried.
const ASSUMED_OF_INPUT: f64 = 0.01;

/// Standard deviations of the inputs' errors as the robot file tells them or as they are assumed, in the input's unit; none where inputs are commands.
pub(crate) fn of_inputs(robot: &Robot, layout: &Layout, series: &Series) -> Vec<f64> {
    let assumed = |joint: usize| match robot.input_noise() {
        InputNoise::Known(sigma) => sigma,
        InputNoise::None | InputNoise::Unknown => {
            let squares: f64 = (0..series.stages()).map(|k| series.input(k)[joint].powi(2)).sum();
            let rms = (squares / series.stages().max(1) as f64).sqrt();
            ASSUMED_OF_INPUT * if rms > 0.0 { rms } else { 1.0 }
        }
    };
    (0..layout.inputs().len()).map(assumed).collect()
}

/// No step of a speed is taken for more exact than this, rad/s or m/s: a robot at rest has no integration error at all, and weights
/// above 1e9 would leave nothing of the sensors' digits.
pub(crate) const LEAST_SPEED: f64 = 1e-6;

/// A value for every state component.
fn by_component(model: &Model, noise: ProcessNoise) -> Vec<f64> {
    let layout = model.layout();
    let mut values = vec![0.0; layout.size()];
    for (i, sigma) in layout.own().zip(model.own_sigma()) {
        values[i] = noise.own * sigma;
    }
    for i in 0..layout.chain() {
        values[i] = noise.position;
        values[layout.chain() + i] = noise.link_speed;
    }
    for i in (0..layout.joints()).filter(|&i| layout.is_elastic(i)) {
        values[layout.theta(i)] = noise.position;
        values[layout.thetad(i)] = noise.motor_speed;
    }
    values
}

/// Names and units of state components in results, as `process.qd[2]`; `passive` are joints and `own` are states that effects bring.
pub(crate) fn process_names(robot: &Robot, layout: &Layout) -> Vec<(String, &'static str)> {
    let mut names: Vec<_> = (0..layout.size()).map(|i| (format!("process.own[{}]", i + 1), "")).collect();
    for (place, i) in layout.passive().enumerate() {
        names[i] = (format!("process.passive.q[{}]", place + 1), "rad");
        names[layout.chain() + i] = (format!("process.passive.qd[{}]", place + 1), "rad/s");
    }
    for (i, joint) in robot.joints.iter().enumerate() {
        let units = match joint.kind {
            JointKind::Revolute => ["rad", "rad/s"],
            JointKind::Prismatic => ["m", "m/s"],
        };
        let mut name = |component: usize, letter: &str, unit| {
            names[component] = (format!("process.{letter}[{}]", i + 1), unit);
        };
        name(layout.q(i), "q", units[0]);
        name(layout.qd(i), "qd", units[1]);
        if layout.is_elastic(i) {
            name(layout.theta(i), "theta", units[0]);
            name(layout.thetad(i), "thetad", units[1]);
        }
        if let Some(error) = layout.input(i) {
            name(error, "input", robot.input.unit.symbol());
        }
    }
    names
}
