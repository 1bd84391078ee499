//! Stiction and Stribeck's bump, by the LuGre model (Canudas de Wit et al., 1995) in place of equation (12).
//!
//! ```text
//! g(v) = μ + Δμ e^−(v/v_s)²                      friction at constant speed; break-away torque μ + Δμ
//! ż = v − σ₀ |v| z / g(v)                        deflection of the bristles
//! τ_f = σ₀ z + σ₁ e^−(v/v_d)² ż
//! ```
//!
//! The bristles bend by μ/σ₀ = 5 µrad at most (0.2 mrad of the motor itself): far below an encoder's count, so that what
//! a recording shows is stiction and the bump, hardly the bending. Their damping σ₁ is 0.7 of critical against the motor's
//! inertia and dies out above v_d, or the model could give energy away; it is passive as long as σ₁ |v| < 4 g(v)
//! everywhere. Above some 0.05 rad/s the bristles settle faster than the plant's step; they are then given 0.1 ms to do so.

use rand::{Rng, RngExt};

use super::surrogate::{Arc, At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Line, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{JointKind, Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "stribeck",
    row: Row::Motor,
    title: "stiction and Stribeck friction",
    equation: "(μ_s − μ) e^−(θ̇/v_s)² sgn θ̇",
    parameters: &[
        EffectParameter::size("dmu[i]", "N m")
            .typically(0.5, 0.5, Scale::Friction)
            .sizes("μ_s − μ of 20, 60, 160 % of μ (10 to 200 met)"),
        EffectParameter::shape("v_s", "rad/s")
            .typically(0.08, 0.45, Scale::Radian)
            .sizes("0.03 to 0.2 (0.02 to 0.3 met)"),
    ],
    nuisances: &[
        EffectParameter::nuisance("bending[i]", "rad").sizes("how far bristles bend at μ: less than an encoder sees")
    ],
    confounded_with: &["mu", "integrator_error", "asymmetric_friction"],
    about: "At rest surfaces stick, and need more torque to come loose than to keep sliding. The friction falls while the \
            motor picks up speed: jerky starts and limit cycles. Too coarse an integration of plain Coulomb friction \
            looks like it, so the step is to be checked first.",
    make,
    laws,
};

/// Δμ, shares of μ.
const SHARE: [f64; 3] = [0.2, 0.6, 1.6];
/// v_s, rad/s; drawn evenly on a logarithmic scale.
const SPEED_RAD_S: std::ops::Range<f64> = 0.03..0.2;
/// μ/σ₀, rad.
const BENDING_RAD: f64 = 5e-6;
/// Of critical.
const DAMPING_RATIO: f64 = 0.7;
/// v_d, rad/s.
const DAMPED_BELOW_RAD_S: f64 = 0.01;
/// The bristles settle no faster than with this rate, 1/s.
const FASTEST_PER_S: f64 = 1e4;

/// One state a joint: the deflection z, rad.
#[derive(Debug)]
struct Stribeck {
    bristles: Vec<Bristle>,
    /// v_s, rad/s.
    speed: f64,
}

/// All zero where nothing rubs.
#[derive(Debug, Clone, Copy, Default)]
struct Bristle {
    dmu: f64,
    sigma_0: f64,
    sigma_1: f64,
}

impl Stribeck {
    /// g(v), N m.
    fn sliding(&self, at: &Moment<'_>) -> f64 {
        at.mu + self.bristles[at.joint].dmu * (-(at.friction_speed / self.speed).powi(2)).exp()
    }

    /// ż, rad/s.
    fn bending_rate(&self, at: &Moment<'_>, z: f64) -> f64 {
        let settling = self.bristles[at.joint].sigma_0 * at.friction_speed.abs() / self.sliding(at);
        (at.friction_speed - settling * z) * (FASTEST_PER_S / settling).min(1.0)
    }
}

impl Physics for Stribeck {
    fn states(&self) -> usize {
        self.bristles.len()
    }

    fn state_rates(&self, own: &[f64], line: &Line<'_>, out: &mut [f64]) {
        for (joint, at) in line.joints.iter().enumerate() {
            out[joint] = if self.bristles[joint].sigma_0 > 0.0 { self.bending_rate(at, own[joint]) } else { 0.0 };
        }
    }

    fn friction_torque(&self, at: &Moment<'_>, torque: f64) -> f64 {
        let (bristle, z) = (self.bristles[at.joint], at.own[at.joint]);
        if bristle.sigma_0 == 0.0 {
            return torque;
        }
        let damping = bristle.sigma_1 * (-(at.friction_speed / DAMPED_BELOW_RAD_S).powi(2)).exp();
        torque - at.coulomb() + bristle.sigma_0 * z + damping * self.bending_rate(at, z)
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    let mu = |joint| draw::nominal(robot, Symbol::Mu, joint);
    let dmu = draw::per_joint(robot, &joints, size, SHARE, mu, rng);
    let speed = rng.random_range(SPEED_RAD_S.start.ln()..SPEED_RAD_S.end.ln()).exp();
    let mut bristles = vec![Bristle::default(); robot.joints.len()];
    for &joint in &joints {
        let sigma_0 = mu(joint) / BENDING_RAD;
        let sigma_1 = 2.0 * DAMPING_RATIO * (sigma_0 * draw::nominal(robot, Symbol::B, joint)).sqrt();
        bristles[joint] = Bristle { dmu: dmu[joint], sigma_0, sigma_1 };
    }
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "dmu", "N m", &joints, &dmu).collect();
    values.push(draw::single(EFFECT.id, "v_s", "rad/s", speed));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(Stribeck { bristles, speed }) })
}

