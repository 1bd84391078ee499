//! What gyros see of four samples: rates along given axes of a body, with their derivatives by (q, q̇).
//!
//! With Z_j the axis of joint j and ω_j the rate of link j, all in base axes, a sensor axis s on body b sees
//!
//! ```text
//! s·ω_b        ∂/∂q̇_j = s·Z_j        ∂/∂q_j = s·(ω_j × Z_j)        j ≤ b
//! ```
//! Where the rate of an inner body is taken from its own gyro, only the joints behind that body count.

use super::Samples;
use super::vector::{Vector, add_scaled, apply_transposed, combine, cross, dot, zero};
use crate::robot::Matrix3;
use solve::simd::{Simd, Wide};

/// Where the rate of a body begins.
#[derive(Clone, Copy)]
pub enum RateSource<S: Simd> {
    /// A base at rest.
    Base,
    /// This body (and its rate in its own axes, rad/s).
    Body(usize, [Wide<S>; 3]),
}

/// The rate of one body, with what its derivatives need.
#[derive(Clone, Copy)]
pub struct GyroQuads<S: Simd, const L: usize> {
    /// Sensor axes in base axes.
    sensor: [Vector<S>; 3],
    /// ω of the body, in base axes.
    rate: Vector<S>,
    /// Z_j and ω_j × Z_j, zero where joint j does not count.
    by_speed: [Vector<S>; L],
    by_position: [Vector<S>; L],
}

impl<S: Simd, const L: usize> GyroQuads<S, L> {
    /// The body `body`, seen along the rows of `to_sensor`, which takes vectors from its own axes.
    #[inline(always)]
    pub fn of(
        samples: &Samples<S, L>,
        fast: &super::Fast,
        body: usize,
        to_sensor: &Matrix3,
        source: RateSource<S>,
    ) -> Self {
        let bodies = &samples.bodies;
        let nothing = zero(samples.simd);
        let mut rate = nothing;
        let mut first = 0;
        if let RateSource::Body(from, own) = source {
            let link = apply_transposed(&fast.links.to_body(from), own);
            for (axis, value) in bodies.axes(from).iter().zip(link) {
                rate = add_scaled(rate, value, *axis);
            }
            first = from + 1;
        }
        let mut by_speed = [nothing; L];
        let mut by_position = [nothing; L];
        for j in first..=body.min(L - 1) {
            let axis = bodies.turning(j);
            rate = add_scaled(rate, samples.qd[j], axis);
            by_speed[j] = axis;
            by_position[j] = cross(rate, axis);
        }
        let axes = bodies.axes(body);
        let to_body = fast.links.to_body(body);
        let mut sensor = [nothing; 3];
        for (sensor, row) in sensor.iter_mut().zip(to_sensor) {
            // Along the link's axes: rowᵀ · to_body.
            let mut along = [0.0; 3];
            for (j, along) in along.iter_mut().enumerate() {
                *along = row[0] * to_body[0][j] + row[1] * to_body[1][j] + row[2] * to_body[2][j];
            }
            *sensor = combine(axes, along);
        }
        GyroQuads { sensor, rate, by_speed, by_position }
    }

    /// The rate along sensor axis `axis`, rad/s.
    #[inline(always)]
    pub fn rate(&self, axis: usize) -> Wide<S> {
        dot(self.sensor[axis], self.rate)
    }

    /// ∂rate/∂q and ∂rate/∂q̇ along sensor axis `axis`.
    #[inline(always)]
    pub fn slopes(&self, axis: usize) -> ([Wide<S>; L], [Wide<S>; L]) {
        let zeros = [Wide::splat(self.rate[0].simd, 0.0); L];
        let (mut by_position, mut by_speed) = (zeros, zeros);
        for j in 0..L {
            by_position[j] = dot(self.sensor[axis], self.by_position[j]);
            by_speed[j] = dot(self.sensor[axis], self.by_speed[j]);
        }
        (by_position, by_speed)
    }

    /// The rate in the sensor's axes.
    #[inline(always)]
    pub fn in_sensor(&self) -> [Wide<S>; 3] {
        [self.rate(0), self.rate(1), self.rate(2)]
    }

    /// Sensor axis `axis` in the own axes of body `other`.
    #[inline(always)]
    pub fn axis_in(&self, samples: &Samples<S, L>, fast: &super::Fast, axis: usize, other: usize) -> [Wide<S>; 3] {
        let axes = samples.bodies.axes(other);
        let s = self.sensor[axis];
        let link = [dot(axes[0], s), dot(axes[1], s), dot(axes[2], s)];
        let to_body = fast.links.to_body(other);
        let mut own = link;
        for (own, row) in own.iter_mut().zip(to_body) {
            *own = link[0] * row[0] + link[1] * row[1] + link[2] * row[2];
        }
        own
    }
}
