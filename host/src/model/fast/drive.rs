//! f and its derivatives at four samples: the drives' laws (6), (11), (12) and the links' accelerations (9).

use super::elementary::sigmoid;
use super::{Dynamics, Samples};
use crate::robot::{Friction, Side};
use solve::simd::{Quad, Simd, Wide};

/// f: the two accelerations of every joint, and what their derivatives are made of.
pub(super) struct Accelerations<S: Simd, const N: usize> {
    pub qdd: [Wide<S>; N],
    pub thetadd: [Wide<S>; N],
    /// M(q)⁻¹.
    inverse: [[Wide<S>; N]; N],
    /// q − θ, q̇ − θ̇, τ_c, and the friction's sigmoid with its slope by its speed.
    windup: [Wide<S>; N],
    windup_speed: [Wide<S>; N],
    torque: [Wide<S>; N],
    sign: [Wide<S>; N],
    sign_slope: [Wide<S>; N],
}

/// The inverse of a symmetric matrix, of which the lower triangle is given. A pivot that is not positive gives what is not a number.
#[inline(always)]
fn inverse<S: Simd, const N: usize>(simd: S, a: [[Wide<S>; N]; N]) -> [[Wide<S>; N]; N] {
    let (zero, one) = (Wide::splat(simd, 0.0), Wide::splat(simd, 1.0));
    let mut l = a;
    // L with reciprocals on its diagonal.
    for i in 0..N {
        for j in 0..=i {
            let mut sum = a[i][j];
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            l[i][j] = if i == j { one / sum.sqrt() } else { sum * l[j][j] };
        }
    }
    // L⁻¹, then L⁻ᵀ L⁻¹.
    let mut w = [[zero; N]; N];
    for j in 0..N {
        w[j][j] = l[j][j];
        for i in j + 1..N {
            let mut sum = zero;
            for k in j..i {
                sum -= l[i][k] * w[k][j];
            }
            w[i][j] = sum * l[i][i];
        }
    }
    let mut out = [[zero; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let mut sum = zero;
            for k in i..N {
                sum = w[k][i].mul_add(w[k][j], sum);
            }
            out[i][j] = sum;
            out[j][i] = sum;
        }
    }
    out
}

impl<S: Simd, const N: usize> Accelerations<S, N> {
    /// Nothing moves yet; M(q)⁻¹ is known.
    #[inline(always)]
    fn at_rest(samples: &Samples<S, N>) -> Self {
        let simd = samples.simd;
        let zeros = [Wide::splat(simd, 0.0); N];
        Accelerations {
            qdd: zeros,
            thetadd: zeros,
            inverse: inverse(simd, samples.bodies.mass_matrix()),
            windup: zeros,
            windup_speed: zeros,
            torque: zeros,
            sign: zeros,
            sign_slope: zeros,
        }
    }

    #[inline(always)]
    pub(super) fn of(dynamics: &Dynamics<'_>, samples: &Samples<S, N>, u: &[Quad]) -> Self {
        let simd = samples.simd;
        let zero = Wide::splat(simd, 0.0);
        let mut out = Self::at_rest(samples);
        for i in 0..N {
            let c = dynamics.coefficients[i];
            let drive = &dynamics.model.drives[i];
            let (windup, windup_speed) = (samples.q[i] - samples.theta[i], samples.qd[i] - samples.thetad[i]);
            let torque = windup * c.stiffness + windup_speed * c.damping;
            let (sign, slope) = match drive.friction {
                Friction::None => (zero, zero),
                Friction::Coulomb { speed: Side::Motor, slope_s, .. } => {
                    let (sign, slope) = sigmoid(samples.thetad[i] * slope_s);
                    (sign, slope * slope_s)
                }
                Friction::Coulomb { speed: Side::Link, slope_s, .. } => {
                    let (sign, slope) = sigmoid(samples.qd[i] * slope_s);
                    (sign, slope * slope_s)
                }
            };
            let driven = Wide::load(simd, &u[i].0) * (drive.input_scale * c.torque_constant);
            out.thetadd[i] = torque * c.inertia + driven - samples.thetad[i] * c.back_emf - sign * c.coulomb;
            (out.windup[i], out.windup_speed[i], out.torque[i]) = (windup, windup_speed, torque);
            (out.sign[i], out.sign_slope[i]) = (sign, slope);
        }
        for i in 0..N {
            let mut sum = zero;
            for j in 0..N {
                sum -= out.inverse[i][j] * out.torque[j];
            }
            out.qdd[i] = sum;
        }
        out
    }

