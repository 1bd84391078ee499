//! End stop: the link meets its stop inside the range it is moved through.
//!
//! ```text
//! depth δ = q − q_max beyond q_max, δ = q_min − q below q_min:   k δ max(1 + λ δ̇, 0),   λ = 0.3 s/rad
//! ```
//!
//! The contact of Hunt and Crossley (1975): damping grows with the depth, so that an impact makes no jump of torque; a stop
//! pushes and never holds the link back.

use rand::{Rng, RngExt};

use super::surrogate::{Arc, At, Clues, Hook, JointClues, Law, Laws, Of, Parameters, Quantity, acts_on_joints, each};
use super::{Effect, EffectError, EffectParameter, Hidden, Moment, Physics, Row, Scale, Size, draw};
use crate::robot::{Robot, Symbol};

pub(super) const EFFECT: Effect = Effect {
    id: "end_stop",
    row: Row::Link,
    title: "contact at a joint's stop",
    equation: "k δ max(1 + λ δ̇, 0) at a depth of δ beyond q_max or q_min",
    parameters: &[
        EffectParameter::inverse_size("q_max[i]", "rad").sizes("68, 58, 47 % of the described limit"),
        EffectParameter::inverse_size("q_min[i]", "rad").sizes("as q_max, drawn for itself"),
        EffectParameter::size("k", "N m/rad")
            .typically(5.5, 0.6, Scale::Stiffness)
            .sizes("3 to 10 times the stiffest k_s"),
    ],
    nuisances: &[EffectParameter::nuisance("corner", "rad").sizes("over what the law rounds its corner")],
    confounded_with: &["belt_hardening"],
    about: "A stop of rubber or steel stands nearer than the description says, or something stands in the way. Nothing \
            shows until the link gets there; then it is thrown back.",
    make,
    laws,
};

/// Shares of the described limits. The stronger the effect, the nearer the stop.
const SHARE: [f64; 3] = [0.68, 0.58, 0.47];
/// k, shares of the stiffest k_s.
const STIFFNESS: std::ops::Range<f64> = 3.0..10.0;
/// λ, s/rad.
const DAMPING_S_RAD: f64 = 0.3;

#[derive(Debug)]
struct EndStop {
    /// q_min and q_max, rad; infinite where there is no stop.
    q_min: Vec<f64>,
    q_max: Vec<f64>,
    /// N m/rad.
    k: f64,
}

impl Physics for EndStop {
    fn link_load(&self, at: &Moment<'_>, load: f64) -> f64 {
        let push = |depth: f64, rate: f64| self.k * depth * (1.0 + DAMPING_S_RAD * rate).max(0.0);
        let (above, below) = (at.q - self.q_max[at.joint], self.q_min[at.joint] - at.q);
        if above > 0.0 {
            load + push(above, at.qd)
        } else if below > 0.0 {
            load - push(below, -at.qd)
        } else {
            load
        }
    }
}

fn make(robot: &Robot, size: Size, rng: &mut dyn Rng) -> Result<Hidden, EffectError> {
    let mut joints = draw::elastic(robot);
    joints.retain(|j| robot.joints[*j].limits[0] < 0.0 && robot.joints[*j].limits[1] > 0.0);
    let joints = draw::some(EFFECT.id, joints, "no joint turns to both sides through an elastic transmission")?;
    let mut stops = [vec![f64::NEG_INFINITY; robot.joints.len()], vec![f64::INFINITY; robot.joints.len()]];
    for (side, stops) in stops.iter_mut().enumerate() {
        for &joint in &joints {
            let limit = robot.joints[joint].limits[side];
            stops[joint] = limit.signum() * size.draw(SHARE.map(|share| share * limit.abs()), rng);
        }
    }
    let stiffest = joints.iter().map(|joint| draw::nominal(robot, Symbol::KS, *joint)).fold(0.0, f64::max);
    let k = stiffest * rng.random_range(STIFFNESS);
    let [q_min, q_max] = stops;
    let mut values: Vec<_> = draw::of_joints((EFFECT.id, robot), "q_max", "rad", &joints, &q_max).collect();
    values.extend(draw::of_joints((EFFECT.id, robot), "q_min", "rad", &joints, &q_min));
    values.push(draw::single(EFFECT.id, "k", "N m/rad", k));
    Ok(Hidden { id: EFFECT.id, values, physics: Box::new(EndStop { q_min, q_max, k }) })
}

