//! f and its derivatives at four samples: the drives' laws (6), (11), (12) and the links' accelerations (9).

use super::bodies::Links;
use super::elementary::sigmoid;
use super::{Dynamics, Fast, JOINTS, Samples};
use crate::robot::{Friction, Side};
use solve::simd::{Quad, Simd, Wide};

/// f: the accelerations of L links and of the motors, and what their derivatives are made of.
pub(super) struct Accelerations<S: Simd, const L: usize> {
    pub qdd: [Wide<S>; L],
    pub thetadd: [Wide<S>; JOINTS],
    /// M(q)⁻¹.
    inverse: [[Wide<S>; L]; L],
    /// q − θ, q̇ − θ̇, τ_c, and the friction's sigmoid with its slope by its speed.
    windup: [Wide<S>; JOINTS],
    windup_speed: [Wide<S>; JOINTS],
    torque: [Wide<S>; JOINTS],
    sign: [Wide<S>; JOINTS],
    sign_slope: [Wide<S>; JOINTS],
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

impl<S: Simd, const L: usize> Accelerations<S, L> {
    /// Nothing moves yet; M(q)⁻¹ is known.
    #[inline(always)]
    fn at_rest(samples: &Samples<S, L>) -> Self {
        let simd = samples.simd;
        let zero = Wide::splat(simd, 0.0);
        Accelerations {
            qdd: [zero; L],
            thetadd: [zero; JOINTS],
            inverse: inverse(simd, samples.bodies.mass_matrix()),
            windup: [zero; JOINTS],
            windup_speed: [zero; JOINTS],
            torque: [zero; JOINTS],
            sign: [zero; JOINTS],
            sign_slope: [zero; JOINTS],
        }
    }

