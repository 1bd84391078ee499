//! What the estimator's side of effects has in common: an effect file's law is written with these.

use std::f64::consts::TAU;
pub(super) use std::sync::Arc;

pub(super) use crate::model::Quantity;
use crate::model::law::PassiveJoint;
pub(super) use crate::model::law::{At, Clues, Hook, JointClues, Law, LowPass, Of, Parameters, Readings};
use crate::robot::{Robot, Symbol, Vector3};
pub(super) use crate::{acts_on_joints, reads_gyros, reads_positions};

use super::EffectError;

/// The least time constant of a law's own state that an explicit Runge–Kutta step carries, in sample periods: it is stable down to 1/2.78.
pub(super) const FASTEST_STEPS: f64 = 0.37;

/// A joint at rest at zero that nothing acts on, for tests of laws.
#[cfg(test)]
pub(super) fn still(parameters: &[f64]) -> At<'_, f64> {
    At {
        joint: 0,
        time_s: 0.0,
        q: 0.0,
        qd: 0.0,
        theta: 0.0,
        thetad: 0.0,
        driving: 0.0,
        k_mi: 0.0,
        mu: 0.0,
        k_s: 0.0,
        d_s: 0.0,
        friction_speed: 0.0,
        friction_sign: 0.0,
        transmitted: 0.0,
        parameters,
        own: 0.0,
    }
}

/// One law an alternative: the same law at other start values, or in another shape. The first is the usual one.
pub(super) type Laws = Result<Vec<Arc<dyn Law>>, EffectError>;

/// The only alternative.
pub(super) fn only(law: impl Law + 'static) -> Laws {
    Ok(vec![Arc::new(law)])
}

/// Several.
pub(super) fn each<L: Law + 'static>(laws: impl IntoIterator<Item = L>) -> Laws {
    Ok(laws.into_iter().map(|law| Arc::new(law) as Arc<dyn Law>).collect())
}

/// Adds to `parameters` the stiffness and damping, by their logarithms, of two passive joints about `axes`: of bodies of these moments of
/// inertia (kg m²) that swing at `hz`, with this share of critical damping.
pub(super) fn swinging(
    parameters: &mut Parameters,
    axes: [Vector3; 2],
    inertia: [f64; 2],
    (hz, ratio): (f64, f64),
) -> [PassiveJoint; 2] {
    let k = |axis: usize| (TAU * hz).powi(2) * inertia[axis];
    let d = |axis: usize| 2.0 * ratio * TAU * hz * inertia[axis];
    let stiffness = [0, 1].map(|axis| parameters.positive("k", "N m/rad", Of::Axis(axis), k(axis)));
    let damping = [0, 1].map(|axis| parameters.positive("d", "N m s/rad", Of::Axis(axis), d(axis)));
    [0, 1].map(|axis| PassiveJoint { axis: axes[axis], stiffness: stiffness[axis], damping: damping[axis] })
}

/// Differences from a parameter that joints share: what is common to all belongs to that parameter, so they add up to nothing. A joint whose
/// parameter is known has a difference of its own; one that alone has a free parameter has none.
#[derive(Debug, Clone, Default)]
pub(super) struct Differences {
    /// For each joint, the coordinates whose sum with these signs is its difference.
    terms: Vec<Vec<(usize, f64)>>,
}

impl Differences {
    /// Adds those of `symbol` on `joints` to `parameters`, told as `name`.
    pub(super) fn of(
        robot: &Robot,
        parameters: &mut Parameters,
        (symbol, name, unit): (Symbol, &str, &'static str),
        joints: &[usize],
    ) -> Self {
        let mut terms = vec![Vec::new(); robot.joints.len()];
        let mut done = vec![false; robot.joints.len()];
        for &joint in joints {
            let Some(spec) = robot.joint_parameter(symbol, joint).filter(|_| !done[joint]) else { continue };
            if !spec.value.free {
                terms[joint] = vec![(parameters.plain(name, unit, Of::Joint(joint), 0.0), 1.0)];
                continue;
            }
            let group: Vec<usize> = joints.iter().copied().filter(|other| spec.joints.contains(other)).collect();
            group.iter().for_each(|&member| done[member] = true);
            if group.len() < 2 {
                continue;
            }
            let first = parameters.coordinates.len();
            parameters.balanced(name, unit, &group);
            let others = group.len() - 1;
            for (place, &member) in group[..others].iter().enumerate() {
                terms[member] = vec![(first + place, 1.0)];
            }
            terms[group[others]] = (0..others).map(|place| (first + place, -1.0)).collect();
        }
        Differences { terms }
    }

    /// A value of its own for every joint, where the description has nothing to differ from.
    pub(super) fn own(robot: &Robot, parameters: &mut Parameters, (name, unit): (&str, &'static str)) -> Self {
        let one = |joint| vec![(parameters.plain(name, unit, Of::Joint(joint), 0.0), 1.0)];
        Differences { terms: (0..robot.joints.len()).map(one).collect() }
    }

    /// Whether no joint has a difference that can be told.
    pub(super) fn is_empty(&self) -> bool {
        self.terms.iter().all(Vec::is_empty)
    }

    /// The coordinates that the difference at `joint` reads.
    pub(super) fn local(&self, joint: usize) -> impl Iterator<Item = usize> + '_ {
        self.terms[joint].iter().map(|(coordinate, _)| *coordinate)
    }

    /// The difference at `joint` from the values of [`local`](Self::local).
    pub(super) fn value<T: Quantity>(&self, joint: usize, local: &[T]) -> T {
        self.terms[joint].iter().zip(local).fold(T::from(0.0), |sum, ((_, sign), value)| sum + *value * *sign)
    }
}
