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

use super::surrogate::{At, Hook, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Line, Moment, Physics, Row, Size, draw};
use crate::robot::{JointKind, Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "stribeck",
    row: Row::Motor,
    title: "stiction and Stribeck friction",
    equation: "(μ_s − μ) e^−(θ̇/v_s)² sgn θ̇",
    parameters: &[
        EffectParameter { name: "dmu[i]", unit: "N m", sizes: "μ_s − μ of 20, 60, 160 % of μ (10 to 200 met)" },
        EffectParameter { name: "v_s", unit: "rad/s", sizes: "0.03 to 0.2 (0.02 to 0.3 met)" },
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
            let carried = if dmu.re() < 0.0 { falling * at.friction_sign } else { at.own };
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
    each(SPEEDS_RAD_S.map(|speed| {
        let speed = scale * speed;
        let mut parameters = Parameters::on(EFFECT.id, robot);
        for &joint in &joints {
            parameters.plain("dmu", "N m", Of::Joint(joint), 0.0);
        }
        parameters.chosen("v_s", unit, speed);
        StribeckLaw { parameters, joints: joints.clone(), speed, bending: scale * LAW_BENDING_RAD, fastest }
    }))
}
