//! Motor mismatch: motors of one type are not identical.
//!
//! ```text
//! b_i = b (1 + db_i),   k_pwm,i = k_pwm (1 + dk_pwm_i),   k_mi,i = k_mi (1 + dk_mi_i),   each Σ_i d_i = 0
//! ```
//!
//! What is common to all motors belongs to the shared parameter, so the differences of each kind add up to nothing.

use rand::{Rng, RngExt};

use super::surrogate::{At, Differences, Hook, Law, Laws, Parameters, Quantity, acts_on_joints, only};
use super::{Effect, EffectError, EffectParameter, Hidden, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "motor_mismatch",
    row: Row::Motor,
    title: "motors that are not identical",
    equation: "b (1 + db_i), k_pwm (1 + dk_pwm_i), k_mi (1 + dk_mi_i)",
    parameters: &[
        EffectParameter::size("db[i]", "1")
            .typically(0.06, 0.4, Scale::Si)
            .sizes("largest 4, 8, 14 % (3 to 15 met), either sign, sum 0"),
        EffectParameter::size("dk_pwm[i]", "1").typically(0.06, 0.4, Scale::Si).sizes("as db"),
        EffectParameter::size("dk_mi[i]", "1").typically(0.06, 0.4, Scale::Si).sizes("as db"),
    ],
    nuisances: &[],
    confounded_with: &["viscous_friction", "link_inertia", "b", "k_pwm", "k_mi"],
    about: "Magnets and windings of one batch differ by some per cent, and so do the pulleys behind them. A model that \
            gives all motors one number averages over them.",
    make,
    laws,
};

const LARGEST: [f64; 3] = [0.04, 0.08, 0.13];
const SYMBOLS: [(Symbol, &str); 3] = [(Symbol::B, "db"), (Symbol::KPwm, "dk_pwm"), (Symbol::KMi, "dk_mi")];

#[derive(Debug)]
struct MotorMismatch {
    /// Relative differences, for each of [`SYMBOLS`] one a joint.
    differences: [Vec<f64>; 3],
}

impl Physics for MotorMismatch {
    fn parameter(&self, symbol: Symbol, joint: usize, value: f64) -> f64 {
        let which = SYMBOLS.iter().position(|(mine, _)| *mine == symbol);
        which.map_or(value, |which| value * (1.0 + self.differences[which][joint]))
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let unsuited = |reason| EffectError::Unsuited { effect: EFFECT.id, reason };
    let joints: Vec<usize> = (0..robot.joints.len()).collect();
    if joints.len() < 2 {
        return Err(unsuited("one motor cannot differ from another"));
    }
    if draw::full_torque(robot, 0) == 0.0 {
        return Err(unsuited("no motor is driven by a voltage"));
    }
    let differences = SYMBOLS.map(|_| balanced(joints.len(), size.draw(LARGEST, rng), rng));
    let values = SYMBOLS.iter().zip(&differences);
    let values = values.flat_map(|((_, name), d)| draw::of_joints((EFFECT.id, robot), name, "1", &joints, d));
    let values = values.collect();
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(MotorMismatch { differences }) })
}

/// `count` numbers that add up to nothing, the largest of size `largest`.
fn balanced(count: usize, largest: f64, rng: &mut dyn Rng) -> Vec<f64> {
    loop {
        let mut d: Vec<f64> = (0..count).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mean = d.iter().sum::<f64>() / count as f64;
        d.iter_mut().for_each(|d| *d -= mean);
        let most = d.iter().fold(0.0f64, |most, d| most.max(d.abs()));
        if most > 0.1 {
            return d.into_iter().map(|d| d * largest / most).collect();
        }
    }
}

/// The same differences.
#[derive(Debug)]
struct MismatchLaw {
    parameters: Parameters,
    /// For each of [`SYMBOLS`].
    differences: [Differences; 3],
}

impl Law for MismatchLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::MotorInertia, Hook::MotorTorque]
    }

    fn local(&self, joint: usize) -> Vec<usize> {
        self.differences.iter().flat_map(|differences| differences.local(joint)).collect()
    }

    acts_on_joints!();
}

impl MismatchLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, hook: Hook, at: &At<'_, T>, quantity: T) -> T {
        let mut rest = at.parameters;
        let [db, dk_pwm, dk_mi] = std::array::from_fn(|which| {
            let (mine, others) = rest.split_at(self.differences[which].local(at.joint).count());
            rest = others;
            self.differences[which].value(at.joint, mine)
        });
        match hook {
            Hook::MotorInertia => quantity * (db + T::from(1.0)),
            _ => quantity + dk_pwm * at.driving - dk_mi * at.k_mi * at.thetad,
        }
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints: Vec<usize> = (0..robot.joints.len()).collect();
    let mut parameters = Parameters::on(EFFECT.id, robot);
    let differences =
        SYMBOLS.map(|(symbol, name)| Differences::of(robot, &mut parameters, (symbol, name, "1"), &joints));
    if differences.iter().all(Differences::is_empty) {
        let reason = "every motor has parameters of its own already";
        return Err(EffectError::Unsuited { effect: EFFECT.id, reason });
    }
    only(MismatchLaw { parameters, differences })
}
