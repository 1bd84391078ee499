//! What is tried: the laws of the catalogue that suit a robot, each from several starts or in several shapes.

use std::sync::Arc;

use crate::calibrate::laws_for;
use crate::effect::{CATALOGUE, Effect};
use crate::model::law::{Law, Readings};
use crate::robot::Robot;

/// An effect with one of its laws.
#[derive(Debug, Clone)]
pub struct Named {
    /// Which.
    pub effect: &'static Effect,
    /// Its law.
    pub law: Arc<dyn Law>,
}

/// An effect of the catalogue that this robot could have.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub effect: &'static Effect,
    /// Its law from several starts or in several shapes.
    pub alternatives: Vec<Arc<dyn Law>>,
}

/// The catalogue for `robot` but for the ids in `without`, started from `readings` where those say more than the robot; and what cannot be tested, with the
/// reason.
pub fn catalogue(
    robot: &Robot,
    readings: &Readings,
    without: &[String],
) -> (Vec<Candidate>, Vec<(&'static str, String)>) {
    let (mut candidates, mut others) = (Vec::new(), Vec::new());
    for effect in CATALOGUE.into_iter().filter(|effect| !without.iter().any(|id| id == effect.id)) {
        match laws_for(effect, robot, readings) {
            Ok(alternatives) => candidates.push(Candidate { effect, alternatives }),
            Err(error) => others.push((effect.id, error.to_string())),
        }
    }
    (candidates, others)
}

/// Laws in the catalogue's order: a plant's line asks them so.
pub fn laws<'a>(named: impl Iterator<Item = &'a Named>) -> Vec<Arc<dyn Law>> {
    let place = |effect: &Effect| CATALOGUE.iter().position(|other| other.id == effect.id);
    let mut sorted: Vec<&Named> = named.collect();
    sorted.sort_by_key(|named| place(named.effect));
    sorted.into_iter().map(|named| named.law.clone()).collect()
}
