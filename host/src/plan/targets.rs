//! Effects that a motion is to show, or to tell from one another: their laws, with the typical size of each on this robot.
//!
//! ```text
//!   effect ─▶ its usual law ─▶ coordinates ─▶ a result's typical value / |∂result/∂coordinate| = what an error of 1 is
//! ```
//!
//! The information of a law's size with all else free, the sizes of its rivals as well, is the non-centrality of the test that tells them apart: what is left of the law's
//! signal after the rival has taken what it can. Error and information are one number, λ = 1/error² (A. C. Atkinson, D. R. Cox, *Planning experiments for
//! discriminating between models*, J. R. Stat. Soc. B 36, 1974).

use std::sync::Arc;

use protocol::Motion;

use super::trial::STEP_S;
use super::{Belief, PlanError};
use crate::calibrate::information::{SizedCoordinate, SizedLaw};
use crate::effect::{CATALOGUE, Effect, EffectError, RobotScales};
use crate::model::law::{Form, Law, LawResult};
use crate::robot::{InputUnit, Robot, Symbol};
use crate::simulate::Rehearsal;

/// The laws of `effects`, in the catalogue's order, in which a plant asks them, with their typical sizes on the likeliest robot in `motion`.
///
/// # Errors
/// [`PlanError::Effect`] of one that the robot cannot have, [`PlanError::NotForPlans`] of one whose size is no number that adds up over a motion.
pub fn laws(belief: &Belief, motion: &Motion, effects: &[&'static Effect]) -> Result<Vec<SizedLaw>, PlanError> {
    if effects.is_empty() {
        return Ok(Vec::new());
    }
    let scales = scales(belief, motion)?;
    let wanted = CATALOGUE.into_iter().filter(|effect| effects.iter().any(|wanted| wanted.id == effect.id));
    wanted.map(|effect| law(belief, effect, &scales)).collect()
}

/// Whether a motion can be planned that shows an effect on this robot: the firmware can play one, and the effect's size is a number that adds up over it.
pub fn can_show(robot: &Robot, effect: &'static Effect) -> bool {
    let has_typical_size = effect.parameters.iter().any(|p| p.role.is_size() && p.typical.is_some());
    robot.input.unit == InputUnit::Duty && has_typical_size && usual_law(robot, effect).is_ok()
}

/// The law that is tried first of an effect, where its tangent tells of it.
fn usual_law(robot: &Robot, effect: &'static Effect) -> Result<Arc<dyn Law>, PlanError> {
    let unsuited = EffectError::Unsuited { effect: effect.id, reason: "no law suits it" };
    let law = effect.laws(robot)?.into_iter().next().ok_or(unsuited)?;
    if law.is_event() {
        let reason = "whether it is met at all decides, which no derivative tells";
        return Err(PlanError::NotForPlans { effect: effect.id, reason });
    }
    Ok(law)
}

/// The scales of the likeliest robot in a motion.
fn scales(belief: &Belief, motion: &Motion) -> Result<RobotScales, PlanError> {
    let (robot, truth) = (&belief.robot, belief.likely());
    let played = Rehearsal::play(robot, &truth, motion, 0, STEP_S).map_err(PlanError::Simulate)?;
    let rms = |squared_s: f64| (squared_s / played.duration_s()).sqrt();
    let value = |symbol, joint| truth.get(robot, symbol, joint);
    let torque: Vec<f64> = (played.joints.iter().enumerate())
        .map(|(j, did)| value(Symbol::KPwm, j).unwrap_or(0.0) * robot.input.scale * rms(did.duty_squared_s))
        .collect();
    let speed: Vec<f64> = played.joints.iter().map(|did| rms(did.speed_squared_s)).collect();
    let mut scales = RobotScales::of(robot, &torque, &speed);
    for (joint, scales) in scales.joints.iter_mut().enumerate() {
        scales.friction = value(Symbol::Mu, joint).unwrap_or(scales.friction);
        scales.stiffness = value(Symbol::KS, joint).unwrap_or(scales.stiffness);
    }
    Ok(scales)
}

/// The usual law of an effect, with the size of each coordinate.
fn law(belief: &Belief, effect: &'static Effect, scales: &RobotScales) -> Result<SizedLaw, PlanError> {
    let law = usual_law(&belief.robot, effect)?;
    let parameters = law.parameters();
    let start: Vec<f64> = parameters.coordinates.iter().map(|coordinate| coordinate.start).collect();
    let of = |index: usize| -> SizedCoordinate {
        let stands_in = |result: &&LawResult| result.form.value(&start).1.iter().any(|(i, _)| *i == index);
        let is_size = |result: &&LawResult| effect.parameter(&result.name).is_some_and(|p| p.role.is_size());
        let results = || parameters.results.iter().filter(stands_in);
        let result = results().find(is_size).or_else(|| results().next());
        let Some(result) = result else {
            let name = format!("{}.coordinate[{}]", effect.id, index + 1);
            return SizedCoordinate { name, unit: "", typical: 1.0, moves: 1.0, is_size: false };
        };
        let median =
            effect.parameter(&result.name).and_then(|parameter| parameter.typical).map(|typical| typical.median);
        let typical = median.zip(effect.scale(&result.name, scales)).map(|(median, scale)| median * scale);
        // Amplitudes at zero have a slope of nothing: both parts of a wave are as large as it.
        let slope = match result.form {
            Form::Exp(_) | Form::Scaled(..) => result.form.value(&start).0,
            _ => 1.0,
        };
        let part = match result.form {
            Form::Amplitude(c, _) | Form::SignedAmplitude(c, _) if c == index => " cos",
            Form::Amplitude(..) | Form::SignedAmplitude(..) => " sin",
            _ => "",
        };
        SizedCoordinate {
            name: format!("{}{part}", result.name),
            unit: result.unit,
            typical: typical.unwrap_or(1.0),
            // Of a logarithm whose result has no typical size, a factor of e.
            moves: typical.map_or(1.0, |typical| typical / slope.abs()),
            is_size: is_size(&result) && typical.is_some(),
        }
    };
    let coordinates: Vec<SizedCoordinate> = (0..parameters.coordinates.len()).map(of).collect();
    if coordinates.iter().all(|coordinate| !coordinate.is_size) {
        let reason = "its size is another one in each recording, or has no typical value";
        return Err(PlanError::NotForPlans { effect: effect.id, reason });
    }
    Ok(SizedLaw { law, coordinates })
}
