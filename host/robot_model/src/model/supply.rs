//! The supply voltage where a law changes it: it couples all joints.

use super::Input;
use super::dynamics::Dynamics;
use super::number::quantity::variable;
use crate::robot::Transmission;
use crate::robot::chain::Lanes;

impl Dynamics<'_> {
    /// The supply voltage where a law changes it, with its derivatives by (Σ k_pwm u², Σ k_mi u θ̇, the law's coordinate).
    pub(super) fn supply(&self, x: &[f64], input: &Input<'_>) -> Option<Lanes<3>> {
        let (law, coordinate) = self.model.laws.supply?;
        let (mut a, mut e) = (0.0, 0.0);
        for (i, u) in input.u.iter().enumerate().take(self.coefficients.len()) {
            let (k_pwm, k_mi) = self.motor(i);
            a += k_pwm * u * u;
            e += k_mi * u * x[self.model.layout.thetad(i)];
        }
        let p = variable(self.z[coordinate], 2);
        self.model.laws()[law].supply_v(self.model.drives[0].input_scale, variable(a, 0), variable(e, 1), p)
    }

    /// k_pwm and k_mi of a joint.
    fn motor(&self, i: usize) -> (f64, f64) {
        let c = &self.coefficients[i];
        match self.model.transmissions[i] {
            Transmission::Elastic => (c.torque_constant / c.inertia, c.back_emf / c.inertia),
            Transmission::Rigid => (c.torque_constant, c.back_emf),
        }
    }

    /// ∂U/∂(x, z).
    pub(super) fn supply_slopes(&self, x: &[f64], input: &Input<'_>, volts: &Lanes<3>, out: &mut Vec<f64>) {
        let layout = &self.model.layout;
        out.clear();
        out.resize(self.columns(), 0.0);
        let [by_a, by_e, by_p] = volts.slope;
        for i in 0..layout.joints() {
            let (u, speed) = (input.u[i], x[layout.thetad(i)]);
            let (k_pwm, k_mi) = self.motor(i);
            out[layout.thetad(i)] += by_e * k_mi * u;
            let (by_k_pwm, by_k_mi) = (by_a * u * u, by_e * u * speed);
            let mut by_coefficient = [0.0, by_k_pwm, by_k_mi, 0.0, 0.0, 0.0];
            if layout.is_elastic(i) {
                let b = self.coefficients[i].inertia.recip();
                by_coefficient = [-b * (by_k_pwm * k_pwm + by_k_mi * k_mi), b * by_k_pwm, b * by_k_mi, 0.0, 0.0, 0.0];
            }
            for &(coefficient, coordinate, slope) in &self.slopes[i] {
                out[self.size() + coordinate] += by_coefficient[coefficient] * slope;
            }
            if let (Some(delay), Some(by_delay)) = (self.model.input_delay(), input.by_delay.get(i)) {
                out[self.size() + delay] += (2.0 * by_a * k_pwm * u + by_e * k_mi * speed) * by_delay;
            }
        }
        if let Some((_, coordinate)) = self.model.laws.supply {
            out[self.size() + coordinate] += by_p;
        }
    }
}
