//! ẋ = f(x, u, t) of a [`Machine`], and a step of the classical Runge–Kutta method.
//!
//! Memories of friction and hysteresis are no part of x. Within a step they follow from the displacement since its start.

use nalgebra::SVector;

use super::chain::{MOST, Values};
use super::machine::{Belt, Drive, Machine};
use super::memory::{ELEMENTS, Memory, Onset};
use super::outsider::Outsider;

/// q, q̇ of the chain, then θ, θ̇, motor torque, late speed and heat of the joints, then the sag of the supply.
const SIZE: usize = 2 * MOST + 5 * MOST + 1;
type X = SVector<f64, SIZE>;

/// Presliding is damped at this share of critical against the motor's inertia.
const MICRO_DAMPING: f64 = 0.15;
/// Penetration over which the contact's damping rises, as a share of the half gap, and the share of the damping inside the gap.
const CONTACT: f64 = 0.15;
const LUBRICATION: f64 = 0.02;
/// A lag shorter than this is none, s.
const LEAST_LAG_S: f64 = 1e-4;
/// Amplitude ratio and phase of the second harmonic of ripples.
const HARMONIC: f64 = 0.15;
const HARMONIC_PHASE: f64 = 1.1;

/// What acts on a machine over one step; one value a joint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Acting {
    /// Input as it reaches the drivers.
    pub input: [f64; MOST],
    /// Unmodelled torque on the motors, N m.
    pub motor: [f64; MOST],
    /// The same on the links.
    pub link: [f64; MOST],
}

/// The state of a machine: x and the memories.
#[derive(Debug, Clone)]
pub struct State {
    x: X,
    motors: [Memory; MOST],
    links: [Memory; MOST],
    slips: [Memory; MOST],
    /// s.
    pub time_s: f64,
}

/// Quantities of one joint for sensors and statistics.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointView {
    /// Link position and speed.
    pub q: f64,
    /// Its rate.
    pub qd: f64,
    /// Motor position.
    pub theta: f64,
    /// Its rate.
    pub thetad: f64,
    /// Torque of the motor, N m.
    pub motor_torque: f64,
    /// Torque of the transmission, N m.
    pub transmitted: f64,
}

/// Places of x.
#[derive(Debug, Clone, Copy)]
struct Places {
    passive: usize,
}

impl Places {
    fn q(self, joint: usize) -> usize {
        self.passive + joint
    }

    fn qd(self, joint: usize) -> usize {
        MOST + self.passive + joint
    }

    const fn of(self, group: usize, joint: usize) -> usize {
        (2 + group) * MOST + joint
    }

    fn theta(self, joint: usize) -> usize {
        self.of(0, joint)
    }

    fn thetad(self, joint: usize) -> usize {
        self.of(1, joint)
    }

    fn torque(self, joint: usize) -> usize {
        self.of(2, joint)
    }

    fn late_speed(self, joint: usize) -> usize {
        self.of(3, joint)
    }

    fn heat(self, joint: usize) -> usize {
        self.of(4, joint)
    }

    fn sag(self) -> usize {
        SIZE - 1
    }
}

impl State {
    /// At rest at these positions, springs relaxed.
    pub fn at_rest(machine: &Machine, positions: &[f64]) -> Self {
        let places = machine.places();
        let mut x = X::zeros();
        for (joint, position) in positions.iter().enumerate() {
            x[places.q(joint)] = *position;
            x[places.theta(joint)] = *position;
        }
        let none = [[0.0; ELEMENTS]; MOST];
        Self { x, motors: none, links: none, slips: none, time_s: 0.0 }
    }

    /// Positions of the chain, passive joints included.
    pub fn chain_positions(&self) -> Values {
        self.x.fixed_rows::<MOST>(0).into_owned()
    }

    /// Speeds of the chain, passive joints included.
    pub fn chain_speeds(&self) -> Values {
        self.x.fixed_rows::<MOST>(MOST).into_owned()
    }

    /// Sets the speeds of the joints.
    pub fn set_speeds(&mut self, machine: &Machine, speeds: &[f64]) {
        let places = machine.places();
        for (joint, speed) in speeds.iter().enumerate() {
            self.x[places.qd(joint)] = *speed;
            self.x[places.thetad(joint)] = *speed;
        }
    }