    /// From what drives with laws do.
    #[inline(always)]
    pub(super) fn by(samples: &Samples<S, N>, torque: &[Quad], thetadd: &[Quad]) -> Self {
        let simd = samples.simd;
        let mut out = Self::at_rest(samples);
        for i in 0..N {
            out.thetadd[i] = Wide::load(simd, &thetadd[i].0);
            for j in 0..N {
                out.qdd[i] = out.inverse[i][j].mul_add(Wide::load(simd, &torque[j].0), out.qdd[i]);
            }
        }
        out
    }

    /// As [`slopes`](Self::slopes), with the drives' own derivatives in `rows`: 2N of `columns` quads, of the torques and of θ̈.
    #[inline(always)]
    pub(super) fn slopes_by(&self, samples: &Samples<S, N>, rows: &[Quad], columns: usize, out: &mut [Quad]) {
        let simd = samples.simd;
        let by_position = samples.bodies.torque_by_position(&self.qdd);
        let (torques, motors) = rows.split_at(N * columns);
        for i in 0..N {
            let row = &mut out[(N + i) * columns..(N + i + 1) * columns];
            for (c, to) in row.iter_mut().enumerate() {
                let mut sum = Wide::splat(simd, 0.0);
                for j in 0..N {
                    sum = self.inverse[i][j].mul_add(Wide::load(simd, &torques[j * columns + c].0), sum);
                }
                to.0 = sum.to_array();
            }
            for j in 0..N {
                let mut by_q = Wide::load(simd, &row[j].0);
                for k in 0..N {
                    by_q -= self.inverse[i][k] * by_position[k][j];
                }
                row[j] = Quad(by_q.to_array());
            }
            out[(3 * N + i) * columns..][..columns].copy_from_slice(&motors[i * columns..][..columns]);
        }
    }

    /// `[∂f/∂x | ∂f/∂z]` of the rows q̈ and θ̈ into a matrix of 4N rows of `columns` quads; the other rows stay as they are.
    #[inline(always)]
    pub(super) fn slopes(
        &self,
        dynamics: &Dynamics<'_>,
        samples: &Samples<S, N>,
        u: &[Quad],
        columns: usize,
        out: &mut [Quad],
    ) {
        let simd = samples.simd;
        let by_position = samples.bodies.torque_by_position(&self.qdd);
        for i in 0..N {
            let row = &mut out[(N + i) * columns..(N + i + 1) * columns];
            row[4 * N..].fill(Quad::default());
            for j in 0..N {
                let c = dynamics.coefficients[j];
                let spring = self.inverse[i][j] * c.stiffness;
                let damper = self.inverse[i][j] * c.damping;
                let mut by_q = -spring;
                for k in 0..N {
                    by_q -= self.inverse[i][k] * by_position[k][j];
                }
                row[j] = Quad(by_q.to_array());
                row[N + j] = Quad((-damper).to_array());
                row[2 * N + j] = Quad(spring.to_array());
                row[3 * N + j] = Quad(damper.to_array());
                for &(coefficient, coordinate, slope) in &dynamics.slopes[j] {
                    let torque = match coefficient {
                        4 => self.windup[j],
                        5 => self.windup_speed[j],
                        _ => continue,
                    };
                    let to = &mut row[4 * N + coordinate].0;
                    *to = (Wide::load(simd, to) - self.inverse[i][j] * torque * slope).to_array();
                }
            }
        }
        for i in 0..N {
            let c = dynamics.coefficients[i];
            let drive = &dynamics.model.drives[i];
            let row = &mut out[(3 * N + i) * columns..(3 * N + i + 1) * columns];
            row.fill(Quad::default());
            let mut by_qd = Wide::splat(simd, c.inertia * c.damping);
            let mut by_thetad = Wide::splat(simd, -c.inertia * c.damping - c.back_emf);
            match drive.friction {
                Friction::None => {}
                Friction::Coulomb { speed: Side::Motor, .. } => by_thetad -= self.sign_slope[i] * c.coulomb,
                Friction::Coulomb { speed: Side::Link, .. } => by_qd -= self.sign_slope[i] * c.coulomb,
            }
            row[i] = Quad([c.inertia * c.stiffness; 4]);
            row[N + i] = Quad(by_qd.to_array());
            row[2 * N + i] = Quad([-c.inertia * c.stiffness; 4]);
            row[3 * N + i] = Quad(by_thetad.to_array());
            for &(coefficient, coordinate, slope) in &dynamics.slopes[i] {
                // In the order of the coefficients' list.
                let by = match coefficient {
                    0 => self.torque[i],
                    1 => Wide::load(simd, &u[i].0) * drive.input_scale,
                    2 => -samples.thetad[i],
                    3 => -self.sign[i],
                    4 => self.windup[i] * c.inertia,
                    _ => self.windup_speed[i] * c.inertia,
                };
                let to = &mut row[4 * N + coordinate].0;
                *to = (Wide::load(simd, to) + by * slope).to_array();
            }
        }
    }
}
