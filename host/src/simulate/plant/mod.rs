//! The plant: the robot's equations with their true parameters, and with effects that the base model knows nothing of.
//!
//! The quantities are walked in this order, and effects are asked where they may change one:
//!
//! ```text
//! duty u → supply U → motor torque τ_m → transmission torque τ_c → friction τ_f → link loads → M(q) q̈, b θ̈ → sensors
//! ```
//!
//! Integrated by the classical fourth-order Runge–Kutta method in steps of [`STEP_S`], a tenth of the estimator's and
//! with the duty constant in each. Halving the step moves ten seconds of the fastest motion by 3e-8 rad and 3e-7 rad/s
//! (a test holds it to 1e-7 and 1e-6); with effects whose torque has corners, as backlash, runs of two step sizes
//! part after a while as those of any two machines do.
//!
//! Effects count time from the start of the motion. Until the first motion the robot is held in its marked pose.

mod equations;
mod process;

use crate::effect::{CATALOGUE, Hidden, Past};
use crate::robot::chain::MAX_JOINTS;
use crate::robot::{Robot, RobotError, Side, Vector3};

use super::Truth;
use equations::Equations;
pub use process::ProcessNoise;
use process::Shaking;

/// Largest step of the integration, s.
pub const STEP_S: f64 = 1e-4;

/// A robot in motion.
#[derive(Debug)]
pub struct Plant {
    equations: Equations,
    /// q (passive joints first and last), q̇, θ, θ̇, states of the effects.
    state: Vec<f64>,
    step_s: f64,
    /// Since the start of the motion, s.
    time_s: f64,
    held: bool,
    past: Past,
    stages: [Vec<f64>; 4],
    trial: Vec<f64>,
    euler: Option<Euler>,
    shaking: Option<Shaking>,
}

/// An explicit Euler integration in steps that do not care where sensors are read.
#[derive(Debug)]
struct Euler {
    step_s: f64,
    /// What is left of the present step, along its slope in `stages[0]`, s.
    left_s: f64,
}

impl Plant {
    /// A robot at rest in its marked pose: motors at zero, links where springs, gravity and loads balance.
    ///
    /// # Errors
    /// [`RobotError::TooManyJoints`] if the effects' passive joints do not fit.
    pub fn new(robot: &Robot, truth: &Truth, mut effects: Vec<Hidden>) -> Result<Self, RobotError> {
        effects.sort_by_key(|hidden| CATALOGUE.iter().position(|effect| effect.id == hidden.id));
        let memory_s = effects.iter().map(|effect| effect.physics.memory_s()).fold(0.0, f64::max);
        let euler_step_s = effects.iter().find_map(|effect| effect.physics.euler_step_s());
        let equations = Equations::new(robot, truth, effects)?;
        let size = equations.size();
        let mut state = vec![0.0; size];
        equations.settle(&mut state);
        Ok(Self {
            equations,
            state,
            step_s: STEP_S,
            time_s: 0.0,
            held: false,
            past: Past::new(memory_s),
            stages: std::array::from_fn(|_| vec![0.0; size]),
            trial: vec![0.0; size],
            euler: euler_step_s.map(|step_s| Euler { step_s, left_s: 0.0 }),
            shaking: None,
        })
    }

    /// The same plant with another largest step, s.
    #[must_use]
    pub fn with_step(mut self, step_s: f64) -> Self {
        self.step_s = step_s;
        self
    }

    /// The same plant with process noise, which the seed decides from the start of a motion on.
    #[must_use]
    pub fn with_process_noise(mut self, noise: ProcessNoise, seed: u64) -> Self {
        self.shaking = Some(Shaking::new(noise, seed));
        self
    }

    /// The same plant, held as it stands until a motion begins.
    #[must_use]
    pub fn held(mut self) -> Self {
        self.held = true;
        self
    }

    /// A motion begins: the robot is let go, and effects count their time from here.
    pub fn begin_motion(&mut self) {
        self.held = false;
        self.time_s = 0.0;
        if let Some(shaking) = &mut self.shaking {
            shaking.begin_motion();
        }
    }

    /// Puts motors and links to these positions, at rest and with relaxed transmissions.
    pub fn place(&mut self, q: &[f64]) {
        self.state.fill(0.0);
        self.equations.layout.place(&mut self.state, q);
        self.past.clear();
    }

    /// Lets `duration_s` pass with the inputs `u` (in the unit of the robot's input), one a joint.
    pub fn advance(&mut self, u: &[f64], duration_s: f64) {
        if self.held || duration_s <= 0.0 {
            return;
        }
        if self.euler.is_some() {
            return self.advance_by_euler(u, duration_s);
        }
        let steps = (duration_s / self.step_s - 1e-9).ceil().max(1.0);
        for _ in 0..steps as usize {
            let h = duration_s / steps;
            let input = self.input(u, h);
            self.step(&input[..u.len()], h);
            self.pass(h);
        }
    }