/// Where the law looks for v_s, rad/s. It is chosen, not fitted: friction that falls steeply leads a search by linearisation astray. A third from
/// one to the next: a worse one leaves enough of the curve for another cause.
const SPEEDS_RAD_S: [f64; 9] = [0.08, 0.06, 0.045, 0.034, 0.025, 0.107, 0.143, 0.19, 0.25];

/// How far the law's bristles bend, rad (a carriage's: a tenth of it in m): some counts of an encoder would hide it. Stiffer ones make a search by
/// linearisation take small steps.
const LAW_BENDING_RAD: f64 = 2e-4;
/// They settle no faster, shares of a sampling period, nor 1/s: an explicit step of a period carries them.
const LAW_FASTEST_STEPS: f64 = 1.0;
const LAW_FASTEST_PER_S: f64 = 1e3;
/// What divides by μ takes it for this at least, N m.
const LEAST_MU: f64 = 1e-3;
/// A step of their share may be wrong by this.
const SIGMA: f64 = 1e-3;

/// Stribeck's exponential carried by bristles: equation (12) creeps where a robot sticks, and over seconds at rest an encoder sees how far.
///
/// ```text
/// e = e^−(v/v_s)²        τ_f = μ sgn v + Δμ s        ṡ = (v e − |v| s) / z₀e, no faster than c:  c (v e − |v| s) / (c z₀e + |v|)
/// ```
/// At constant speed s is e sgn v. Friction that rises with the speed (Δμ < 0, grease does that) takes e sgn v itself: bristles would push. Linear in
/// Δμ on either side.
#[derive(Debug)]
struct StribeckLaw {
    parameters: Parameters,
    joints: Vec<usize>,
    /// v_s, rad/s.
    speed: f64,
    /// z₀, rad.
    bending: f64,
    /// c, 1/s.
    fastest: f64,
    /// Of every joint.
    rubs: Vec<Rub>,
}

/// A joint's own.
#[derive(Debug, Clone, Copy)]
struct Rub {
    /// μ as the description has it, N m.
    mu: f64,
    /// Motor inertia, kg m².
    b: f64,
}

impl Law for StribeckLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction, Hook::StateRate]
    }

    fn has_state(&self, joint: usize) -> bool {
        self.joints.contains(&joint)
    }

    fn state_sigma(&self, _joint: usize) -> f64 {
        SIGMA
    }

    fn other_shape(&self) -> Option<Arc<dyn Law>> {
        Some(Arc::new(StickingLaw::of(self)))
    }

    acts_on_joints!();
}

impl StribeckLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, hook: Hook, at: &At<'_, T>, quantity: T) -> T {
        let [dmu] = *at.parameters else { return quantity };
        let v = at.friction_speed;
        let share = v * self.speed.recip();
        let falling = (-(share * share)).exp();
        if hook == Hook::Friction {
            let carried = (-dmu).where_positive(falling * at.friction_sign, at.own);
            return quantity + dmu * carried;
        }
        let settling = (falling * (self.fastest * self.bending) + v.abs()).recip() * self.fastest;
        (v * falling - v.abs() * at.own) * settling
    }
}

