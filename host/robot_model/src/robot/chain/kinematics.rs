//! Angular rates and orientations of the bodies.

use super::super::vector::{Arithmetic, apply, apply_transposed};
use super::{Chain, JointKind};

impl Chain {
    /// Angular velocity of every body in its own axes, rad/s, over a base at rest.
    ///
    /// `q`, `qd`: positions and speeds, one a joint. `out`: one vector a joint.
    pub fn body_rates<T: Arithmetic>(&self, q: &[T], qd: &[T], out: &mut [[T; 3]]) {
        let mut rate = [T::from(0.0); 3];
        for (i, link) in self.links.iter().enumerate() {
            rate = link.inwards(link.turn(q[i]), rate);
            if link.kind == JointKind::Revolute {
                rate[2] += qd[i];
            }
            out[i] = apply(&link.to_body, rate);
        }
    }

    /// Orientation of every body: `out[i]` takes vectors from base axes to the axes of body i.
    pub fn body_rotations<T: Arithmetic>(&self, q: &[T], out: &mut [[[T; 3]; 3]]) {
        // Columns of the rotation: the base's unit vectors seen from the link.
        let mut columns: [[T; 3]; 3] =
            std::array::from_fn(|j| std::array::from_fn(|i| T::from(if i == j { 1.0 } else { 0.0 })));
        for (i, link) in self.links.iter().enumerate() {
            let turn = link.turn(q[i]);
            columns = columns.map(|column| link.inwards(turn, column));
            let in_body = columns.map(|column| apply(&link.to_body, column));
            out[i] = std::array::from_fn(|row| std::array::from_fn(|column| in_body[column][row]));
        }
    }

    /// Position of a point of body `body` (`point_m` in that body's axes), in base axes, m.
    pub fn position<T: Arithmetic>(&self, q: &[T], body: usize, point_m: [f64; 3]) -> [T; 3] {
        let mut point = apply_transposed(&self.links[body].to_body, point_m.map(T::from));
        for i in (0..=body).rev() {
            let link = &self.links[i];
            let turned = link.outwards(link.turn(q[i]), point);
            let origin = link.origin(q[i]);
            point = [turned[0] + origin[0], turned[1] + origin[1], turned[2] + origin[2]];
        }
        point
    }
}
