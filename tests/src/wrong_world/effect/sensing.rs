//! Effects of sensors.

use std::f64::consts::TAU;

use host::robot::Side;
use nalgebra::Vector3;
use rand::RngExt;
use rand::seq::IndexedRandom;

use super::{Hiding, Size, Truth, of_joint, single};

/// See [`Hiding::hide`].
pub(super) fn hide(to: &mut Hiding<'_>, id: &str, size: Size) -> Option<Vec<Truth>> {
    Some(match id {
        "gyro_lag" => gyro_lag(to, size),
        "gyro_scale" => gyro_scale(to, size),
        "gyro_bias_drift" => gyro_bias_drift(to, size),
        "gyro_clipping" => gyro_clipping(to, size),
        "encoder_eccentricity" => eccentricity(to, size),
        "encoder_lag" => encoder_lag(to, size),
        _ => return None,
    })
}

/// Two poles where the catalogue has one; T is the group delay of both.
fn gyro_lag(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for gyro in 0..to.machine.gyros.len() {
        to.machine.gyros[gyro].delay_s += to.draw(size, [0.5e-3, 1.5e-3, 4e-3]);
        truths.push(of_joint("gyro_lag", "T", gyro, to.machine.gyros[gyro].delay_s));
    }
    truths
}

fn gyro_scale(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for gyro in 0..to.machine.gyros.len() {
        let scale = Vector3::from([(); 3].map(|()| to.draw_signed(size, [0.006, 0.016, 0.043])));
        to.machine.gyros[gyro].scale = scale;
        truths.extend(of_axes("gyro_scale.A", gyro, scale));
    }
    truths
}

fn gyro_bias_drift(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let constant_s = to.rng.random_range(8.0..40.0);
    let mut truths = Vec::new();
    for gyro in 0..to.machine.gyros.len() {
        let drift = Vector3::from([(); 3].map(|()| to.draw_signed(size, [0.006, 0.016, 0.043])));
        to.machine.gyros[gyro].drift = (drift, constant_s);
        truths.extend(of_axes("gyro_bias_drift.a", gyro, drift));
    }
    truths.push(single("gyro_bias_drift", "T", constant_s));
    truths
}

/// A range that the motion exceeds.
fn gyro_clipping(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for gyro in 0..to.machine.gyros.len() {
        let range = (1.0 - to.draw(size, [0.08, 0.18, 0.32])) * to.gyro_peaks[gyro];
        to.machine.gyros[gyro].range = range;
        truths.push(of_joint("gyro_clipping", "fs", gyro, range));
    }
    truths
}

/// On motor encoders; the catalogue's law has no second harmonic.
fn eccentricity(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let mut truths = Vec::new();
    for joint in to.some_of(to.all()) {
        let (error, phase) = (to.draw(size, [0.25e-3, 0.7e-3, 1.7e-3]), to.rng.random_range(-0.5 * TAU..0.5 * TAU));
        for encoder in to.machine.encoders.iter_mut().filter(|e| e.side == Side::Motor && e.joint == joint) {
            encoder.eccentricity = [error, phase];
            truths.push(of_joint("encoder_eccentricity", "e", joint, error));
            truths.push(of_joint("encoder_eccentricity", "phi", joint, phase));
        }
    }
    truths
}

/// One encoder reads late. Where a joint has two, T is the link's against the motor's.
fn encoder_lag(to: &mut Hiding<'_>, size: Size) -> Vec<Truth> {
    let lag_s = to.slower() * to.draw(size, [0.4e-3, 1.3e-3, 4.3e-3]);
    let choices: Vec<usize> = (0..to.machine.encoders.len()).collect();
    let Some(chosen) = choices.choose(to.rng).copied() else { return Vec::new() };
    to.machine.encoders[chosen].lag_s = lag_s;
    let (side, joint) = (to.machine.encoders[chosen].side, to.machine.encoders[chosen].joint);
    let has_two = to.machine.encoders.iter().filter(|encoder| encoder.joint == joint).count() == 2;
    let sign = if has_two && side == Side::Motor { -1.0 } else { 1.0 };
    vec![of_joint("encoder_lag", "T", joint, sign * lag_s)]
}

fn of_axes(name: &str, gyro: usize, values: Vector3<f64>) -> [Truth; 3] {
    [0, 1, 2].map(|axis| Truth {
        name: format!("{name}[{}.{}]", gyro + 1, ["x", "y", "z"][axis]),
        value: values[axis],
        is_comparable: true,
    })
}
