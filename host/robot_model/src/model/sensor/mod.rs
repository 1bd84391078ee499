//! What the gyros should read: `R_imu ω_body + bias`, equations (22)–(29) in general form, on a base at rest.

use nalgebra::{Const, Matrix3, SVector, Vector3};
use num_dual::{Derivative, DualSVec64};

pub mod laws;

use super::rotation::skew;
use crate::robot::chain::{Chain, MAX_JOINTS};

/// Derivatives of body rates are taken this many at a time.
const LANES: usize = 6;
type Lanes = DualSVec64<LANES>;

/// Angular rates of all bodies at one instant, with their derivatives by (q, q̇).
#[derive(Debug, Clone, Default)]
pub struct SensorFrame {
    joints: usize,
    rates: Vec<[f64; 3]>,
    /// `slopes[body][column]`: ∂ω_body/∂(q, q̇), 2n columns a body.
    slopes: Vec<[f64; 3]>,
}

/// The derivatives of a gyro's prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GyroSlopes {
    /// By the misalignment δ of `R ⊞ δ`, at δ = 0.
    pub by_rotation: Matrix3<f64>,
}

impl SensorFrame {
    /// Evaluates the rates of all bodies of `chain` at (q, q̇), rad and rad/s.
    pub fn rates(&mut self, chain: &Chain, q: &[f64], qd: &[f64]) {
        self.joints = q.len();
        self.rates.resize(q.len(), [0.0; 3]);
        chain.body_rates(q, qd, &mut self.rates);
    }

    /// [`rates`](Self::rates) with their derivatives.
    pub fn linearise(&mut self, chain: &Chain, q: &[f64], qd: &[f64]) {
        let n = q.len();
        self.joints = n;
        self.rates.resize(n, [0.0; 3]);
        self.slopes.resize(n * 2 * n, [0.0; 3]);
        for first in (0..2 * n).step_by(LANES) {
            let seeded = |value: f64, index: usize| {
                let mut unit = SVector::<f64, LANES>::zeros();
                if (first..first + LANES).contains(&index) {
                    unit[index - first] = 1.0;
                }
                Lanes::new(value, Derivative::some(unit))
            };
            let zero = Lanes::from(0.0);
            let (mut dual_q, mut dual_qd) = ([zero; MAX_JOINTS], [zero; MAX_JOINTS]);
            for i in 0..n {
                dual_q[i] = seeded(q[i], i);
                dual_qd[i] = seeded(qd[i], n + i);
            }
            let mut rates = [[zero; 3]; MAX_JOINTS];
            chain.body_rates(&dual_q[..n], &dual_qd[..n], &mut rates[..n]);
            for (body, rate) in rates[..n].iter().enumerate() {
                for axis in 0..3 {
                    self.rates[body][axis] = rate[axis].re;
                    let slope = rate[axis].eps.unwrap_generic(Const::<LANES>, Const::<1>);
                    for lane in 0..LANES.min(2 * n - first) {
                        self.slopes[body * 2 * n + first + lane][axis] = slope[lane];
                    }
                }
            }
        }
    }

    /// ω of `body` in its own axes, rad/s.
    pub fn rate(&self, body: usize) -> Vector3<f64> {
        Vector3::from(self.rates[body])
    }

    /// ∂ω of `body` by component `column` of (q, q̇).
    pub fn slope(&self, body: usize, column: usize) -> Vector3<f64> {
        Vector3::from(self.slopes[body * 2 * self.joints + column])
    }

    /// The prediction of a gyro on `body` with rotation R and bias, and its derivative by the misalignment. By the body's rate it is R.
    pub fn gyro(&self, body: usize, rotation: &Matrix3<f64>, bias: &Vector3<f64>) -> (Vector3<f64>, GyroSlopes) {
        let rate = self.rate(body);
        (rotation * rate + bias, GyroSlopes { by_rotation: -rotation * skew(&rate) })
    }
}
