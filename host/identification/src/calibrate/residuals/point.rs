//! A point of the search space: all states, the coordinates of the dynamics, gyro biases and rotations.

use nalgebra::{Matrix3, Vector3};

use crate::model::{Dynamics, Model, rotation};
use solve::Step;

/// Where the shared unknowns stand in the border:
///
/// ```text
/// | dynamics (z) | δ of gyro 1 | δ of gyro 2 | … | bias of gyro 1 in recording 1 | gyro 2 in recording 1 | … |
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BorderLayout {
    /// Coordinates of the dynamics.
    pub dynamics: usize,
    /// Gyros.
    pub gyros: usize,
    /// Recordings.
    pub recordings: usize,
}

impl BorderLayout {
    /// Number of shared unknowns.
    pub fn size(&self) -> usize {
        self.dynamics + 3 * self.gyros * (1 + self.recordings)
    }

    /// First of the three components of the misalignment of a gyro.
    pub fn rotation(&self, gyro: usize) -> usize {
        self.dynamics + 3 * gyro
    }

    /// First of the three components of the bias of a gyro in a recording.
    pub fn bias(&self, recording: usize, gyro: usize) -> usize {
        self.dynamics + 3 * (self.gyros + recording * self.gyros + gyro)
    }
}

/// All unknowns of a calibration.
#[derive(Debug, Clone)]
pub struct Point<'m> {
    /// `[k · size + i]`.
    pub states: Vec<f64>,
    /// Coordinates of the dynamics.
    pub z: Vec<f64>,
    /// The dynamics at z.
    pub dynamics: Dynamics<'m>,
    /// Body axes → sensor axes, one a gyro.
    pub rotations: Vec<Matrix3<f64>>,
    /// `[recording][gyro]`, sensor axes, rad/s.
    pub biases: Vec<Vec<Vector3<f64>>>,
}

impl<'m> Point<'m> {
    /// The state at stage k.
    pub fn state(&self, k: usize) -> &[f64] {
        let size = self.dynamics.size();
        &self.states[k * size..(k + 1) * size]
    }

    /// Makes `to` x ⊞ δ: sums for everything but the rotations. Its memory is used again.
    pub fn move_into(&self, step: &Step, layout: &BorderLayout, model: &'m Model, to: &mut Self) {
        let border = &step.border;
        let delta = |at: usize| Vector3::new(border[at], border[at + 1], border[at + 2]);
        to.z.clear();
        to.z.extend(self.z.iter().zip(border).map(|(z, d)| z + d));
        // Far outside of what a law is made for, a straight line leads anywhere.
        for (coordinate, [low, high]) in model.coordinates().bounds() {
            to.z[coordinate] = to.z[coordinate].clamp(low, high);
        }
        to.dynamics = model.at(&to.z);
        for (gyro, (r, to)) in self.rotations.iter().zip(&mut to.rotations).enumerate() {
            // The product of many steps is kept on SO(3).
            *to = rotation::orthonormalised(&rotation::boxplus(r, &delta(layout.rotation(gyro))));
        }
        for (recording, (biases, to)) in self.biases.iter().zip(&mut to.biases).enumerate() {
            for (gyro, (b, to)) in biases.iter().zip(to).enumerate() {
                *to = b + delta(layout.bias(recording, gyro));
            }
        }
        for ((to, x), d) in to.states.iter_mut().zip(&self.states).zip(&step.states) {
            *to = x + d;
        }
    }
}
