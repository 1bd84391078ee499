//! The derivatives of the link equation's left side, for an estimator.

use super::{Chain, Lanes, MAX_JOINTS};

/// Directions carried by one pass: one pass for the usual three joints.
const WIDTH: usize = 3;

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
        self.slopes(q, qd, qdd, Wrt::Position, tau, by_q);
        if self.coriolis {
            self.slopes(q, qd, qdd, Wrt::Speed, tau, by_qd);
        } else {
            by_qd.fill(0.0);
        }
    }

    fn slopes(&self, q: &[f64], qd: &[f64], qdd: &[f64], wrt: Wrt, tau: &mut [f64], out: &mut [f64]) {
        let n = self.links.len();
        let constant = |v: &[f64]| {
            let mut lanes = [Lanes::<WIDTH>::from(0.0); MAX_JOINTS];
            for (lane, value) in lanes.iter_mut().zip(v) {
                lane.re = *value;
            }
            lanes
        };
        let qdd = constant(qdd);
        for first in (0..n).step_by(WIDTH) {
            let mut q = constant(q);
            let mut qd = constant(qd);
            let varied = match wrt {
                Wrt::Position => &mut q,
                Wrt::Speed => &mut qd,
            };
            let width = WIDTH.min(n - first);
            for lane in 0..width {
                varied[first + lane].slope[lane] = 1.0;
            }
            let mut torque = [Lanes::from(0.0); MAX_JOINTS];
            self.link_torque(&q[..n], &qd[..n], &qdd[..n], &mut torque[..n]);
            for (i, torque) in torque[..n].iter().enumerate() {
                tau[i] = torque.re;
                out[i * n + first..][..width].copy_from_slice(&torque.slope[..width]);
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Wrt {
    Position,
    Speed,
}
