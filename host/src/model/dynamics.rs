//! ẋ = f(x, u), equation (9), and its derivatives.
//!
//! The links' accelerations a solve `A a = −(c + g) − τ` with A = M(q) + b of the rigid joints and τ the drives' torques. Their derivatives
//! follow from the implicit function: `A ∂a = −(∂(M a + c + g) + ∂τ)` at fixed a, so only the cheap left side is differentiated,
//! never the solution of the linear system.

use nalgebra::{Const, SVector};
use num_dual::{Derivative, DualSVec64};

use super::Model;
use super::drive::{Coefficients, Sides};
use crate::robot::Transmission;
use crate::robot::chain::MAX_JOINTS;

/// Four sides of a transmission and its six coefficients: all that one drive's law depends on.
const LOCAL: usize = 4 + Coefficients::<f64>::COUNT;
type Local = DualSVec64<LOCAL>;

/// Derivatives of coefficients by coordinates are taken this many at a time.
const LANES: usize = 8;
type Lanes = DualSVec64<LANES>;

/// A model at given parameters.
#[derive(Debug, Clone)]
pub struct Dynamics<'m> {
    pub(super) model: &'m Model,
    pub(super) coefficients: Vec<Coefficients<f64>>,
    /// For each joint: (coefficient, coordinate, ∂coefficient/∂coordinate).
    pub(super) slopes: Vec<Vec<(usize, usize, f64)>>,
    pub(super) speed_of: Vec<Option<usize>>,
}

/// f and its derivatives at one point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Linear {
    /// f, one value a state component.
    pub xdot: Vec<f64>,
    /// `[∂f/∂x | ∂f/∂z]`, size × (size + coordinates), row-major.
    pub slopes: Vec<f64>,
}

impl<'m> Dynamics<'m> {
    pub(super) fn new(model: &'m Model, z: &[f64]) -> Self {
        let drives = || model.drives.iter().zip(&model.transmissions);
        let coefficients = drives().map(|(drive, &t)| drive.coefficients(z, t)).collect();
        let mut slopes = vec![Vec::new(); model.drives.len()];
        for first in (0..z.len()).step_by(LANES) {
            let duals: Vec<Lanes> =
                z.iter().enumerate().map(|(i, &z)| seeded::<LANES>(z, i.wrapping_sub(first))).collect();
            for ((drive, &t), slopes) in drives().zip(&mut slopes) {
                for (c, value) in drive.coefficients(&duals, t).to_array().into_iter().enumerate() {
                    for (lane, slope) in gradient(value).into_iter().enumerate() {
                        if slope != 0.0 {
                            slopes.push((c, first + lane, slope));
                        }
                    }
                }
            }
        }
        Dynamics { model, coefficients, slopes, speed_of: model.layout.speed_of() }
    }

    /// Number of state components.
    pub fn size(&self) -> usize {
        self.model.layout.size()
    }

    /// Columns of [`Linear::slopes`]: state components, then coordinates.
    pub fn columns(&self) -> usize {
        self.size() + self.model.coordinates.len()
    }

    /// f(x, u): `u` has one input a joint in the robot's unit.
    pub fn derivative(&self, x: &[f64], u: &[f64], xdot: &mut [f64]) {
        let layout = &self.model.layout;
        let n = layout.joints();
        let mut right = [0.0; MAX_JOINTS];
        let mut rigid_inertia = [0.0; MAX_JOINTS];
        let (q, qd) = (&x[..n], &x[n..2 * n]);
        self.model.chain.bias_torque(q, qd, &mut right[..n]);
        for i in 0..n {
            let (drive, c, sides) = (&self.model.drives[i], &self.coefficients[i], self.sides(x, u, i));
            match self.model.transmissions[i] {
                Transmission::Elastic => {
                    let action = drive.elastic(c, &sides);
                    right[i] = -right[i] - action.transmission_torque;
                    xdot[layout.theta(i)] = sides.thetad;
                    xdot[layout.thetad(i)] = action.motor_acceleration;
                }
                Transmission::Rigid => {
                    let action = drive.rigid(c, &sides);
                    right[i] = action.torque - right[i];
                    rigid_inertia[i] = action.inertia;
                }
            }
        }
        let inertia = self.inertia(q, &rigid_inertia);
        inertia.solve(n, &mut right);
        xdot[..n].copy_from_slice(qd);
        xdot[n..2 * n].copy_from_slice(&right[..n]);
    }

