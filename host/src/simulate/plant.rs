//! The plant: the robot's equations with their true parameters, and with effects that the base model knows nothing of.
//!
//! The quantities are walked in this order, and effects are asked where they may change one:
//!
//! ```text
//! duty u → supply U → motor torque τ_m → friction τ_f → transmission torque τ_c → M(q) q̈, b θ̈ → gyro rates
//! ```
//!
//! Integrated by the classical fourth-order Runge–Kutta method in steps of [`STEP_S`], a tenth of the estimator's and
//! with the duty constant in each. Halving the step moves ten seconds of the fastest motion by 3e-8 rad and 3e-7 rad/s
//! (a test holds it to 1e-7 and 1e-6); with backlash, whose torque has corners, runs of two step sizes
//! part after a while as those of any two machines do.

use crate::effect::{Belt, Drive, Hidden, PassiveJoint};
use crate::robot::chain::{Chain, MAX_JOINTS};
use crate::robot::{Friction, InputUnit, Matrix3, Robot, RobotError, Side, Symbol, Transmission, Vector3};

use super::Truth;

/// Largest step of the integration, s.
pub const STEP_S: f64 = 1e-4;

/// A robot in motion.
#[derive(Debug)]
pub struct Plant {
    equations: Equations,
    /// q (passive joints first), q̇, θ, θ̇, states of the effects.
    state: Vec<f64>,
    step_s: f64,
    stages: [Vec<f64>; 4],
    trial: Vec<f64>,
}

/// Everything that does not change while the plant runs.
#[derive(Debug)]
struct Equations {
    chain: Chain,
    passive: Vec<PassiveJoint>,
    drives: Vec<DriveTruth>,
    k_pwm: Vec<f64>,
    k_mi: Vec<f64>,
    unit: InputUnit,
    supply_v: f64,
    gyros: Vec<GyroTruth>,
    effects: Vec<Hidden>,
    own_states: usize,
}

#[derive(Debug)]
struct DriveTruth {
    elastic: bool,
    friction: Friction,
    b: f64,
    mu: f64,
    k_s: f64,
    d_s: f64,
}

#[derive(Debug)]
struct GyroTruth {
    /// Index in the chain, passive joints counted.
    body: usize,
    rotation: Matrix3,
    bias: Vector3,
}

impl Plant {
    /// A robot at rest in its marked pose: motors at zero, links where springs and gravity balance.
    ///
    /// # Errors
    /// [`RobotError::TooManyJoints`] if the effects' passive joints do not fit.
    pub fn new(robot: &Robot, truth: &Truth, effects: Vec<Hidden>) -> Result<Self, RobotError> {
        let equations = Equations::new(robot, truth, effects)?;
        let (m, n) = (equations.chain.joints(), equations.drives.len());
        let size = 2 * m + 2 * n + equations.own_states;
        let mut plant = Self {
            equations,
            state: vec![0.0; size],
            step_s: STEP_S,
            stages: std::array::from_fn(|_| vec![0.0; size]),
            trial: vec![0.0; size],
        };
        plant.settle();
        Ok(plant)
    }

    /// The same plant with another largest step, s.
    #[must_use]
    pub fn with_step(mut self, step_s: f64) -> Self {
        self.step_s = step_s;
        self
    }

    /// Puts motors and links to these positions, at rest and with relaxed transmissions.
    pub fn place(&mut self, q: &[f64]) {
        let (m, n) = (self.equations.chain.joints(), self.equations.drives.len());
        self.state.fill(0.0);
        self.state[m - n..m].copy_from_slice(q);
        self.state[2 * m..2 * m + n].copy_from_slice(q);
    }

    /// Lets `duration_s` pass with the inputs `u` (in the unit of the robot's input), one a joint.
    pub fn advance(&mut self, u: &[f64], duration_s: f64) {
        let steps = (duration_s / self.step_s - 1e-9).ceil().max(1.0);
        for _ in 0..steps as usize {
            self.step(u, duration_s / steps);
        }
    }

    /// Motor positions on the link side of the gear, rad or m. On a rigid joint, the link's.
    pub fn motor_position(&self, joint: usize) -> f64 {
        let (m, n) = (self.equations.chain.joints(), self.equations.drives.len());
        if self.equations.drives[joint].elastic { self.state[2 * m + joint] } else { self.state[m - n + joint] }
    }

    /// Position of a link, rad or m.
    pub fn link_position(&self, joint: usize) -> f64 {
        let (m, n) = (self.equations.chain.joints(), self.equations.drives.len());
        self.state[m - n + joint]
    }