/// Over what the law's corners are rounded: rad, from afar and where it is known already, and of the contact's damping.
const CORNER_RAD: f64 = 1e-3;
const SHARP_RAD: f64 = 1e-4;
const CORNER_RATE: f64 = 0.02;

/// A stop that is met at least so stiff, N m/rad of k_s, and explains this share of the missing torque's squares.
const STIFF: f64 = 0.5;
const LEAST_SHARE: f64 = 0.05;
/// How far beyond the motion a stop starts that was never met, rad: so many corners that it is nothing at all.
const BEYOND_RAD: f64 = 0.1;

/// The same contact with a rounded corner.
#[derive(Debug)]
struct StopLaw {
    parameters: Parameters,
    /// With the described limits.
    joints: Vec<(usize, [f64; 2])>,
    /// Rounding of the corner at contact, rad.
    corner_rad: f64,
}

impl Law for StopLaw {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn is_event(&self) -> bool {
        true
    }

    /// Stops where the missing torque pushes back; beyond the motion where it does not.
    fn starts(&self, clues: &Clues) -> Vec<Arc<dyn Law>> {
        let (mut stops, mut push, mut squares) = ([Vec::new(), Vec::new()], 0.0, 0.0);
        for &(joint, limits) in &self.joints {
            let Some(of) = clues.joints.get(joint) else { return Vec::new() };
            for (side, stops) in stops.iter_mut().enumerate() {
                let sign = [-1.0, 1.0][side];
                let met =
                    contact(of, sign).filter(|met| met.share > LEAST_SHARE && met.k() > STIFF * of.k_s.unwrap_or(0.0));
                tracing::debug!(joint = joint + 1, side, ?met, "stop?");
                push += met.map_or(0.0, |met| met.push);
                squares += met.map_or(0.0, |met| met.squares);
                let farthest = of.q.iter().map(|q| sign * q).fold(0.0, f64::max) + BEYOND_RAD;
                stops.push(met.map_or(sign * farthest.max(sign * limits[side]), |met| met.at));
            }
        }
        if squares == 0.0 {
            return Vec::new();
        }
        let joints = self.joints.clone();
        let parameters = parameters(self.parameters.cleared(), &joints, &stops, [push / squares, SHARP_RAD]);
        vec![Arc::new(StopLaw { parameters, joints, corner_rad: SHARP_RAD })]
    }

    fn other_shape(&self) -> Option<Arc<dyn Law>> {
        let law = || -> Arc<dyn Law> {
            let joints = self.joints.clone();
            let stops = [0, 1].map(|side| joints.iter().map(|(_, limits)| limits[side]).collect());
            let parameters = parameters(self.parameters.cleared(), &joints, &stops, [1.0, SHARP_RAD]);
            Arc::new(StopLaw { parameters, joints, corner_rad: SHARP_RAD })
        };
        (self.corner_rad > SHARP_RAD).then(law)
    }

    fn hooks(&self) -> &'static [Hook] {
        &[Hook::LinkLoad]
    }

    acts_on_joints!();
}

impl StopLaw {
    #[inline(always)]
    fn act<T: Quantity>(&self, _hook: Hook, at: &At<'_, T>, load: T) -> T {
        let [q_max, q_min, k] = *at.parameters else { return load };
        let k = k.exp();
        let push = |depth: T, rate: T| {
            k * depth.ramp(self.corner_rad) * (rate * DAMPING_S_RAD + T::from(1.0)).ramp(CORNER_RATE)
        };
        load + push(at.q - q_max, at.qd) - push(q_min - at.q, -at.qd)
    }
}

fn laws(robot: &Robot) -> Laws {
    let mut joints = draw::elastic(robot);
    joints.retain(|j| robot.joints[*j].limits[0] < 0.0 && robot.joints[*j].limits[1] > 0.0);
    let joints = draw::some(EFFECT.id, joints, "no joint turns to both sides through an elastic transmission")?;
    let stiffest = joints.iter().map(|joint| draw::nominal(robot, Symbol::KS, *joint)).fold(0.0, f64::max);
    let joints: Vec<_> = joints.into_iter().map(|joint| (joint, robot.joints[joint].limits)).collect();
    let with = |share: f64| {
        let stops = [0, 1].map(|side| joints.iter().map(|(_, limits)| share * limits[side]).collect());
        let parameters = parameters(Parameters::on(EFFECT.id, robot), &joints, &stops, [5.0 * stiffest, CORNER_RAD]);
        StopLaw { parameters, joints: joints.clone(), corner_rad: CORNER_RAD }
    };
    each([0.58, 0.68, 0.47].map(with))
}

