//! Effects of friction and of the motor's own torque.

use std::f64::consts::TAU;

use rand::RngExt;

use super::{Hiding, Size, Truth, of_joint, single};

/// See [`Hiding::hide`].
pub(super) fn hide(to: &mut Hiding<'_>, id: &str, size: Size) -> Option<Vec<Truth>> {
    Some(match id {
        "viscous_friction" => viscous(to, size),
        "stribeck" => stribeck(to, size),
        "asymmetric_friction" => asymmetric(to, size),
        "load_friction" => load(to, size),
        "position_friction" => position(to, size),
        "friction_drift" => drift(to, size),
        "link_friction" => link(to, size),
        "quadratic_drag" => drag(to, size),
        "cogging" => cogging(to, size),
        "torque_offset" => offset(to, size),
        _ => return None,
    })
}

/// Shares of the back-EMF. The truth is the difference from the mean of all joints, the part that a recording shows.
fn viscous(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let joints = to.all();
    let mut values = Vec::new();
    for joint in joints {
        let share = to.draw(size, [0.02, 0.07, 0.22]) * to.rng.random_range(0.25..1.75);
        let value = share * to.machine.joints[joint].back_emf;
        to.machine.joints[joint].friction.viscous += value;
        values.push(value);
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().enumerate().map(|(joint, value)| of_joint("viscous_friction", "v", joint, value - mean)).collect()
}

/// The exponent of the Stribeck curve is drawn; the catalogue's is 2. So v_s is not comparable and has no truth.
fn stribeck(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let exponent = to.rng.random_range(0.8..2.2);
    let share = to.rng.random_range(0.02_f64.ln()..0.12_f64.ln()).exp();
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let dmu = to.draw(size, [0.2, 0.6, 1.6]) * to.machine.joints[joint].friction.coulomb;
        let speed = share * to.usage[joint].speed;
        to.machine.joints[joint].friction.stiction = [dmu, speed, exponent];
        truths.push(of_joint("stribeck", "dmu", joint, dmu));
    }
    truths
}

fn asymmetric(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let dmu = to.draw_signed(size, [0.08, 0.23, 0.6]) * to.machine.joints[joint].friction.coulomb;
        // A motor's back-EMF is the same both ways; only friction differs.
        let is_by_voltage = to.machine.joints[joint].back_emf > 0.0;
        let shares = if is_by_voltage { [0.004, 0.012, 0.03] } else { [0.04, 0.12, 0.3] };
        let dv = to.draw_signed(size, shares) * to.speed_loss(joint);
        to.machine.joints[joint].friction.asymmetry = [dmu, dv];
        truths.push(of_joint("asymmetric_friction", "dmu", joint, dmu));
        truths.push(of_joint("asymmetric_friction", "dv", joint, dv));
    }
    truths
}

fn load(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.elastic()) {
        let a = to.draw(size, [0.15, 0.45, 1.2]) / to.usage[joint].transmitted;
        to.machine.joints[joint].friction.per_load = a;
        truths.push(of_joint("load_friction", "a", joint, a));
    }
    truths
}

/// With a second harmonic that the catalogue's law has not.
fn position(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let (a, phase) = (to.draw(size, [0.06, 0.14, 0.26]), to.rng.random_range(-0.5 * TAU..0.5 * TAU));
        to.machine.joints[joint].friction.wave = [a, phase];
        truths.push(of_joint("position_friction", "a", joint, a));
        truths.push(of_joint("position_friction", "phi", joint, phase));
    }
    truths
}

fn drift(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let constant_s = to.rng.random_range(6.0..25.0);
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let a = to.draw(size, [0.12, 0.22, 0.35]);
        to.machine.joints[joint].friction.warm_up = [a, constant_s];
        truths.push(of_joint("friction_drift", "a", joint, a));
    }
    truths.push(single("friction_drift", "T", constant_s));
    truths
}

fn link(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.elastic()) {
        let mu = to.draw(size, [0.07, 0.2, 0.5]) * to.machine.joints[joint].friction.coulomb;
        let is_by_voltage = to.machine.joints[joint].back_emf > 0.0;
        let shares = if is_by_voltage { [0.004, 0.013, 0.04] } else { [0.05, 0.15, 0.4] };
        let v = to.draw(size, shares) * to.speed_loss(joint);
        let load = &mut to.machine.joints[joint].load;
        (load.coulomb, load.viscous) = (mu, v);
        truths.push(of_joint("link_friction", "mu_l", joint, mu));
        truths.push(of_joint("link_friction", "v_l", joint, v));
    }
    truths
}

fn drag(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let usage = to.usage[joint];
        let c = to.draw(size, [0.01, 0.03, 0.1]) * usage.torque / usage.speed.powi(2);
        to.machine.joints[joint].load.drag = c;
        truths.push(of_joint("quadratic_drag", "c", joint, c));
    }
    truths
}

/// With a second harmonic that the catalogue's law has not.
fn cogging(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let periods = f64::from(to.rng.random_range(1..=14_u8));
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let amplitude = to.draw(size, [0.004, 0.013, 0.04]) * to.usage[joint].torque;
        let phase = to.rng.random_range(-0.5 * TAU..0.5 * TAU);
        to.machine.joints[joint].ripple = [amplitude, periods * to.machine.joints[joint].gear, phase];
        truths.push(of_joint("cogging", "A", joint, amplitude));
        truths.push(of_joint("cogging", "phi", joint, phase));
    }
    truths.push(single("cogging", "p", periods));
    truths
}

fn offset(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let torque = to.draw_signed(size, [0.004, 0.01, 0.03]) * to.usage[joint].torque;
        to.machine.joints[joint].offset += torque;
        truths.push(of_joint("torque_offset", "o", joint, torque));
    }
    truths
}