    /// Whether everything is a finite number.
    pub fn is_finite(&self) -> bool {
        self.x.iter().all(|value| value.is_finite())
    }
}

impl Machine {
    fn places(&self) -> Places {
        Places { passive: self.bearings.len() }
    }

    /// One joint as it stands, under these actions.
    pub fn view(&self, state: &State, joint: usize, acting: &Acting) -> JointView {
        let places = self.places();
        let x = &state.x;
        let side = self.sides(x, joint);
        let transmitted =
            self.joints[joint].belt.map_or(0.0, |belt| self.transmission(&belt, joint, &side, &state.slips[joint]));
        let volts = self.supply - x[places.sag()];
        let (motor_torque, _) = self.motor(x, joint, self.driver_input(acting, joint), volts);
        JointView { q: side.q, qd: side.qd, theta: side.theta, thetad: side.thetad, motor_torque, transmitted }
    }

    /// One step of length `h`.
    pub fn step(&self, state: &mut State, acting: &Acting, h: f64) {
        let (x, t) = (state.x, state.time_s);
        let k1 = self.rates(state, &x, acting, t);
        let k2 = self.rates(state, &(x + 0.5 * h * k1), acting, t + 0.5 * h);
        let k3 = self.rates(state, &(x + 0.5 * h * k2), acting, t + 0.5 * h);
        let k4 = self.rates(state, &(x + h * k3), acting, t + h);
        let next = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
        for (joint, drive) in self.joints.iter().enumerate() {
            let (before, after) = (self.sides(&x, joint), self.sides(&next, joint));
            state.motors[joint] = drive.friction.onset.moved(&state.motors[joint], after.theta - before.theta);
            state.links[joint] = drive.load.onset.moved(&state.links[joint], after.q - before.q);
            if let Some(belt) = &drive.belt {
                state.slips[joint] = belt.slip.moved(&state.slips[joint], after.wind() - before.wind());
            }
        }
        state.x = next;
        state.time_s = t + h;
    }

    fn sides(&self, x: &X, joint: usize) -> Sides {
        let places = self.places();
        let (q, qd) = (x[places.q(joint)], x[places.qd(joint)]);
        let is_elastic = self.joints[joint].belt.is_some();
        let (theta, thetad) = if is_elastic { (x[places.theta(joint)], x[places.thetad(joint)]) } else { (q, qd) };
        Sides { q, qd, theta, thetad }
    }

