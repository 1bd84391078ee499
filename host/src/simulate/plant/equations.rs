//! ẋ = f(x, u, t) of a plant: the walk from the inputs to the accelerations, effects asked on the way.

use super::super::Truth;
use crate::effect::{Drive, Hidden, Line, Moment, PassiveJoint, Physics};
use crate::robot::chain::{Chain, MAX_JOINTS};
use crate::robot::{Friction, InputUnit, Matrix3, Robot, RobotError, Side, Symbol, Transmission, Vector3};

/// A hook at one joint's quantity.
type Hook = fn(&(dyn Physics + 'static), &Moment<'_>, f64) -> f64;

/// Everything that does not change while the plant runs.
#[derive(Debug)]
pub(super) struct Equations {
    pub layout: Layout,
    pub effects: Vec<Hidden>,
    chain: Chain,
    /// Scale of the Coriolis and centrifugal torques.
    coriolis: f64,
    /// Passive joints and their places in the chain.
    passive: Vec<(usize, PassiveJoint)>,
    drives: Vec<DriveTruth>,
    k_pwm: Vec<f64>,
    k_mi: Vec<f64>,
    unit: InputUnit,
    supply_v: f64,
    gyros: Vec<GyroTruth>,
    /// What link encoders read at zero, and by what share of the position too much.
    pub link_readings: Vec<[f64; 2]>,
}

/// Where the state's components stand: q and q̇ of the chain, θ and θ̇ of the motors, the effects' own.
#[derive(Debug)]
pub(super) struct Layout {
    /// Joints of the chain, passive ones included.
    pub chain: usize,
    /// Passive joints before the robot's first.
    pub first: usize,
    /// Joints of the robot.
    pub joints: usize,
    /// Start of the effects' own states.
    pub own: usize,
    elastic: Vec<bool>,
}

#[derive(Debug)]
struct DriveTruth {
    elastic: bool,
    friction: Friction,
    b: f64,
    mu: f64,
    /// Whether friction holds the link back.
    rubs_at_link: bool,
    /// Viscous friction beside the back-EMF, and a constant torque.
    viscous: f64,
    offset: f64,
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

impl Equations {
    pub fn new(robot: &Robot, truth: &Truth, effects: Vec<Hidden>) -> Result<Self, RobotError> {
        let physics = || effects.iter().map(|effect| &*effect.physics);
        // The torques of the speeds are scaled here, so the chain leaves them out.
        let mut built = robot.clone();
        built.coriolis = false;
        for (index, joint) in built.joints.iter_mut().enumerate() {
            joint.body = physics().fold(joint.body, |body, physics| physics.body(index, body));
        }
        let described = if robot.coriolis { 1.0 } else { 0.0 };

        let n = robot.joints.len();
        let base: Vec<PassiveJoint> = physics().flat_map(|physics| physics.base_joints().iter().copied()).collect();
        let axes: Vec<Vector3> = base.iter().map(|joint| joint.axis).collect();
        let mut chain = built.chain().with_base_joints([0.0; 3], &axes)?;
        let mut passive: Vec<(usize, PassiveJoint)> = base.iter().copied().enumerate().collect();
        let first = passive.len();
        let structure = physics().find_map(Physics::structure);
        if let Some(structure) = structure {
            chain = chain.with_structure(&structure.outer, &structure.joints.map(|joint| joint.axis))?;
            passive.extend(structure.joints.into_iter().enumerate().map(|(i, joint)| (first + n + i, joint)));
        }

        let value = |symbol, joint| {
            let value = truth.get(robot, symbol, joint).unwrap_or(0.0);
            physics().fold(value, |value, physics| physics.parameter(symbol, joint, value))
        };
        let torque_constant = |j| match robot.input.unit {
            InputUnit::Duty | InputUnit::Volt => value(Symbol::KPwm, j),
            InputUnit::Ampere => value(Symbol::KT, j),
            InputUnit::NewtonMetre | InputUnit::Newton => 1.0,
        };
        for (j, symbol) in (0..n).flat_map(|j| Symbol::OF_BODIES.map(|symbol| (j, symbol))) {
            chain = chain.with_moment(first + j, symbol, value(symbol, j));
        }
        let drives = robot.joints.iter().enumerate().map(|(j, joint)| DriveTruth {
            elastic: joint.transmission == Transmission::Elastic,
            friction: joint.friction,
            b: value(Symbol::B, j),
            mu: value(Symbol::Mu, j),
            rubs_at_link: matches!(joint.friction, Friction::Coulomb { acts: Side::Link, .. }),
            viscous: value(Symbol::V, j),
            offset: value(Symbol::O, j),
            k_s: value(Symbol::KS, j),
            d_s: value(Symbol::DS, j),
        });
        let drives: Vec<DriveTruth> = drives.collect();
        // Sensors of the outermost body sit on its outer part.
        let outermost = chain.joints() - 1;
        let gyros = robot.gyros().enumerate().map(|(gyro, sensor)| GyroTruth {
            body: if sensor.body + 1 == n { outermost } else { first + sensor.body },
            rotation: truth.rotation(robot, gyro),
            bias: truth.bias(robot, gyro),
        });
        Ok(Self {
            layout: Layout {
                chain: chain.joints(),
                first,
                joints: n,
                own: 2 * (chain.joints() + n),
                elastic: drives.iter().map(|drive| drive.elastic).collect(),
            },
            coriolis: physics().fold(described, |scale, physics| physics.coriolis(scale)),
            gyros: gyros.collect(),
            k_pwm: (0..n).map(torque_constant).collect(),
            k_mi: (0..n).map(|j| value(Symbol::KMi, j)).collect(),
            link_readings: (0..n).map(|j| [value(Symbol::Zero, j), value(Symbol::ScaleError, j)]).collect(),
            unit: robot.input.unit,
            supply_v: robot.input.scale,
            drives,
            passive,
            chain,
            effects,
        })
    }

    /// Number of the state's components.
    pub fn size(&self) -> usize {
        self.layout.own + self.effects.iter().map(|effect| effect.physics.states()).sum::<usize>()
    }

    /// ẋ of the state x under the inputs u, `time_s` after the start of the motion.
    pub fn rates(&self, x: &[f64], u: &[f64], time_s: f64, out: &mut [f64]) {
        let Layout { chain: m, first, joints: n, own, .. } = self.layout;
        let (q, qd, own) = (&x[..m], &x[m..2 * m], &x[own..]);
        let mut joints = [Moment::default(); MAX_JOINTS];
        self.moments(x, time_s, &mut joints);
        let speed = joints.map(|at| at.thetad);
        let supply_v = self.supply(u, &speed[..n]);

        let mut torque = [0.0; MAX_JOINTS];
        self.passive_torque(q, qd, &mut torque[..m]);
        let mut mass = [0.0; MAX_JOINTS * MAX_JOINTS];
        self.chain.mass_matrix(q, &mut mass[..m * m]);

        let mut motor_torque = [0.0; MAX_JOINTS];
        for (j, drive) in self.drives.iter().enumerate() {
            let (i, at) = (first + j, &mut joints[j]);
            motor_torque[j] = self.k_pwm[j] * supply_v * u[j] - self.k_mi[j] * at.thetad;
            let motor = self.asked(at, own, motor_torque[j], <dyn Physics>::motor_torque);
            if drive.elastic {
                let spring = at.k_s * at.wind() + at.d_s * at.wind_rate();
                at.transmitted = self.asked(at, own, spring, <dyn Physics>::transmission_torque);
            } else {
                at.transmitted = -motor;
            }
            let mut friction = self.asked(at, own, at.coulomb(), <dyn Physics>::friction_torque) + drive.offset;
            torque[i] -= self.asked(at, own, 0.0, <dyn Physics>::link_load);
            friction += drive.viscous * if drive.rubs_at_link { at.qd } else { at.thetad };
            if drive.rubs_at_link {
                torque[i] -= std::mem::take(&mut friction);
            }
            if drive.elastic {
                torque[i] -= at.transmitted;
                out[2 * m + j] = at.thetad;
                out[2 * m + n + j] = (at.transmitted + motor - friction) / drive.b;
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
        if !own.is_empty() {
            self.own_rates(x, &joints[..n], &motor_torque[..n], &mut out[self.layout.own..]);
        }
    }

    /// What gyro `gyro` sees before bias and noise, rad/s in sensor axes.
    pub fn gyro_rate(&self, x: &[f64], gyro: usize) -> Vector3 {
        let mut rates = [[0.0; 3]; MAX_JOINTS];
        self.sensor_rates(x, &mut rates);
        let mut own = &x[self.layout.own..];
        self.effects.iter().fold(rates[gyro], |rate, effect| {
            let (mine, rest) = own.split_at(effect.physics.states());
            own = rest;
            effect.physics.gyro_rate(mine, gyro, rate)
        })
    }

    /// True bias of a gyro, rad/s.
    pub fn gyro_bias(&self, gyro: usize) -> Vector3 {
        self.gyros[gyro].bias
    }

    /// Finds the links' rest with the motors held: transmissions against gravity and loads, by fixed-point iteration
    /// (springs are much stiffer than gravity, so it contracts; 100 rounds are far more than it needs).
    pub fn settle(&self, x: &mut [f64]) {
        let Layout { chain: m, first, own, .. } = self.layout;
        for _ in 0..100 {
            let mut torque = [0.0; MAX_JOINTS];
            self.passive_torque(&x[..m], &x[m..2 * m], &mut torque[..m]);
            let mut joints = [Moment::default(); MAX_JOINTS];
            self.moments(x, 0.0, &mut joints);
            let mut moved = [0.0; MAX_JOINTS];
            for (j, drive) in self.drives.iter().enumerate().filter(|(_, drive)| drive.elastic) {
                let (i, at) = (first + j, &joints[j]);
                let spring = at.k_s * at.wind();
                torque[i] -= self.asked(at, &x[own..], spring, <dyn Physics>::transmission_torque);
                torque[i] -= self.asked(at, &x[own..], 0.0, <dyn Physics>::link_load);
                moved[i] = torque[i] / drive.k_s;
            }
            for (i, joint) in &self.passive {
                moved[*i] = torque[*i] / joint.stiffness;
            }
            x.iter_mut().zip(&moved[..m]).for_each(|(q, moved)| *q += moved);
        }
    }

    /// Every joint as the effects are told of it.
    fn moments(&self, x: &[f64], time_s: f64, out: &mut [Moment<'_>; MAX_JOINTS]) {
        let Layout { chain: m, first, joints: n, .. } = self.layout;
        for (joint, (drive, out)) in self.drives.iter().zip(out).enumerate() {
            let (q, qd) = (x[first + joint], x[m + first + joint]);
            let (theta, thetad) = if drive.elastic { (x[2 * m + joint], x[2 * m + n + joint]) } else { (q, qd) };
            let (friction_speed, friction_sign) = drive.slip(thetad, qd);
            *out = Moment {
                joint,
                time_s,
                q,
                qd,
                theta,
                thetad,
                k_s: drive.k_s,
                d_s: drive.d_s,
                mu: drive.mu,
                friction_speed,
                friction_sign,
                ..Moment::default()
            };
        }
    }

    /// A quantity of one joint after all effects.
    fn asked(&self, at: &Moment<'_>, own: &[f64], without: f64, ask: Hook) -> f64 {
        let mut own = own;
        self.effects.iter().fold(without, |quantity, effect| {
            let (mine, rest) = own.split_at(effect.physics.states());
            own = rest;
            ask(&*effect.physics, &Moment { own: mine, ..*at }, quantity)
        })
    }

    /// Torques on the chain that no drive makes: gravity, speeds, springs and dampers of the passive joints.
    fn passive_torque(&self, q: &[f64], qd: &[f64], out: &mut [f64]) {
        self.chain.bias_torque(q, qd, out);
        for torque in &mut *out {
            *torque = -*torque;
        }
        if self.coriolis != 0.0 {
            let mut coriolis = [0.0; MAX_JOINTS];
            let at_constant_speed = [0.0; MAX_JOINTS];
            self.chain.inverse_dynamics(q, Some(qd), &at_constant_speed[..q.len()], &mut coriolis[..q.len()]);
            out.iter_mut().zip(coriolis).for_each(|(torque, coriolis)| *torque -= self.coriolis * coriolis);
        }
        for (i, joint) in &self.passive {
            out[*i] -= joint.stiffness * q[*i] + joint.damping * qd[*i];
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

    fn own_rates(&self, x: &[f64], joints: &[Moment<'_>], motor_torque: &[f64], out: &mut [f64]) {
        let mut rates = [[0.0; 3]; MAX_JOINTS];
        self.sensor_rates(x, &mut rates);
        let line = Line { joints, motor_torque, gyro_rates: &rates[..self.gyros.len()] };
        let (mut own, mut out) = (&x[self.layout.own..], out);
        for effect in &self.effects {
            let (mine, rest) = own.split_at(effect.physics.states());
            let (mine_out, rest_out) = out.split_at_mut(mine.len());
            effect.physics.state_rates(mine, &line, mine_out);
            (own, out) = (rest, rest_out);
        }
    }

    /// True angular rates at the gyros in sensor axes, before any effect and without bias.
    fn sensor_rates(&self, x: &[f64], out: &mut [Vector3]) {
        let m = self.layout.chain;
        let mut bodies = [[0.0; 3]; MAX_JOINTS];
        self.chain.body_rates(&x[..m], &x[m..2 * m], &mut bodies[..m]);
        for (gyro, out) in self.gyros.iter().zip(out) {
            let body = bodies[gyro.body];
            *out = gyro.rotation.map(|row| row[0] * body[0] + row[1] * body[1] + row[2] * body[2]);
        }
    }
}

impl Layout {
    /// Positions of the robot's links.
    pub fn links<'x>(&self, x: &'x [f64]) -> &'x [f64] {
        &x[self.first..self.first + self.joints]
    }

    /// Positions of the motors; on rigid joints, the links'.
    pub fn motors(&self, x: &[f64]) -> [f64; MAX_JOINTS] {
        let mut motors = [0.0; MAX_JOINTS];
        for (joint, motor) in motors[..self.joints].iter_mut().enumerate() {
            *motor = if self.elastic[joint] { x[2 * self.chain + joint] } else { x[self.first + joint] };
        }
        motors
    }

    /// Where the speeds of a joint's link and, if it has a state of its own, motor stand.
    pub fn speeds(&self, joint: usize) -> (usize, Option<usize>) {
        let motor = self.elastic[joint].then_some(2 * self.chain + self.joints + joint);
        (self.chain + self.first + joint, motor)
    }

    /// Puts links and motors to these positions.
    pub fn place(&self, x: &mut [f64], q: &[f64]) {
        x[self.first..self.first + self.joints].copy_from_slice(q);
        x[2 * self.chain..2 * self.chain + self.joints].copy_from_slice(q);
    }
}

impl DriveTruth {
    /// The speed that friction takes, and its smooth sign: equation (12) is μ times it.
    fn slip(&self, motor_speed: f64, link_speed: f64) -> (f64, f64) {
        match self.friction {
            Friction::None => (motor_speed, 0.0),
            Friction::Coulomb { speed, slope_s, .. } => {
                let v = match speed {
                    Side::Motor => motor_speed,
                    Side::Link => link_speed,
                };
                // 2 (1 / (1 + exp(−κ v)) − 1/2) without overflow
                (v, (0.5 * slope_s * v).tanh())
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
