//! M(q) and the derivatives of the link equation's left side, for an estimator.

use nalgebra::{Const, SVector};
use num_dual::{Derivative, DualSVec64};

use super::{Chain, MAX_JOINTS};

/// Directions carried by one pass.
const LANES: usize = 3;
type Lanes = DualSVec64<LANES>;

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
        self.link_torque(q, qd, qdd, tau);
        self.columns(q, qd, qdd, Wrt::Position, by_q);
        if self.coriolis {
            self.columns(q, qd, qdd, Wrt::Speed, by_qd);
        } else {
            by_qd.fill(0.0);
        }
    }

    fn columns(&self, q: &[f64], qd: &[f64], qdd: &[f64], wrt: Wrt, out: &mut [f64]) {
        let n = self.links.len();
        let constant = |v: &[f64]| -> [Lanes; MAX_JOINTS] {
            std::array::from_fn(|i| Lanes::from(v.get(i).copied().unwrap_or(0.0)))
        };
        let qdd = constant(qdd);
        for first in (0..n).step_by(LANES) {
            let mut q = constant(q);
            let mut qd = constant(qd);
            let varied = match wrt {
                Wrt::Position => &mut q,
                Wrt::Speed => &mut qd,
            };
            for lane in 0..LANES.min(n - first) {
                let mut unit = SVector::<f64, LANES>::zeros();
                unit[lane] = 1.0;
                varied[first + lane].eps = Derivative::some(unit);
            }
            let mut tau = [Lanes::from(0.0); MAX_JOINTS];
            self.link_torque(&q[..n], &qd[..n], &qdd[..n], &mut tau[..n]);
            for (i, tau) in tau[..n].iter().enumerate() {
                let slope = tau.eps.unwrap_generic(Const::<LANES>, Const::<1>);
                for lane in 0..LANES.min(n - first) {
                    out[i * n + first + lane] = slope[lane];
                }
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Wrt {
    Position,
    Speed,
}