    fn rates(&self, start: &State, x: &X, acting: &Acting, time_s: f64) -> X {
        let places = self.places();
        let mut out = X::zeros();
        let (q, qd): (Values, Values) = (x.fixed_rows::<MOST>(0).into_owned(), x.fixed_rows::<MOST>(MOST).into_owned());
        let pose = self.chain.pose(&q);
        let mut torque = -self.chain.gravity_torques(&pose);
        if self.coriolis != 0.0 {
            torque -= self.coriolis * self.chain.coriolis_torques(&pose, &qd);
        }
        let mut mass = self.chain.mass_matrix(&pose);
        for (i, bearing) in self.bearings.iter().enumerate() {
            let share = q[i] / 0.02;
            torque[i] -= bearing.stiffness * q[i] * (1.0 + bearing.hardening * share * share) + bearing.damping * qd[i];
        }
        let volts = self.supply - x[places.sag()];
        let mut drawn = 0.0;
        for (joint, drive) in self.joints.iter().enumerate() {
            let chain = places.q(joint);
            let (before, side) = (self.sides(&start.x, joint), self.sides(x, joint));
            let slips = drive.belt.map(|belt| belt.slip.moved(&start.slips[joint], side.wind() - before.wind()));
            let transmitted = match (&drive.belt, slips) {
                (Some(belt), Some(slips)) => self.transmission(belt, joint, &side, &slips),
                _ => 0.0,
            };
            let input = self.driver_input(acting, joint);
            let (motor, rate) = self.motor(x, joint, input, volts);
            drawn += acting.input[joint] * motor;
            out[places.torque(joint)] = rate;
            let memory = drive.friction.onset.moved(&start.motors[joint], side.theta - before.theta);
            let friction = self.friction(x, drive, joint, &side, &memory, transmitted, time_s);
            let memory = drive.load.onset.moved(&start.links[joint], side.q - before.q);
            torque[chain] += acting.link[joint] - load(drive, &side, &memory);
            let on_motor = motor + acting.motor[joint] - friction;
            if drive.belt.is_some() {
                torque[chain] -= transmitted;
                out[places.theta(joint)] = side.thetad;
                out[places.thetad(joint)] = (transmitted + on_motor) / drive.inertia;
            } else {
                torque[chain] += on_motor;
                mass[(chain, chain)] += drive.inertia;
            }
            if let Some(Outsider::BeltPull { from, to, share }) = self.outsider
                && from == joint
            {
                torque[places.q(to)] += share * transmitted;
            }
            if let Some(Outsider::FrictionLag { lag_s, .. }) = self.outsider {
                out[places.late_speed(joint)] = (side.thetad - x[places.late_speed(joint)]) / lag_s;
            }
            if let Some(Outsider::HeatFade { rate, .. }) = self.outsider {
                out[places.heat(joint)] = rate * motor * motor;
            }
        }
        out[places.sag()] = ((self.sag * drawn).max(0.0) - x[places.sag()]) / self.sag_lag_s;
        // A mass matrix that is not positive definite ends the simulation as diverged.
        let accelerations = mass.cholesky().map_or_else(|| Values::repeat(f64::NAN), |factor| factor.solve(&torque));
        out.fixed_rows_mut::<MOST>(0).copy_from(&qd);
        out.fixed_rows_mut::<MOST>(MOST).copy_from(&accelerations);
        out
    }

    /// What the driver of a joint puts on its motor.
    fn driver_input(&self, acting: &Acting, joint: usize) -> f64 {
        let mut input = acting.input[joint];
        if let Some(Outsider::InputLeak { from, to, share }) = self.outsider
            && to == joint
        {
            input += share * acting.input[from];
        }
        let dead = self.joints[joint].dead_zone;
        // The edge is rounded over a fifth of the dead zone, as by pulses that come through in part.
        if dead > 0.0 { soft_threshold(input, dead, 0.2 * dead) } else { input }
    }

    /// Torque of a motor with its ripple, and the rate of the current's state.
    fn motor(&self, x: &X, joint: usize, input: f64, volts: f64) -> (f64, f64) {
        let (places, drive) = (self.places(), &self.joints[joint]);
        let side = self.sides(x, joint);
        let fade = match self.outsider {
            Some(Outsider::HeatFade { joint: hot, .. }) if hot == joint => 1.0 / (1.0 + x[places.heat(joint)]),
            _ => 1.0,
        };
        let at_once = drive.gain * fade * volts * input - drive.back_emf * side.thetad;
        let lag_s = match self.outsider {
            Some(Outsider::LateByLoad { joint: late, lag_per_torque }) if late == joint => {
                (self.current_lag_s + lag_per_torque * at_once.abs()).max(3.0 * LEAST_LAG_S)
            }
            _ => self.current_lag_s,
        };
        let state = x[places.torque(joint)];
        let (electric, rate) = if lag_s > LEAST_LAG_S { (state, (at_once - state) / lag_s) } else { (at_once, 0.0) };
        let [amplitude, per_unit, phase] = drive.ripple;
        let turn = per_unit * side.theta + phase;
        let ripple = amplitude * (turn.sin() + HARMONIC * (2.0 * turn + HARMONIC_PHASE).sin());
        (electric.clamp(-self.torque_limit, self.torque_limit) + ripple + drive.offset, rate)
    }