fn laws(robot: &Robot) -> Laws {
    let joints = draw::some(EFFECT.id, draw::rubbing(robot), draw::NO_FRICTION)?;
    // A carriage of a tenth of a metre's reach.
    let slides = joints.iter().all(|joint| robot.joints[*joint].kind == JointKind::Prismatic);
    let (scale, unit) = if slides { (0.1, "m/s") } else { (1.0, "rad/s") };
    let fastest = LAW_FASTEST_PER_S.min(LAW_FASTEST_STEPS / robot.sample_period_s);
    let of_joint = |symbol, joint| draw::nominal(robot, symbol, joint);
    let rub = |joint| Rub { mu: of_joint(Symbol::Mu, joint).max(LEAST_MU), b: of_joint(Symbol::B, joint) };
    let rubs: Vec<Rub> = (0..robot.joints.len()).map(rub).collect();
    each(SPEEDS_RAD_S.map(|speed| {
        let speed = scale * speed;
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for &joint in &joints {
            parameters.plain("dmu", "N m", Of::Joint(joint), 0.0);
        }
        parameters.chosen("v_s", unit, speed);
        let rubs = rubs.clone();
        StribeckLaw { parameters, joints: joints.clone(), speed, bending: scale * LAW_BENDING_RAD, fastest, rubs }
    }))
}

/// The range of v_s where it is fitted, shares of where it starts.
const SPEED_RANGE: [f64; 2] = [0.2, 5.0];
/// How far the bristles of the law that sticks bend at μ, where the search starts and at least and most, shares of [`LAW_BENDING_RAD`].
const STICKING_BENDING: f64 = 0.1;
const BENDING_RANGE: [f64; 2] = [1e-3, 10.0];
/// They settle no faster, shares of a sampling period: a Runge-Kutta step carries them up to 2.8.
const STICKING_FASTEST_STEPS: f64 = 2.0;
/// g(v) divides: it comes down to about this share of μ softly,
const LEAST_SLIDING: f64 = 0.02;
/// and where a search has it far below zero it is this share at least.
const ABOVE_ZERO: f64 = 1e-12;

/// All of the friction carried by bristles, as in the plant: the robot sticks up to μ + Δμ and does not creep at all. Next to nothing of it is linear, so a
/// search starts where the law above has ended.
///
/// ```text
/// g = μ + Δμ e^−(v/v_s)²        k = σ₀ |v| / g, no faster than c:  κ = c / (c + k)        σ₀ = μ₀ / z₀, μ₀ as described
/// ẇ = κ (σ₀ v − k w)            τ_f = w + (σ₁/σ₀) e^−(v/v_d)² ẇ                           σ₁ = 2 ζ √(σ₀ b)
/// ```
/// The state is w, N m. Fitted are Δμ and z₀ of every joint, and v_s.
#[derive(Debug)]
struct StickingLaw {
    parameters: Parameters,
    joints: Vec<usize>,
    rubs: Vec<Rub>,
    /// v_d, rad/s.
    damped_below: f64,
    /// c, 1/s.
    fastest: f64,
}

impl StickingLaw {
    /// Started where that one starts.
    fn of(law: &StribeckLaw) -> Self {
        let speed = &law.parameters.results[law.parameters.results.len() - 1];
        let scale = law.bending / LAW_BENDING_RAD;
        let length = if speed.unit == "m/s" { "m" } else { "rad" };
        let mut parameters = law.parameters.cleared();
        for &joint in &law.joints {
            parameters.plain("dmu", "N m", Of::Joint(joint), 0.0);
        }
        for &joint in &law.joints {
            parameters.positive("bending", length, Of::Joint(joint), STICKING_BENDING * law.bending);
        }
        parameters.positive("v_s", speed.unit, Of::All, law.speed);
        parameters.within("bending", BENDING_RANGE.map(|share| share * law.bending));
        parameters.within("v_s", SPEED_RANGE.map(|share| share * law.speed));
        StickingLaw {
            parameters,
            joints: law.joints.clone(),
            rubs: law.rubs.clone(),
            damped_below: scale * DAMPED_BELOW_RAD_S,
            fastest: STICKING_FASTEST_STEPS * law.fastest / LAW_FASTEST_STEPS,
        }
    }
}

