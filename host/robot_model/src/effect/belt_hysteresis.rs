//! Viscoelastic or hysteretic belt: a branch beside the spring and damper that lets go with time, or where it is wound too far.
//!
//! ```text
//!          ┌── k_s ──────────────┐
//! motor ───┼── d_s ──────────────┼─── link
//!          └── k₁ ── damper k₁τ ─┘                τ_c + f,     ḟ = k₁ (q̇ − θ̇) − f/τ                          Maxwell branch
//!          └── k₁ ── slip z₁ ────┘                τ_c + k₁ z₁ s,  z₁ ṡ = ẇ − ½ (|ẇ| s |s| + ẇ s²),  w = q − θ    slip element
//! ```
//! The slip element is that of Bouc and Wen (Wen 1976, n = 2, β = γ): it winds back as stiff as it started, and carries k₁ z₁ at most, at any speed.

use std::sync::Arc;

use rand::{Rng, RngExt};

use super::surrogate::{At, FASTEST_STEPS, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Line, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "belt_hysteresis",
    row: Row::Link,
    title: "viscoelastic belt",
    equation: "τ_c + f, ḟ = k₁ (q̇ − θ̇) − f/τ, or f = k₁ z, |z| ≤ z₁",
    parameters: &[
        EffectParameter::size("k1[i]", "N m/rad")
            .typically(0.24, 0.35, Scale::Stiffness)
            .sizes("12, 24, 43 % of k_s (10 to 50 met)"),
        EffectParameter::shape("tau[i]", "s").typically(0.022, 0.45, Scale::Si).sizes("6 to 80 ms (5 to 100 met)"),
    ],
    nuisances: &[
        EffectParameter::nuisance("slip[i]", "rad").sizes("0.2 to 100 mrad: the wind at which the slip element slips")
    ],
    confounded_with: &["d_s", "k_s", "electrical_lag"],
    about: "Polymers relax: wound up quickly a belt is stiffer than wound up slowly, and it gives back less than it took. \
            Slower than τ the branch is soft, faster it is one more spring, between the two it damps. Where fibres rub, the branch slips \
            from a wind-up on, whatever the speed.",
    make,
    laws,
};

/// Shares of k_s.
const SHARE: [f64; 3] = [0.12, 0.24, 0.43];
/// Relaxation time, s; drawn evenly on a logarithmic scale.
const RELAXATION_S: std::ops::Range<f64> = 6e-3..80e-3;

/// One state a joint: the branch's torque.
#[derive(Debug)]
struct BeltHysteresis {
    /// k₁, N m/rad; zero where there is no belt.
    k1: Vec<f64>,
    /// τ, s.
    relaxation_s: Vec<f64>,
}

impl Physics for BeltHysteresis {
    fn states(&self) -> usize {
        self.k1.len()
    }

    fn state_rates(&self, own: &[f64], line: &Line<'_>, out: &mut [f64]) {
        for (joint, at) in line.joints.iter().enumerate() {
            out[joint] = self.k1[joint] * at.wind_rate() - own[joint] / self.relaxation_s[joint];
        }
    }

    fn transmission_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        torque + at.own[at.joint]
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let k1 = draw::per_joint(robot, &joints, size, SHARE, |j| draw::nominal(robot, Symbol::KS, j), rng);
    let logarithms = RELAXATION_S.start.ln()..RELAXATION_S.end.ln();
    let relaxation_s: Vec<f64> = k1.iter().map(|_| rng.random_range(logarithms.clone()).exp()).collect();
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "k1", "N m/rad", &joints, &k1).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "tau", "s", &joints, &relaxation_s));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(BeltHysteresis { k1, relaxation_s }) })
}

/// A step of the branch's torque may be wrong by k_s times this, rad: as good as nothing. A hundred times more would let the branch wander as no belt
/// does, and take in what is small and something else.
const SIGMA_RAD: f64 = 1e-7;

/// The same branch; τ is fitted by its logarithm.
#[derive(Debug)]
struct HysteresisLaw {
    parameters: Parameters,
    joints: Vec<usize>,
    /// N m.
    sigma: Vec<f64>,
}

impl Law for HysteresisLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Transmission, Hook::StateRate]
    }

    fn has_state(&self, joint: usize) -> bool {
        self.joints.contains(&joint)
    }

    fn state_sigma(&self, joint: usize) -> f64 {
        self.sigma[joint]
    }

    acts_on_joints!();
}

impl HysteresisLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, hook: Hook, at: &At<'_, T>, quantity: T) -> T {
        let [k1, tau] = *at.parameters else { return quantity };
        match hook {
            Hook::Transmission => quantity + at.own,
            _ => k1 * at.wind_rate() - at.own * (-tau).exp(),
        }
    }
}

/// A step of a slip element's state may be wrong by so much, as a share of the wind at which it slips: as good as nothing.
const SIGMA_SHARE: f64 = 1e-3;

/// A slip element: its wind, as a share of that at which it slips, is a state of its own.
#[derive(Debug)]
struct SlipLaw {
    parameters: Parameters,
    joints: Vec<usize>,
}