    /// Torque of a transmission, positive where it pulls the motor forwards.
    fn transmission(&self, belt: &Belt, joint: usize, side: &Sides, slips: &Memory) -> f64 {
        let wind = side.wind();
        let depth = (wind.abs() - belt.half_gap).max(0.0) * wind.signum();
        let grip = if belt.half_gap > 0.0 {
            LUBRICATION + (1.0 - LUBRICATION) * (depth.abs() / (CONTACT * belt.half_gap)).min(1.0)
        } else {
            1.0
        };
        let mut stiffness = belt.stiffness * (1.0 + belt.slack * wind.signum());
        if let Some(Outsider::StiffnessRipple { joint: rippled, share, waves }) = self.outsider
            && rippled == joint
        {
            stiffness *= 1.0 + share * (waves * side.q).sin();
        }
        let saturated = 1.0 + (depth / belt.saturation).powi(2);
        stiffness * depth
            + belt.hardening * depth.powi(3) / saturated
            + grip * belt.damping * (side.qd - side.thetad)
            + slips.iter().sum::<f64>()
    }

    /// Friction of a motor, positive where it holds back.
    #[expect(clippy::too_many_arguments, reason = "all of it is what friction depends on")]
    fn friction(
        &self,
        x: &X,
        drive: &Drive,
        joint: usize,
        side: &Sides,
        memory: &Memory,
        load: f64,
        time_s: f64,
    ) -> f64 {
        let (places, rubbing) = (self.places(), &drive.friction);
        let v = side.thetad;
        let [ratio, phase] = rubbing.wave;
        let turn = side.theta - phase;
        let mut sliding =
            rubbing.coulomb * (1.0 + ratio * (turn.cos() + HARMONIC * (2.0 * turn + HARMONIC_PHASE).cos()));
        sliding *= 1.0 + rubbing.per_load * load.abs();
        sliding *= 1.0 + rubbing.warm_up[0] * (-time_s / rubbing.warm_up[1]).exp();
        match self.outsider {
            Some(Outsider::FrictionByPosition { joint: rubbed, of, slope }) if rubbed == joint => {
                sliding *= (1.0 + slope * x[places.q(of)]).max(0.1);
            }
            Some(Outsider::FrictionBySpeed { joint: rubbed, of, slope }) if rubbed == joint => {
                sliding *= 1.0 + slope * self.sides(x, of).thetad.abs();
            }
            _ => {}
        }
        let [sticking, speed, exponent] = rubbing.stiction;
        let share = rubbing.onset.share(memory, v);
        let built_up = sliding + sticking * (-(v.abs() / speed).powf(exponent)).exp();
        let mut torque = built_up * share + rubbing.asymmetry[0] * share.abs();
        torque += rubbing.viscous * v + rubbing.asymmetry[1] * v.abs();
        torque +=
            micro_damping(&rubbing.onset, built_up, drive.inertia) * (-(v / rubbing.micro_speed).powi(2)).exp() * v;
        if let Some(Outsider::FrictionLag { joint: rubbed, viscous, .. }) = self.outsider
            && rubbed == joint
        {
            torque += viscous * (x[places.late_speed(joint)] - v);
        }
        torque
    }
}

/// Both sides of a transmission.
#[derive(Debug, Clone, Copy)]
struct Sides {
    q: f64,
    qd: f64,
    theta: f64,
    thetad: f64,
}

impl Sides {
    fn wind(&self) -> f64 {
        self.q - self.theta
    }
}

/// What holds a link back beside inertia and transmission.
fn load(drive: &Drive, side: &Sides, memory: &Memory) -> f64 {
    let load = &drive.load;
    let [torque, angle] = load.gravity;
    load.coulomb * load.onset.share(memory, side.qd)
        + load.viscous * side.qd
        + load.drag * side.qd * side.qd.abs()
        + load.spring * side.q
        + torque * (side.q + angle).sin()
}

fn micro_damping(onset: &Onset, torque: f64, inertia: f64) -> f64 {
    2.0 * MICRO_DAMPING * (torque.max(0.0) * onset.stiffness() * inertia).sqrt()
}

/// x less ± `dead` outside of a dead zone, corners rounded over `width`.
fn soft_threshold(x: f64, dead: f64, width: f64) -> f64 {
    let ramp = |x: f64| if x > 30.0 * width { x } else { width * (x / width).exp().ln_1p() };
    ramp(x - dead) - ramp(-x - dead)
}