impl Law for StickingLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::Friction, Hook::StateRate]
    }

    fn has_state(&self, joint: usize) -> bool {
        self.joints.contains(&joint)
    }

    fn state_sigma(&self, joint: usize) -> f64 {
        SIGMA * self.rubs[joint].mu
    }

    acts_on_joints!();
}

impl StickingLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, hook: Hook, at: &At<'_, T>, quantity: T) -> T {
        let [dmu, ln_bending, ln_speed] = *at.parameters else { return quantity };
        let (v, rub) = (at.friction_speed, self.rubs[at.joint]);
        let stiffness = (-ln_bending).exp() * rub.mu;
        let share = v * (-ln_speed).exp();
        let falling = (-(share * share)).exp();
        let sliding = (at.mu + dmu * falling).ramp(LEAST_SLIDING * rub.mu) + T::from(ABOVE_ZERO * rub.mu);
        let settling = v.abs() * sliding.recip() * stiffness;
        let capped = (settling + T::from(self.fastest)).recip() * self.fastest;
        let rate = capped * (v * stiffness - settling * at.own);
        if hook == Hook::StateRate {
            return rate;
        }
        let slowly = v * self.damped_below.recip();
        // σ₁/σ₀ = 2 ζ √(b z₀ / μ₀)
        let damping_s = (ln_bending * 0.5).exp() * (2.0 * DAMPING_RATIO * (rub.b / rub.mu).sqrt());
        quantity - at.coulomb() + at.own + damping_s * (-(slowly * slowly)).exp() * rate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Doggy's pitch at this speed of the motor: μ = 2.5 N m.
    fn asked(law: &dyn Law, hook: Hook, (own, speed): (f64, f64), parameters: &[f64]) -> f64 {
        let friction_sign = (200.0 * speed).tanh();
        let at = At {
            joint: 1,
            time_s: 0.0,
            q: 0.0,
            qd: 0.0,
            theta: 0.0,
            thetad: speed,
            driving: 0.0,
            k_mi: 30.0,
            mu: 2.5,
            k_s: 400.0,
            d_s: 1.5,
            friction_speed: speed,
            friction_sign,
            transmitted: 0.0,
            parameters,
            own,
        };
        law.plain(hook, &at, if hook == Hook::Friction { at.coulomb() } else { 0.0 })
    }

    /// The bristles at rest in their own motion, and the friction then.
    #[test]
    fn the_law_that_sticks_slides_as_the_effect_does_and_holds_what_its_bristles_hold() {
        let robot = Robot::builtin("doggy").unwrap();
        let law = laws(&robot).unwrap().swap_remove(0).other_shape().unwrap();
        let (dmu, v_s) = (1.5, 0.08);
        let parameters = [dmu, 1e-5f64.ln(), f64::ln(v_s)];
        for speed in [0.01_f64, -0.04, 0.08, -0.2, 4.0] {
            let sliding = speed.signum() * (2.5 + dmu * (-(speed / v_s).powi(2)).exp());
            // rtol 1e-9: both terms of the rate are much larger.
            let rate = asked(&*law, Hook::StateRate, (sliding, speed), &parameters);
            assert!(rate.abs() < 1e-9 * 2.5 / 1e-5 * speed.abs(), "{speed}: {rate}");
            let friction = asked(&*law, Hook::Friction, (sliding, speed), &parameters);
            assert!((friction - sliding).abs() < 1e-6, "{speed}: {friction} for {sliding}");
        }
        // Pushed by less than μ + Δμ it stands, to either side.
        for held in [-3.9, -1.0, 0.0, 2.6, 3.9] {
            assert_eq!(asked(&*law, Hook::StateRate, (held, 0.0), &parameters), 0.0);
            assert_eq!(asked(&*law, Hook::Friction, (held, 0.0), &parameters), held);
        }
        // Where a search leaves no friction to slide with, it still gets numbers.
        for speed in [0.0, 1e-9, -0.01] {
            let rate = asked(&*law, Hook::StateRate, (1.0, speed), &[-7.0, parameters[1], parameters[2]]);
            assert!(rate.is_finite(), "{speed}: {rate}");
        }
        // And they load as a spring of μ₀/z₀ does.
        let stiffness = draw::nominal(&robot, Symbol::Mu, 1) / 1e-5;
        let rate = asked(&*law, Hook::StateRate, (0.0, 1e-6), &parameters);
        assert!((rate / (stiffness * 1e-6) - 1.0).abs() < 1e-3, "{rate}");
    }
}