    /// What gyro `gyro` would read without noise: true rotation, true bias, effects included. rad/s, sensor axes.
    pub fn gyro_rate(&self, gyro: usize) -> Vector3 {
        let equations = &self.equations;
        let mut rates = [[0.0; 3]; MAX_JOINTS];
        equations.sensor_rates(&self.state, &mut rates);
        let mut rate = rates[gyro];
        let mut own = &self.state[self.state.len() - equations.own_states..];
        for effect in &equations.effects {
            let (mine, rest) = own.split_at(effect.physics.states());
            rate = effect.physics.gyro_rate(mine, gyro, rate);
            own = rest;
        }
        let bias = equations.gyros[gyro].bias;
        std::array::from_fn(|axis| rate[axis] + bias[axis])
    }

    /// The effects inside, with the truth about them.
    pub fn effects(&self) -> &[Hidden] {
        &self.equations.effects
    }

    /// One step of the classical Runge–Kutta method.
    fn step(&mut self, u: &[f64], h: f64) {
        let [k1, k2, k3, k4] = &mut self.stages;
        let (equations, x, trial) = (&self.equations, &mut self.state, &mut self.trial);
        let euler = |trial: &mut [f64], x: &[f64], k: &[f64], h: f64| {
            for ((t, x), k) in trial.iter_mut().zip(x).zip(k) {
                *t = x + h * k;
            }
        };
        equations.rates(x, u, k1);
        euler(trial, x, k1, 0.5 * h);
        equations.rates(trial, u, k2);
        euler(trial, x, k2, 0.5 * h);
        equations.rates(trial, u, k3);
        euler(trial, x, k3, h);
        equations.rates(trial, u, k4);
        for i in 0..x.len() {
            x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }

    /// Finds the links' rest: spring torques against gravity, by fixed-point iteration (springs are much stiffer than
    /// gravity, so it contracts; 100 rounds are far more than it needs).
    fn settle(&mut self) {
        let equations = &self.equations;
        let (m, n) = (equations.chain.joints(), equations.drives.len());
        if !equations.chain.has_gravity() {
            return;
        }
        let mut gravity = [0.0; MAX_JOINTS];
        for _ in 0..100 {
            equations.chain.gravity_torque(&self.state[..m], &mut gravity[..m]);
            for i in 0..m {
                self.state[i] = match i.checked_sub(m - n) {
                    None => -gravity[i] / equations.passive[i].stiffness,
                    Some(joint) if equations.drives[joint].elastic => -gravity[i] / equations.drives[joint].k_s,
                    Some(_) => 0.0,
                };
            }
        }
    }
}

impl Equations {
    fn new(robot: &Robot, truth: &Truth, effects: Vec<Hidden>) -> Result<Self, RobotError> {
        let passive: Vec<PassiveJoint> =
            effects.iter().flat_map(|effect| effect.physics.base_joints().iter().copied()).collect();
        let axes: Vec<Vector3> = passive.iter().map(|joint| joint.axis).collect();
        let chain = robot.chain().with_base_joints([0.0; 3], &axes)?;
        let value = |symbol, joint| truth.get(robot, symbol, joint).unwrap_or(0.0);
        let joints = 0..robot.joints.len();
        let drives = robot.joints.iter().enumerate().map(|(j, joint)| DriveTruth {
            elastic: joint.transmission == Transmission::Elastic,
            friction: joint.friction,
            b: value(Symbol::B, j),
            mu: value(Symbol::Mu, j),
            k_s: value(Symbol::KS, j),
            d_s: value(Symbol::DS, j),
        });
        let gyros = robot.gyros().enumerate().map(|(gyro, sensor)| GyroTruth {
            body: sensor.body + passive.len(),
            rotation: truth.rotation(robot, gyro),
            bias: truth.bias(robot, gyro),
        });
        let torque_constant = |j| match robot.input.unit {
            InputUnit::Duty | InputUnit::Volt => value(Symbol::KPwm, j),
            InputUnit::Ampere => value(Symbol::KT, j),
            InputUnit::NewtonMetre | InputUnit::Newton => 1.0,
        };
        Ok(Self {
            chain,
            drives: drives.collect(),
            k_pwm: joints.clone().map(torque_constant).collect(),
            k_mi: joints.map(|j| value(Symbol::KMi, j)).collect(),
            unit: robot.input.unit,
            supply_v: robot.input.scale,
            gyros: gyros.collect(),
            own_states: effects.iter().map(|effect| effect.physics.states()).sum(),
            passive,
            effects,
        })
    }