impl Law for SlipLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Transmission, Hook::StateRate]
    }

    fn has_state(&self, joint: usize) -> bool {
        self.joints.contains(&joint)
    }

    fn state_size(&self, _: usize) -> f64 {
        1.0
    }

    fn state_sigma(&self, _: usize) -> f64 {
        SIGMA_SHARE
    }

    acts_on_joints!();
}

impl SlipLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, hook: Hook, at: &At<'_, T>, quantity: T) -> T {
        let [k1, slip] = *at.parameters else { return quantity };
        match hook {
            Hook::Transmission => quantity + k1 * slip.exp() * at.own,
            _ => {
                let (rate, share) = (at.wind_rate(), at.own);
                (rate - (rate.abs() * share.abs() + rate * share) * share * 0.5) * (-slip).exp()
            }
        }
    }
}

/// Winds at which a slip element may start, rad.
const SLIPS_RAD: [f64; 3] = [2e-3, 8e-3, 30e-3];
/// A belt that slips later than at the end of this range is a stiffer spring, rad.
const SLIPS_MET_RAD: [f64; 2] = [2e-4, 0.1];

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::elastic(robot), draw::NO_BELT)?;
    let slipping = |start_rad: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for &joint in &joints {
            parameters.plain("k1", "N m/rad", Of::Joint(joint), 0.0);
        }
        parameters.within("k1", [0.0, f64::INFINITY]);
        for &joint in &joints {
            parameters.positive("slip", "rad", Of::Joint(joint), start_rad);
        }
        parameters.within("slip", SLIPS_MET_RAD);
        Arc::new(SlipLaw { parameters, joints: joints.clone() }) as Arc<dyn Law>
    };
    let with = |start_s: f64| {
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for &joint in &joints {
            parameters.plain("k1", "N m/rad", Of::Joint(joint), SHARE[0] * draw::nominal(robot, Symbol::KS, joint));
        }
        parameters.within("k1", [0.0, f64::INFINITY]);
        for &joint in &joints {
            parameters.positive("tau", "s", Of::Joint(joint), start_s);
        }
        // An explicit step does not carry what relaxes much faster.
        parameters.within("tau", [(FASTEST_STEPS * robot.sample_period_s).max(1e-3), 0.5]);
        let sigma = |joint| SIGMA_RAD * draw::nominal(robot, Symbol::KS, joint);
        let sigma = (0..robot.joints.len()).map(sigma).collect();
        HysteresisLaw { parameters, joints: joints.clone(), sigma }
    };
    let relaxing = each([25e-3, 8e-3, 70e-3].map(with))?;
    Ok(relaxing.into_iter().chain(SLIPS_RAD.map(slipping)).collect())
}

#[cfg(test)]
mod tests {
    use super::super::surrogate::still;
    use super::*;

    /// The torque of a slip element of 100 N m/rad that slips at 8 mrad, wound from nothing along these winds (rad) at a speed (rad/s) in small steps: at each of them.
    fn along(winds_rad: &[f64], speed_rad_s: f64) -> Vec<f64> {
        let robot = Robot::builtin("one_joint").unwrap();
        let law = laws(&robot).unwrap().into_iter().find(|law| law.parameters().results[1].name.contains("slip"));
        let law = law.unwrap();
        let parameters = [100.0, 8e-3_f64.ln()];
        let at = |own: f64, rate: f64| At { qd: rate, own, ..still(&parameters) };
        let (mut own, mut wind_rad) = (0.0, 0.0);
        let step = |to: &f64| {
            let steps = 20_000;
            let rate = speed_rad_s * (to - wind_rad).signum();
            let dt_s = (to - wind_rad).abs() / speed_rad_s / f64::from(steps);
            for _ in 0..steps {
                own += dt_s * law.plain(Hook::StateRate, &at(own, rate), 0.0);
            }
            wind_rad = *to;
            law.plain(Hook::Transmission, &at(own, 0.0), 0.0)
        };
        winds_rad.iter().map(step).collect()
    }

    #[test]
    fn a_slip_element_is_a_spring_at_first_carries_so_much_at_most_and_winds_back_as_stiff_as_it_began() {
        let torques = along(&[0.4e-3, 60e-3, 59.6e-3, -60e-3], 0.1);
        // rtol 1 %: k₁ times the wind, k₁ z₁ = 0.8 N m.
        assert!((torques[0] / 0.04 - 1.0).abs() < 0.01, "{torques:?}");
        assert!((torques[1] / 0.8 - 1.0).abs() < 0.01, "{torques:?}");
        assert!(((torques[1] - torques[2]) / 0.04 - 1.0).abs() < 0.01, "{torques:?}");
        assert!((torques[3] / -0.8 - 1.0).abs() < 0.01, "{torques:?}");
    }

    #[test]
    fn how_fast_it_is_wound_makes_no_difference() {
        let winds_rad = [5e-3, -3e-3, 12e-3, 11e-3];
        for (slow, fast) in along(&winds_rad, 0.01).into_iter().zip(along(&winds_rad, 10.0)) {
            // atol 1e-9 N m.
            assert!((slow - fast).abs() < 1e-9, "{slow} {fast}");
        }
    }
}
