//! Effects of bodies and of what they stand on.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::RngExt;

use super::{Hiding, Size, Truth, of_joint, single};
use crate::wrong_world::chain::{Link, Values};
use crate::wrong_world::machine::Bearing;

/// See [`Hiding::hide`].
pub(super) fn hide(to: &mut Hiding<'_>, id: &str, size: Size) -> Option<Vec<Truth>> {
    Some(match id {
        "gravity_residual" => gravity_residual(to, size),
        "cable_spring" => cable_spring(to, size),
        "coriolis" => {
            to.machine.coriolis = 1.0;
            vec![single(id, "scale", 1.0)]
        }
        "link_inertia" => payload(to, size),
        "base_bearing" => bearing(to, size),
        _ => return None,
    })
}

fn gravity_residual(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let bodies = &to.machine.chain.links[to.machine.bearings.len()..];
    let suited: Vec<usize> = (0..bodies.len()).filter(|joint| bodies[*joint].is_compensated).collect();
    let mut truths = Vec::new();
    for joint in to.some_of(suited) {
        let torque = to.draw_signed(size, [0.006, 0.02, 0.06]) * to.usage[joint].torque;
        let angle = to.rng.random_range(-0.3..0.3);
        to.machine.joints[joint].load.gravity = [torque, angle];
        truths.push(of_joint("gravity_residual", "G", joint, torque));
        truths.push(of_joint("gravity_residual", "q0", joint, angle));
    }
    truths
}

fn cable_spring(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.elastic()) {
        let usage = to.usage[joint];
        let stiffness = to.draw(size, [0.006, 0.02, 0.06]) * usage.torque / usage.position;
        to.machine.joints[joint].load.spring = stiffness;
        truths.push(of_joint("cable_spring", "k_c", joint, stiffness));
    }
    truths
}

/// A mass at the head, 4/3 of the way to the outermost body's centre. Bodies are wrong besides, so its mass alone is no truth.
fn payload(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let share = to.draw(size, [0.03, 0.1, 0.26]);
    let Some(body) = to.machine.chain.links.last_mut() else { return Vec::new() };
    let head = 4.0 / 3.0 * body.centre;
    let inertia = body.inertia.trace() / 2.0 + body.mass * body.centre.norm_squared();
    let mass = share * inertia / head.norm_squared();
    body.add_point_mass(mass, head);
    vec![single("link_inertia", "m", mass).not_comparable()]
}

/// Springs that harden with the tilt; k and d are those of small tilts. A trace is a stiffer bearing than weak.
fn bearing(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let inertia = tilting_inertia(to);
    let mut bearings = [Bearing { stiffness: 0.0, damping: 0.0, hardening: 0.0 }; 2];
    for (bearing, inertia) in bearings.iter_mut().zip(inertia) {
        // Compliances, as shares of that at 4.4 Hz.
        let compliance = to.draw(size, [0.58, 1.0, 2.8]);
        bearing.stiffness = (TAU * 4.4).powi(2) * inertia / compliance;
        let ratio = to.rng.random_range(0.05..0.09);
        bearing.damping = 2.0 * ratio * (bearing.stiffness * inertia).sqrt();
        bearing.hardening = to.rng.random_range(0.0..0.3);
    }
    to.machine.stand_on(bearings);
    let [x, y] = bearings;
    [("k[x]", x.stiffness), ("k[y]", y.stiffness), ("d[x]", x.damping), ("d[y]", y.damping)]
        .map(|(symbol, value)| single("base_bearing", symbol, value))
        .to_vec()
}

/// Inertia of the whole machine about x and y of the base, kg m².
fn tilting_inertia(to: &Hiding<'_>) -> [f64; 2] {
    let mut chain = to.machine.chain.clone();
    chain.links.splice(0..0, [Vector3::x(), Vector3::y()].map(Link::massless));
    let mass = chain.mass_matrix(&chain.pose(&Values::zeros()));
    [mass[(0, 0)], mass[(1, 1)]]
}