    /// Explicit Euler: within a step the state goes along the slope at its start.
    fn advance_by_euler(&mut self, u: &[f64], duration_s: f64) {
        const ROUNDING_S: f64 = 1e-9;
        let mut rest_s = duration_s;
        while rest_s > ROUNDING_S {
            let Some(Euler { step_s, left_s }) = self.euler else { return };
            let mut left_s = left_s;
            if left_s <= ROUNDING_S {
                let input = self.input(u, step_s);
                self.equations.rates(&self.state, &input[..u.len()], self.time_s, &mut self.stages[0]);
                left_s = step_s;
            }
            let h = left_s.min(rest_s);
            for (x, slope) in self.state.iter_mut().zip(&self.stages[0]) {
                *x += h * slope;
            }
            self.pass(h);
            self.euler = Some(Euler { step_s, left_s: left_s - h });
            rest_s -= h;
        }
    }

    /// What effects leave of the commanded inputs over the step that begins, in the unit of the robot's input.
    fn input(&mut self, u: &[f64], step_s: f64) -> [f64; MAX_JOINTS] {
        let layout = &self.equations.layout;
        let motors = layout.motors(&self.state);
        self.past.push(step_s, u, &motors[..layout.joints], layout.links(&self.state));
        let mut input = [0.0; MAX_JOINTS];
        for (joint, u) in u.iter().enumerate() {
            let effects = self.equations.effects.iter();
            input[joint] = effects.fold(*u, |duty, effect| effect.physics.duty(joint, &self.past, duty));
        }
        input
    }

    /// Time goes on; what shakes, shakes, and what jumps, jumps.
    fn pass(&mut self, step_s: f64) {
        if let Some(shaking) = &mut self.shaking {
            shaking.shake(&self.equations.layout, &mut self.state, step_s);
        }
        let from_s = self.time_s;
        self.time_s += step_s;
        let mut own = &mut self.state[self.equations.layout.own..];
        for effect in &self.equations.effects {
            let (mine, rest) = own.split_at_mut(effect.physics.states());
            effect.physics.jump(mine, from_s, self.time_s);
            own = rest;
        }
    }

    /// Where a motor stands on the link side of the gear, rad or m. On a rigid joint, the link's position.
    pub fn motor_position(&self, joint: usize) -> f64 {
        self.equations.layout.motors(&self.state)[joint]
    }

    /// Position of a link, rad or m.
    pub fn link_position(&self, joint: usize) -> f64 {
        self.equations.layout.links(&self.state)[joint]
    }

    /// q, q̇, θ and θ̇ of a joint, rad and rad/s or m and m/s. On a rigid joint, θ is q.
    pub fn joint_state(&self, joint: usize) -> [f64; 4] {
        let (link, motor) = self.equations.layout.speeds(joint);
        let speed = self.state[link];
        let motor_speed = motor.map_or(speed, |motor| self.state[motor]);
        [self.link_position(joint), speed, self.motor_position(joint), motor_speed]
    }

    /// What an encoder on this side of a joint would read without noise, rad or m.
    pub fn encoder(&self, side: Side, joint: usize) -> f64 {
        let now = match side {
            Side::Motor => self.motor_position(joint),
            Side::Link => self.link_position(joint),
        };
        let effects = self.equations.effects.iter();
        let reading =
            effects.fold(now, |reading, effect| effect.physics.encoder(side, joint, &self.past, now, reading));
        let [zero, scale_error] = if side == Side::Link { self.equations.link_readings[joint] } else { [0.0; 2] };
        zero + (1.0 + scale_error) * reading
    }

    /// What gyro `gyro` would read without noise: true rotation, true bias, effects included. rad/s, sensor axes.
    pub fn gyro_rate(&self, gyro: usize) -> Vector3 {
        self.gyro_reading(gyro, [0.0; 3])
    }

    /// What gyro `gyro` reads with this noise, rad/s in sensor axes.
    pub fn gyro_reading(&self, gyro: usize, noise: Vector3) -> Vector3 {
        let equations = &self.equations;
        let (rate, bias) = (equations.gyro_rate(&self.state, gyro), equations.gyro_bias(gyro));
        let reading = std::array::from_fn(|axis| rate[axis] + bias[axis] + noise[axis]);
        let effects = equations.effects.iter();
        effects.fold(reading, |reading, effect| effect.physics.gyro_reading(self.time_s, gyro, reading))
    }

    /// The effects inside, with the truth about them.
    pub fn effects(&self) -> &[Hidden] {
        &self.equations.effects
    }

    /// One step of the classical Runge–Kutta method.
    fn step(&mut self, u: &[f64], h: f64) {
        let [k1, k2, k3, k4] = &mut self.stages;
        let (equations, x, trial, t) = (&self.equations, &mut self.state, &mut self.trial, self.time_s);
        let euler = |trial: &mut [f64], x: &[f64], k: &[f64], h: f64| {
            for ((t, x), k) in trial.iter_mut().zip(x).zip(k) {
                *t = x + h * k;
            }
        };
        equations.rates(x, u, t, k1);
        euler(trial, x, k1, 0.5 * h);
        equations.rates(trial, u, t + 0.5 * h, k2);
        euler(trial, x, k2, 0.5 * h);
        equations.rates(trial, u, t + 0.5 * h, k3);
        euler(trial, x, k3, h);
        equations.rates(trial, u, t + h, k4);
        for i in 0..x.len() {
            x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }
}
