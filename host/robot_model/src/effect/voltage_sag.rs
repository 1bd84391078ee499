//! Voltage sag: the supply gives way to the power drawn.
//!
//! ```text
//! U = U_max − r Σ u_j τ_m,j,  not above U_max,   with τ_m,j = k_pwm U u_j − k_mi θ̇_j
//! ```
//!
//! The torques depend on the voltage that they lower; the equation is linear in U and is solved for it.

use rand::Rng;

use super::surrogate::{Law, Laws, Of, Parameters, Quantity, only};
use super::{Drive, Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, TrueValue};
use crate::model::Expression;
use crate::robot::chain::Lanes;
use crate::robot::{InputUnit, Robot};

pub(super) const EFFECT: Effect = Effect {
    id: "voltage_sag",
    row: Row::Motor,
    title: "the supply sags with the power drawn",
    equation: "U = U_max − r Σ u_j τ_m,j, not above U_max",
    parameters: &[EffectParameter::size("r", "V/(N m)")
        .typically(0.02, 0.5, Scale::SupplyPerTorqueRms)
        .sizes("0.005, 0.015, 0.04 (0.005 to 0.05 met)")],
    nuisances: &[],
    confounded_with: &["current_limit", "quadratic_drag"],
    about: "Cables, connectors and a small power supply have resistance. When all motors pull at once the voltage falls \
            and every motor has less torque than its duty promises. A diode keeps braking motors from lifting it. Motion of \
            all axes at once separates it from what a single motor does.",
    make,
    laws,
};

const R_V_PER_N_M: [f64; 3] = [0.005, 0.015, 0.04];

#[derive(Debug)]
struct VoltageSag {
    r: f64,
}

impl Physics for VoltageSag {
    fn supply_v(&self, drive: &Drive<'_>, supply_v: f64) -> f64 {
        // U = U_max − r (U a − e):  a = Σ k_pwm u², e = Σ k_mi u θ̇
        let (mut a, mut e) = (0.0, 0.0);
        for (j, u) in drive.duty.iter().enumerate() {
            a += drive.k_pwm[j] * u * u;
            e += drive.k_mi[j] * u * drive.speed[j];
        }
        ((supply_v + self.r * e) / (1.0 + self.r * a)).min(supply_v)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    if robot.input.unit != InputUnit::Duty {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the motors are not driven by a duty" });
    }
    Ok(sag(size.draw(R_V_PER_N_M, rng)))
}

/// A supply that sags by `r` V per N m.
pub fn sag(r: f64) -> Hidden {
    let values = vec![TrueValue { name: format!("{}.r", EFFECT.id), unit: "V/(N m)", value: r }];
    Hidden { id: EFFECT.id, values, physics: Box::new(VoltageSag { r }) }
}

/// The same equation.
#[derive(Debug)]
struct SagLaw {
    parameters: Parameters,
}

impl Law for SagLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn supply_v(&self, full_v: f64, a: Lanes<3>, e: Lanes<3>, p: Lanes<3>) -> Option<Lanes<3>> {
        Some(volts(full_v, a, e, p))
    }

    fn supply_traced(&self, full_v: f64, a: Expression, e: Expression, p: Expression) -> Option<Expression> {
        Some(volts(full_v, a, e, p))
    }
}

fn volts<T: Quantity>(full_v: f64, a: T, e: T, p: T) -> T {
    let full = T::from(full_v);
    let drawn = a * full_v - e;
    drawn.where_positive((full + p * e) * (T::from(1.0) + p * a).recip(), full)
}

fn laws(robot: &Robot) -> Laws {
    if robot.input.unit != InputUnit::Duty {
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason: "the motors are not driven by a duty" });
    }
    let mut parameters = Parameters::on(EFFECT.id, robot);
    parameters.plain("r", "V/(N m)", Of::All, 0.0);
    parameters.within("r", [0.0, f64::INFINITY]);
    only(SagLaw { parameters })
}