    #[inline(always)]
    pub(super) fn of((fast, dynamics): (&Fast, &Dynamics<'_>), samples: &Samples<S, L>, u: &[Quad]) -> Self {
        let simd = samples.simd;
        let (zero, first) = (Wide::splat(simd, 0.0), fast.first::<L>());
        let mut out = Self::at_rest(samples);
        let mut held = [zero; L];
        for i in 0..JOINTS {
            let c = dynamics.coefficients[i];
            let drive = &dynamics.model.drives[i];
            let (q, qd) = (samples.q[first + i], samples.qd[first + i]);
            let (windup, windup_speed) = (q - samples.theta[i], qd - samples.thetad[i]);
            let torque = windup * c.stiffness + windup_speed * c.damping;
            let (sign, slope) = match drive.friction {
                Friction::None => (zero, zero),
                Friction::Coulomb { speed: Side::Motor, slope_s, .. } => {
                    let (sign, slope) = sigmoid(samples.thetad[i] * slope_s);
                    (sign, slope * slope_s)
                }
                Friction::Coulomb { speed: Side::Link, slope_s, .. } => {
                    let (sign, slope) = sigmoid(qd * slope_s);
                    (sign, slope * slope_s)
                }
            };
            let driven = Wide::load(simd, &u[i].0) * (drive.input_scale * c.torque_constant);
            out.thetadd[i] = torque * c.inertia + driven - samples.thetad[i] * c.back_emf - sign * c.coulomb;
            (out.windup[i], out.windup_speed[i], out.torque[i]) = (windup, windup_speed, torque);
            (out.sign[i], out.sign_slope[i]) = (sign, slope);
            held[first + i] = torque;
        }
        out.accelerate(&fast.links, dynamics, samples, held);
        out
    }

    /// From what drives with laws do.
    #[inline(always)]
    pub(super) fn by(
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        samples: &Samples<S, L>,
        torque: &[Quad],
        thetadd: &[Quad],
    ) -> Self {
        let (simd, first) = (samples.simd, fast.first::<L>());
        let mut out = Self::at_rest(samples);
        let mut held = [Wide::splat(simd, 0.0); L];
        for i in 0..JOINTS {
            out.thetadd[i] = Wide::load(simd, &thetadd[i].0);
            held[first + i] = -Wide::load(simd, &torque[i].0);
        }
        out.accelerate(&fast.links, dynamics, samples, held);
        out
    }

    /// The links' accelerations, held back by the drives, by passive joints and by gravity.
    #[inline(always)]
    fn accelerate(&mut self, links: &Links, dynamics: &Dynamics<'_>, samples: &Samples<S, L>, mut held: [Wide<S>; L]) {
        if L > JOINTS {
            for passive in &dynamics.passive {
                let i = passive.joint;
                held[i] = samples.q[i] * passive.stiffness + samples.qd[i] * passive.damping;
            }
        }
        samples.bodies.add_gravity(links, &mut held);
        for i in 0..L {
            let mut sum = Wide::splat(samples.simd, 0.0);
            for j in 0..L {
                sum -= self.inverse[i][j] * held[j];
            }
            self.qdd[i] = sum;
        }
    }

    /// Adds what the passive joints do to the row of link i.
    #[inline(always)]
    fn add_passive(&self, dynamics: &Dynamics<'_>, samples: &Samples<S, L>, i: usize, row: &mut [Quad]) {
        if L == JOINTS {
            return;
        }
        for passive in &dynamics.passive {
            let (simd, j) = (samples.simd, passive.joint);
            let (spring, damper) = (self.inverse[i][j] * passive.stiffness, self.inverse[i][j] * passive.damping);
            let (size, [k, d]) = (dynamics.size(), passive.coordinates);
            let by_coordinates = [(size + k, spring * samples.q[j]), (size + d, damper * samples.qd[j])];
            for (column, by) in [(j, spring), (L + j, damper)].into_iter().chain(by_coordinates) {
                let to = &mut row[column].0;
                *to = (Wide::load(simd, to) - by).to_array();
            }
        }
    }

    /// As [`slopes`](Self::slopes), of the first columns that are `wanted`, with the drives' own derivatives in `rows`: rows of `columns` quads, of the torques, of θ̈ and of the
    /// laws' own states.
    #[inline(always)]
    pub(super) fn slopes_by(
        &self,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        samples: &Samples<S, L>,
        rows: &[Quad],
        (columns, wanted): (usize, usize),
        out: &mut [Quad],
    ) {
        let (simd, first) = (samples.simd, fast.first::<L>());
        let by_position = samples.bodies.torque_by_position(&fast.links, &self.qdd);
        let (torques, rest) = rows.split_at(JOINTS * columns);
        let (motors, rates) = rest.split_at(JOINTS * columns);
        for i in 0..L {
            let row = &mut out[(L + i) * columns..(L + i + 1) * columns];
            for (c, to) in row.iter_mut().enumerate().take(wanted) {
                let mut sum = Wide::splat(simd, 0.0);
                for j in 0..JOINTS {
                    sum = self.inverse[i][first + j].mul_add(Wide::load(simd, &torques[j * columns + c].0), sum);
                }
                to.0 = sum.to_array();
            }
            for j in 0..L {
                let mut by_q = Wide::load(simd, &row[j].0);
                for k in 0..L {
                    by_q -= self.inverse[i][k] * by_position[k][j];
                }
                row[j] = Quad(by_q.to_array());
            }
            self.add_passive(dynamics, samples, i, row);
        }
        let first = 2 * L + JOINTS;
        out[first * columns..(first + JOINTS) * columns].copy_from_slice(motors);
        for (state, rate) in fast.own.iter().zip(rates.chunks_exact(columns)) {
            out[state * columns..(state + 1) * columns].copy_from_slice(rate);
        }
    }

    /// `[∂f/∂x | ∂f/∂z]` of the rows q̈ and θ̈ into a matrix of `columns` quads a row; the other rows stay as they are.
    #[inline(always)]
    pub(super) fn slopes(
        &self,
        (fast, dynamics): (&Fast, &Dynamics<'_>),
        samples: &Samples<S, L>,
        u: &[Quad],
        columns: usize,
        out: &mut [Quad],
    ) {
        let (simd, first) = (samples.simd, fast.first::<L>());
        let (theta, size) = (2 * L, dynamics.size());
        let thetad = theta + JOINTS;
        let by_position = samples.bodies.torque_by_position(&fast.links, &self.qdd);
        for i in 0..L {
            let row = &mut out[(L + i) * columns..(L + i + 1) * columns];
            row[thetad + JOINTS..].fill(Quad::default());
            if L > JOINTS {
                row[L..2 * L].fill(Quad::default());
            }
            let mut by_q = [Wide::splat(simd, 0.0); L];
            for j in 0..JOINTS {
                let (c, link) = (dynamics.coefficients[j], first + j);
                let spring = self.inverse[i][link] * c.stiffness;
                let damper = self.inverse[i][link] * c.damping;
                by_q[link] = -spring;
                row[L + link] = Quad((-damper).to_array());
                row[theta + j] = Quad(spring.to_array());
                row[thetad + j] = Quad(damper.to_array());
                for &(coefficient, coordinate, slope) in &dynamics.slopes[j] {
                    let torque = match coefficient {
                        4 => self.windup[j],
                        5 => self.windup_speed[j],
                        _ => continue,
                    };
                    let to = &mut row[size + coordinate].0;
                    *to = (Wide::load(simd, to) - self.inverse[i][link] * torque * slope).to_array();
                }
            }
            for j in 0..L {
                for k in 0..L {
                    by_q[j] -= self.inverse[i][k] * by_position[k][j];
                }
                row[j] = Quad(by_q[j].to_array());
            }
            self.add_passive(dynamics, samples, i, row);
        }
        for i in 0..JOINTS {
            let (c, link) = (dynamics.coefficients[i], first + i);
            let drive = &dynamics.model.drives[i];
            let row = &mut out[(thetad + i) * columns..(thetad + i + 1) * columns];
            row.fill(Quad::default());
            let mut by_qd = Wide::splat(simd, c.inertia * c.damping);
            let mut by_thetad = Wide::splat(simd, -c.inertia * c.damping - c.back_emf);
            match drive.friction {
                Friction::None => {}
                Friction::Coulomb { speed: Side::Motor, .. } => by_thetad -= self.sign_slope[i] * c.coulomb,
                Friction::Coulomb { speed: Side::Link, .. } => by_qd -= self.sign_slope[i] * c.coulomb,
            }
            row[link] = Quad([c.inertia * c.stiffness; 4]);
            row[L + link] = Quad(by_qd.to_array());
            row[theta + i] = Quad([-c.inertia * c.stiffness; 4]);
            row[thetad + i] = Quad(by_thetad.to_array());
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
                let to = &mut row[size + coordinate].0;
                *to = (Wide::load(simd, to) + by * slope).to_array();
            }
        }
    }
}