    /// ẋ of the state x under the inputs u.
    fn rates(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        let (m, n) = (self.chain.joints(), self.drives.len());
        let (q, qd) = (&x[..m], &x[m..2 * m]);
        let (theta, thetad) = (&x[2 * m..2 * m + n], &x[2 * m + n..2 * (m + n)]);
        let first = m - n;

        // Motor speeds; on a rigid joint, the link's.
        let mut speed = [0.0; MAX_JOINTS];
        for (j, drive) in self.drives.iter().enumerate() {
            speed[j] = if drive.elastic { thetad[j] } else { qd[first + j] };
        }
        let supply_v = self.supply(u, &speed[..n]);

        let mut torque = [0.0; MAX_JOINTS];
        self.chain.bias_torque(q, qd, &mut torque[..m]);
        for torque in &mut torque[..m] {
            *torque = -*torque;
        }
        for (i, joint) in self.passive.iter().enumerate() {
            torque[i] -= joint.stiffness * q[i] + joint.damping * qd[i];
        }
        let mut mass = [0.0; MAX_JOINTS * MAX_JOINTS];
        self.chain.mass_matrix(q, &mut mass[..m * m]);

        for (j, drive) in self.drives.iter().enumerate() {
            let i = first + j;
            let motor = self.k_pwm[j] * supply_v * u[j] - self.k_mi[j] * speed[j];
            let friction = drive.friction_torque(speed[j], qd[i]);
            if drive.elastic {
                let belt = Belt { wind: q[i] - theta[j], wind_rate: qd[i] - thetad[j], k_s: drive.k_s, d_s: drive.d_s };
                let transmitted =
                    self.effects.iter().fold(belt.k_s * belt.wind + belt.d_s * belt.wind_rate, |torque, effect| {
                        effect.physics.transmission_torque(j, &belt, torque)
                    });
                torque[i] -= transmitted;
                out[2 * m + j] = thetad[j];
                out[2 * m + n + j] = (transmitted + motor - friction) / drive.b;
            } else {
                torque[i] += motor - friction;
                mass[i * m + i] += drive.b;
                out[2 * m + j] = 0.0;
                out[2 * m + n + j] = 0.0;
            }
        }
        out[..m].copy_from_slice(qd);
        solve_symmetric(&mut mass[..m * m], &mut torque[..m]);
        out[m..2 * m].copy_from_slice(&torque[..m]);
        if self.own_states > 0 {
            self.effect_rates(x, &mut out[2 * (m + n)..]);
        }
    }

    /// What one unit of u is in the unit of the torque constant: for a duty, the supply voltage with its effects.
    fn supply(&self, u: &[f64], speed: &[f64]) -> f64 {
        if self.unit != InputUnit::Duty {
            return 1.0;
        }
        let drive = Drive { duty: u, speed, k_pwm: &self.k_pwm, k_mi: &self.k_mi };
        self.effects.iter().fold(self.supply_v, |volts, effect| effect.physics.supply_v(&drive, volts))
    }

    fn effect_rates(&self, x: &[f64], out: &mut [f64]) {
        let mut rates = [[0.0; 3]; MAX_JOINTS];
        self.sensor_rates(x, &mut rates);
        let mut own = &x[x.len() - self.own_states..];
        let mut out = out;
        for effect in &self.effects {
            let (mine, rest) = own.split_at(effect.physics.states());
            let (mine_out, rest_out) = out.split_at_mut(mine.len());
            effect.physics.state_rates(mine, &rates[..self.gyros.len()], mine_out);
            (own, out) = (rest, rest_out);
        }
    }

    /// True angular rates at the gyros in sensor axes, before any effect and without bias.
    fn sensor_rates(&self, x: &[f64], out: &mut [Vector3]) {
        let m = self.chain.joints();
        let mut bodies = [[0.0; 3]; MAX_JOINTS];
        self.chain.body_rates(&x[..m], &x[m..2 * m], &mut bodies[..m]);
        for (gyro, out) in self.gyros.iter().zip(out) {
            let body = bodies[gyro.body];
            *out = gyro.rotation.map(|row| row[0] * body[0] + row[1] * body[1] + row[2] * body[2]);
        }
    }
}

impl DriveTruth {
    fn friction_torque(&self, motor_speed: f64, link_speed: f64) -> f64 {
        match self.friction {
            Friction::None => 0.0,
            Friction::Coulomb { speed, slope_s } => {
                let v = match speed {
                    Side::Motor => motor_speed,
                    Side::Link => link_speed,
                };
                // 2 μ (1 / (1 + exp(−κ v)) − 1/2) without overflow
                self.mu * (0.5 * slope_s * v).tanh()
            }
        }
    }
}

/// Solves A x = b by Cholesky, A symmetric positive definite n×n by rows; x replaces b, A is destroyed.
///
/// A mass matrix is positive definite whenever every joint moves some inertia, which a description's bodies and motors
/// make sure of; if one is not, the accelerations come out not finite, and the recording shows it.
fn solve_symmetric(a: &mut [f64], b: &mut [f64]) {
    let n = b.len();
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                a[i * n + j] -= a[i * n + k] * a[j * n + k];
            }
        }
        let pivot = a[j * n + j].sqrt();
        for i in j..n {
            a[i * n + j] /= pivot;
        }
    }
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i * n + k] * b[k];
        }
        b[i] /= a[i * n + i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k * n + i] * b[k];
        }
        b[i] /= a[i * n + i];
    }
}
