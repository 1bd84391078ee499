//! What is tried in the place of what is missing: the laws of the catalogue that suit a robot.

use std::sync::Arc;

use crate::effect::{CATALOGUE, Effect};
use crate::model::law::{Clues, Law};
use crate::robot::Robot;

/// An effect of the catalogue that this robot could have.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub effect: &'static Effect,
    /// Its law from several starts or in several shapes.
    pub alternatives: Vec<Arc<dyn Law>>,
}

impl Candidate {
    /// With the first of its alternatives only.
    pub fn first(&self, alternatives: usize) -> Self {
        let alternatives = self.alternatives.iter().take(alternatives).cloned().collect();
        Candidate { effect: self.effect, alternatives }
    }

    /// Its law from what the recording shows of events and contacts.
    pub fn starts(&self, clues: &Clues) -> Vec<Arc<dyn Law>> {
        self.alternatives.first().filter(|law| law.is_event()).map_or_else(Vec::new, |law| law.starts(clues))
    }
}

/// The catalogue for `robot` but for the ids in `without`; and what cannot be tested, with the reason.
pub fn catalogue(robot: &Robot, without: &[String]) -> (Vec<Candidate>, Vec<(&'static str, String)>) {
    let (mut candidates, mut others) = (Vec::new(), Vec::new());
    for effect in CATALOGUE.into_iter().filter(|effect| !without.iter().any(|id| id == effect.id)) {
        match effect.laws(robot) {
            Ok(alternatives) => candidates.push(Candidate { effect, alternatives }),
            Err(error) => others.push((effect.id, error.to_string())),
        }
    }
    (candidates, others)
}