    /// f and its derivatives by state and coordinates.
    pub fn linearise(&self, x: &[f64], u: &[f64], out: &mut Linear) {
        let layout = &self.model.layout;
        let (n, size, columns) = (layout.joints(), self.size(), self.columns());
        out.xdot.resize(size, 0.0);
        out.slopes.clear();
        out.slopes.resize(size * columns, 0.0);
        let (q, qd) = (&x[..n], &x[n..2 * n]);
        let mut locals = [Local::from(0.0); MAX_JOINTS];
        let mut rigid = [Local::from(0.0); MAX_JOINTS];
        let mut right = [0.0; MAX_JOINTS];
        let mut rigid_inertia = [0.0; MAX_JOINTS];
        self.model.chain.bias_torque(q, qd, &mut right[..n]);
        for i in 0..n {
            let sides = self.sides(x, u, i);
            let dual_sides = Sides {
                q: seeded(sides.q, 0),
                qd: seeded(sides.qd, 1),
                theta: seeded(sides.theta, 2),
                thetad: seeded(sides.thetad, 3),
                u: sides.u,
            };
            let mut lane = 3;
            let coefficients = Coefficients::from_array(self.coefficients[i].to_array().map(|c| {
                lane += 1;
                seeded(c, lane)
            }));
            let drive = &self.model.drives[i];
            match self.model.transmissions[i] {
                Transmission::Elastic => {
                    let action = drive.elastic(&coefficients, &dual_sides);
                    locals[i] = action.transmission_torque;
                    right[i] = -right[i] - action.transmission_torque.re;
                    out.xdot[layout.theta(i)] = sides.thetad;
                    out.slopes[layout.theta(i) * columns + layout.thetad(i)] = 1.0;
                    let row = layout.thetad(i);
                    out.xdot[row] = action.motor_acceleration.re;
                    let row = &mut out.slopes[row * columns..(row + 1) * columns];
                    self.scatter(i, gradient(action.motor_acceleration), 1.0, row);
                }
                Transmission::Rigid => {
                    let action = drive.rigid(&coefficients, &dual_sides);
                    locals[i] = -action.torque;
                    rigid[i] = action.inertia;
                    right[i] = action.torque.re - right[i];
                    rigid_inertia[i] = action.inertia.re;
                }
            }
        }
        let inertia = self.inertia(q, &rigid_inertia);
        inertia.solve(n, &mut right);
        let acceleration = &right[..n];
        out.xdot[..n].copy_from_slice(qd);
        out.xdot[n..2 * n].copy_from_slice(acceleration);

        // −∂(M a + c + g + τ) at fixed a, then A⁻¹ of it, in place of the q̈ rows.
        let mut left = [0.0; MAX_JOINTS];
        let mut by_q = [0.0; MAX_JOINTS * MAX_JOINTS];
        let mut by_qd = [0.0; MAX_JOINTS * MAX_JOINTS];
        let (by_q, by_qd) = (&mut by_q[..n * n], &mut by_qd[..n * n]);
        self.model.chain.link_torque_derivatives(q, qd, acceleration, &mut left[..n], by_q, by_qd);
        let block = &mut out.slopes[n * columns..2 * n * columns];
        for (i, row) in block.chunks_exact_mut(columns).enumerate() {
            for j in 0..n {
                row[j] = -by_q[i * n + j];
                row[n + j] = -by_qd[i * n + j];
            }
            let mut torque = gradient(locals[i]);
            if self.model.transmissions[i] == Transmission::Rigid {
                for (t, inertia) in torque.iter_mut().zip(gradient(rigid[i])) {
                    *t += inertia * acceleration[i];
                }
            }
            self.scatter(i, torque, -1.0, row);
        }
        inertia.solve_rows(n, block, columns);
        for i in 0..n {
            out.slopes[i * columns + n + i] = 1.0;
        }
    }