/// Stops at these q_min and q_max of the joints, with k and the rounding of the corner.
fn parameters(
    mut parameters: Parameters,
    joints: &[(usize, [f64; 2])],
    stops: &[Vec<f64>; 2],
    [k, corner_rad]: [f64; 2],
) -> Parameters {
    for (side, name) in ["q_min", "q_max"].into_iter().enumerate().rev() {
        for ((joint, _), stop) in joints.iter().zip(&stops[side]) {
            parameters.plain(name, "rad", Of::Joint(*joint), *stop);
        }
    }
    parameters.positive("k", "N m/rad", Of::All, k);
    parameters.chosen("corner", "rad", corner_rad);
    parameters
}

/// A stop as the missing torque shows it.
#[derive(Debug, Clone, Copy)]
struct Contact {
    /// q_max or q_min, rad.
    at: f64,
    /// Σ x τ and Σ x² of the law's x = δ (1 + λ δ̇).
    push: f64,
    squares: f64,
    /// Share of the squares of the missing torque that it explains.
    share: f64,
}

impl Contact {
    fn k(&self) -> f64 {
        self.push / self.squares
    }
}

/// The stop on the side of `sign` that explains most, over all positions by cumulative sums from the outermost inwards: with f = 1 + λ δ̇ and
/// δ = s − c the sums Σ f δ τ and Σ f² δ² are polynomials of c.
fn contact(joint: &JointClues, sign: f64) -> Option<Contact> {
    let mut samples: Vec<[f64; 3]> = (joint.q.iter().zip(&joint.qd).zip(&joint.missing))
        .map(|((q, qd), missing)| [sign * q, (1.0 + DAMPING_S_RAD * sign * qd).max(0.0), -sign * missing])
        .collect();
    samples.sort_by(|a, b| b[0].total_cmp(&a[0]));
    let all: f64 = samples.iter().map(|[.., torque]| torque * torque).sum();
    let [mut t0, mut t1, mut s0, mut s1, mut s2] = [0.0; 5];
    let contacts = samples.iter().map(|[c, f, torque]| {
        let (push, squares) = (t1 - c * t0, s2 - 2.0 * c * s1 + c * c * s0);
        t0 += f * torque;
        t1 += f * torque * c;
        s0 += f * f;
        s1 += f * f * c;
        s2 += f * f * c * c;
        Contact { at: sign * c, push, squares, share: if push > 0.0 { push * push / (squares * all) } else { 0.0 } }
    });
    contacts.filter(|contact| contact.share.is_finite()).max_by(|a, b| a.share.total_cmp(&b.share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_starts_where_the_missing_torque_pushes_back() {
        let robot = Robot::builtin("doggy").unwrap();
        let k = 3000.0;
        let motion = |k: usize| (0.4 * (2e-3 * k as f64).sin(), 2.0 * 0.4 * (2e-3 * k as f64).cos());
        let push = |(q, qd): (f64, f64), stop: f64| {
            if q > stop { -k * (q - stop) * (1.0 + DAMPING_S_RAD * qd).max(0.0) } else { 0.0 }
        };
        let joint = |stop: f64| JointClues {
            q: (0..9000).map(|k| motion(k).0).collect(),
            qd: (0..9000).map(|k| motion(k).1).collect(),
            missing: (0..9000).map(|k| push(motion(k), stop) + 0.1 * (k as f64 * 1.3).sin()).collect(),
            k_s: Some(400.0),
        };
        let clues = Clues { time_s: vec![0.0; 9000], joints: vec![joint(0.35), joint(1.0), joint(0.38)] };
        let starts = laws(&robot).unwrap()[0].starts(&clues);
        assert_eq!(starts.len(), 1);
        let parameters = starts[0].parameters();
        let value = |name: &str| {
            let place = parameters.results.iter().position(|result| result.name == format!("end_stop.{name}")).unwrap();
            parameters.coordinates[place].start
        };
        // Samples lie up to 0.8 mrad from each other, and the ripple is 1 % of the push.
        assert!((value("q_max[1]") - 0.35).abs() < 2e-3 && (value("q_max[3]") - 0.38).abs() < 2e-3, "{parameters:?}");
        assert!((value("k").exp() / k - 1.0).abs() < 0.1, "{parameters:?}");
        // Never met: not inside of the motion.
        assert!(value("q_max[2]") > 0.45 && value("q_min[1]") < -0.45 && value("q_min[3]") < -0.45, "{parameters:?}");
    }
}
