//! The derivatives of the link equation's left side, for an estimator.

use super::{Chain, Lanes, MAX_JOINTS};

impl Chain {
    /// The torque τ = [`Self::link_torque`] and its derivatives at constant q̈.
    ///
    /// `by_q` and `by_qd` are ∂τ/∂q and ∂τ/∂q̇, n×n by rows (`by_q[i·n + j]` = ∂τ_i/∂q_j); ∂τ/∂q̈ is
    /// [`Self::mass_matrix`]. Without Coriolis terms `by_qd` is zero and costs nothing.
    pub fn link_torque_derivatives(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        tau: &mut [f64],
        by_q: &mut [f64],
        by_qd: &mut [f64],
    ) {
        let n = self.links.len();
        let directions = if self.coriolis { 2 * n } else { n };
        by_qd.fill(0.0);
        // As many at a time as there are, up to eight: two vectors of a usual machine.
        let at = [q, qd, qdd];
        match (directions, n) {
            (..=2, _) => self.slopes::<2, 2>(at, directions, tau, [by_q, by_qd]),
            (..=4, _) => self.slopes::<4, 4>(at, directions, tau, [by_q, by_qd]),
            (..=6, ..=3) => self.slopes::<6, 3>(at, directions, tau, [by_q, by_qd]),
            (_, ..=4) => self.slopes::<8, 4>(at, directions, tau, [by_q, by_qd]),
            _ => self.slopes::<8, MAX_JOINTS>(at, directions, tau, [by_q, by_qd]),
        }
    }

    /// Derivatives by `directions` of the positions, then of the speeds, `W` at a time; of a chain of at most `L` links.
    fn slopes<const W: usize, const L: usize>(
        &self,
        [q, qd, qdd]: [&[f64]; 3],
        directions: usize,
        tau: &mut [f64],
        by: [&mut [f64]; 2],
    ) {
        let n = self.links.len();
        let constant = |v: &[f64]| {
            let mut lanes = [Lanes::<W>::from(0.0); L];
            for (lane, value) in lanes.iter_mut().zip(v) {
                lane.re = *value;
            }
            lanes
        };
        let qdd = constant(qdd);
        for first in (0..directions).step_by(W) {
            let mut varied = [constant(q), constant(qd)];
            let width = W.min(directions - first);
            for lane in 0..width {
                let direction = first + lane;
                varied[direction / n][direction % n].slope[lane] = 1.0;
            }
            let [q, qd] = varied;
            let mut torque = [Lanes::from(0.0); L];
            self.link_torque(&q[..n], &qd[..n], &qdd[..n], &mut torque[..n]);
            for (i, torque) in torque[..n].iter().enumerate() {
                tau[i] = torque.re;
                for (lane, slope) in torque.slope[..width].iter().enumerate() {
                    let direction = first + lane;
                    by[direction / n][i * n + direction % n] = *slope;
                }
            }
        }
    }
}