    /// Adds the derivatives of joint i's law, by its sides and coefficients, to a row over state and coordinates.
    fn scatter(&self, i: usize, gradient: [f64; LOCAL], sign: f64, row: &mut [f64]) {
        let layout = &self.model.layout;
        let places = [layout.q(i), layout.qd(i), layout.theta(i), layout.thetad(i)];
        for (place, slope) in places.into_iter().zip(gradient) {
            row[place] += sign * slope;
        }
        let z = &mut row[self.size()..];
        for &(coefficient, coordinate, slope) in &self.slopes[i] {
            z[coordinate] += sign * gradient[4 + coefficient] * slope;
        }
    }

    fn sides(&self, x: &[f64], u: &[f64], i: usize) -> Sides<f64> {
        let layout = &self.model.layout;
        Sides {
            q: x[layout.q(i)],
            qd: x[layout.qd(i)],
            theta: x[layout.theta(i)],
            thetad: x[layout.thetad(i)],
            u: u[i],
        }
    }

    /// A = M(q) + b of the rigid joints, factorised.
    fn inertia(&self, q: &[f64], rigid_inertia: &[f64; MAX_JOINTS]) -> Inertia {
        let n = q.len();
        let mut matrix = [0.0; MAX_JOINTS * MAX_JOINTS];
        self.model.chain.mass_matrix(q, &mut matrix[..n * n]);
        for i in 0..n {
            matrix[i * n + i] += rigid_inertia[i];
        }
        Inertia::factorise(n, matrix)
    }
}

/// A dual number with a one in `lane` (none where the lane is out of range).
fn seeded<const N: usize>(value: f64, lane: usize) -> DualSVec64<N> {
    let mut unit = SVector::<f64, N>::zeros();
    if lane < N {
        unit[lane] = 1.0;
    }
    DualSVec64::new(value, Derivative::some(unit))
}

fn gradient<const N: usize>(value: DualSVec64<N>) -> [f64; N] {
    value.eps.unwrap_generic(Const::<N>, Const::<1>).into()
}

/// Cholesky factor of the joint-space inertia, n × n by rows, reciprocals on the diagonal.
///
/// A pivot that is not positive (a trial b < 0 of a rigid joint) gives NaN accelerations: the solver rejects such a step.
struct Inertia([f64; MAX_JOINTS * MAX_JOINTS]);

impl Inertia {
    fn factorise(n: usize, mut a: [f64; MAX_JOINTS * MAX_JOINTS]) -> Self {
        for i in 0..n {
            for j in 0..=i {
                let mut sum = a[i * n + j];
                for k in 0..j {
                    sum -= a[i * n + k] * a[j * n + k];
                }
                a[i * n + j] = if i == j { sum.sqrt().recip() } else { sum * a[j * n + j] };
            }
        }
        Inertia(a)
    }

    /// Solves A x = x in place.
    fn solve(&self, n: usize, x: &mut [f64; MAX_JOINTS]) {
        let l = &self.0;
        for i in 0..n {
            for k in 0..i {
                x[i] -= l[i * n + k] * x[k];
            }
            x[i] *= l[i * n + i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                x[i] -= l[k * n + i] * x[k];
            }
            x[i] *= l[i * n + i];
        }
    }

    /// Solves A X = X in place for n rows of `columns` values.
    fn solve_rows(&self, n: usize, x: &mut [f64], columns: usize) {
        let l = &self.0;
        for i in 0..n {
            for k in 0..i {
                subtract_row(x, columns, i, k, l[i * n + k]);
            }
            scale_row(x, columns, i, l[i * n + i]);
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                subtract_row(x, columns, i, k, l[k * n + i]);
            }
            scale_row(x, columns, i, l[i * n + i]);
        }
    }
}

/// Row i loses `factor` times row k.
fn subtract_row(x: &mut [f64], columns: usize, i: usize, k: usize, factor: f64) {
    let (low, high) = x.split_at_mut(i.max(k) * columns);
    let (row_i, row_k) = if i > k {
        (&mut high[..columns], &low[k * columns..][..columns])
    } else {
        (&mut low[i * columns..][..columns], &high[..columns])
    };
    for (a, b) in row_i.iter_mut().zip(row_k) {
        *a -= factor * b;
    }
}

fn scale_row(x: &mut [f64], columns: usize, i: usize, factor: f64) {
    for a in &mut x[i * columns..(i + 1) * columns] {
        *a *= factor;
    }
}
