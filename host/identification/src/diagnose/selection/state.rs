//! What a selection holds: the accepted causes with their rivals, and the models with and without them.

use super::super::axes::axes_of_joints;
use super::super::catalogue::Named;
use super::super::curves::Curves;
use super::super::interval::{Gain, bca};
use super::super::refit::Fitted;
use super::super::scores::block_scores::LawScore;
use crate::effect::Effect;

/// What the scan says of an effect: of its best start.
#[derive(Debug, Clone)]
pub struct Scanned {
    /// Which.
    pub named: Named,
    /// What the blocks say.
    pub score: LawScore,
    /// Share of worlds without any effect in which any law comes this far.
    pub p_family: f64,
    /// Joints (1-based) in whose coordinates it shows.
    pub axes: Vec<usize>,
}

/// A law that was refitted in the place of an accepted one.
#[derive(Debug, Clone)]
pub struct Rival {
    /// Which.
    pub named: Named,
    /// What it gains out of sample.
    pub gain: f64,
    /// Its weight beside the accepted one and the other rivals.
    pub weight: f64,
    /// Joints (1-based).
    pub axes: Vec<usize>,
}

/// An accepted cause.
#[derive(Debug, Clone)]
pub struct Accepted {
    /// Which.
    pub named: Named,
    /// What it gained in each block out of sample when it came in.
    pub gains: Vec<f64>,
    /// See [`Scanned::p_family`]; of what blocks lose without it beside the others, and when it came in.
    pub p_family: f64,
    /// When it came in.
    pub(super) p_when_added: f64,
    /// Its weight among its rivals.
    pub weight: f64,
    /// What is collinear with it.
    pub rivals: Vec<Rival>,
    /// Whether it happened once: no other block can know of it.
    pub is_event: bool,
}

impl Accepted {
    /// Leaves out rivals that the other motion has rejected: the weights of the others add up to one. One whose rivals had it all is the best of what is left.
    pub fn leave_out_rivals(&mut self, is_rejected: impl Fn(&Effect) -> bool) {
        let before = self.rivals.len();
        self.rivals.retain(|rival| !is_rejected(rival.named.effect));
        if self.rivals.len() < before {
            let all: f64 = self.weight + self.rivals.iter().map(|rival| rival.weight).sum::<f64>();
            self.rivals.iter_mut().for_each(|rival| rival.weight /= all.max(f64::MIN_POSITIVE));
            self.weight = if all > 0.0 { self.weight / all } else { 1.0 };
        }
    }

    pub(super) fn add_rival(&mut self, other: &Accepted) {
        if self.rivals.iter().all(|rival| rival.named.effect.id != other.named.effect.id) {
            let axes = axes_of_joints(&*other.named.law);
            let gain = other.gains.iter().sum();
            self.rivals.push(Rival { named: other.named.clone(), gain, weight: 0.0, axes });
        }
    }
}

/// The model without a cause, and what each block loses without it.
pub type Loss = (Fitted, Vec<f64>);

/// What a selection came to.
#[derive(Debug, Clone)]
pub struct Selection {
    /// In the order in which they were accepted.
    pub accepted: Vec<Accepted>,
    /// The model with all of them.
    pub current: Fitted,
    /// The base model.
    pub base: Fitted,
    /// The scan of the base model, best first.
    pub scan: Vec<Scanned>,
    /// Curves on top of the base model, best first, where laws were held against them.
    pub base_curves: Option<Vec<Curves>>,
    /// Effects whose columns are not numbers.
    pub not_finite: Vec<(&'static str, usize)>,
    /// Laws that a scan looks at.
    pub(super) tests: usize,
    /// The models before each cause came in, as long as none has left.
    pub(super) path: Vec<Fitted>,
    /// The model without each cause, and what each block loses, where that is known of what is accepted now.
    pub(super) losses: Option<Vec<Loss>>,
}

impl Selection {
    /// Nothing is accepted yet.
    pub(super) fn of(base: Fitted) -> Self {
        Selection {
            accepted: Vec::new(),
            current: base.clone(),
            base,
            scan: Vec::new(),
            base_curves: None,
            not_finite: Vec::new(),
            tests: 1,
            path: Vec::new(),
            losses: None,
        }
    }

    /// Effects in the order in which they were accepted.
    pub(super) fn ids(&self) -> Vec<&'static str> {
        self.accepted.iter().map(|accepted| accepted.named.effect.id).collect()
    }

    /// Another model takes the place of the current one.
    pub(super) fn replace(&mut self, current: Fitted) -> Fitted {
        self.losses = None;
        self.path.clear();
        std::mem::replace(&mut self.current, current)
    }

    /// A cause comes in, with the model that has it.
    pub(super) fn push(&mut self, accepted: Accepted, with: Fitted) {
        let mut path = std::mem::take(&mut self.path);
        let follows = path.len() == self.accepted.len();
        let before = self.replace(with);
        path.push(before);
        if follows {
            self.path = path;
        }
        self.accepted.push(accepted);
    }

    /// The model before the last cause came in, if that is known.
    pub(super) fn before_last(&self) -> Option<&Fitted> {
        self.path.last().filter(|_| self.path.len() == self.accepted.len())
    }

    /// Takes a cause out, whose model without it is known.
    pub fn remove(&mut self, place: usize, without: Fitted) -> Accepted {
        let mut path = std::mem::take(&mut self.path);
        let is_last = place + 1 == self.accepted.len() && path.len() == self.accepted.len();
        self.replace(without);
        if is_last {
            path.pop();
            self.path = path;
        }
        self.accepted.remove(place)
    }
}

/// The sum of what blocks gain, as a share.
pub fn share(gains: &[f64], of: f64) -> Gain {
    let sum = |blocks: &mut dyn Iterator<Item = usize>| {
        let (mut sum, mut count) = (0.0, 0);
        for block in blocks {
            sum += gains[block];
            count += 1;
        }
        sum * gains.len() as f64 / f64::from(count.max(1))
    };
    let scale = of.max(f64::MIN_POSITIVE);
    let ci95 = bca(gains.len(), sum).map(|[low, high]| [low / scale, high / scale]);
    Gain { share: gains.iter().sum::<f64>() / scale, ci95, blocks: gains.len() }
}
