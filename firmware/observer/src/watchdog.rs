//! Does the robot still behave like its model? A test of the normalised innovation that runs along.
//!
//! The readings of a tick, m of them, give a NIS that is χ² with m degrees of freedom while the model is true. If innovations are c times as large
//! as they should be (in variance), a tick tells that by the logarithm of the likelihood ratio, and Page's cumulative sum (E. S. Page, *Continuous
//! inspection schemes*, Biometrika 41, 1954) adds up what speaks for it:
//! ```text
//! s ← max(0, s + min(½ ((1 − 1/c) NIS − m ln c), most)),   an event where s > threshold
//! ```
//! Of a true model the mean time to a false event is at least e^threshold ticks (G. Lorden, *Procedures for reacting to a change in
//! distribution*, Annals of Mathematical Statistics 42, 1971). Of innovations r times as large as they should be, r > c ln c / (c − 1), the sum grows by
//! m/2 ((1 − 1/c) r − ln c) a tick: nine readings that are twice as large raise an event within some 40 ticks. No tick adds more than a tenth
//! of the threshold, so that no single reading raises one.

use crate::Real;

/// How much larger than it should be the variance of innovations is taken to be, c. Every ratio above c ln c / (c − 1) = 1.39 is found.
const RATIO: f64 = 2.0;

/// The threshold: e⁵⁰ ticks of 1 ms are 10¹¹ years. It is this large because a true model has bursts where friction reverses; half and double
/// have not been tried.
const THRESHOLD: f64 = 50.0;

/// Least ticks from the first wrong reading to an event. More of them would cut off what tells small ratios.
const LEAST_TICKS: f64 = 10.0;

/// The cumulative sum, and whether it has passed its threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watchdog<T> {
    sum: T,
    has_tripped: bool,
}

impl<T: Real> Default for Watchdog<T> {
    fn default() -> Self {
        Self { sum: T::of(0.0), has_tripped: false }
    }
}

impl<T: Real> Watchdog<T> {
    /// Takes in the innovation of a tick; whether the robot has just stopped behaving like its model.
    pub fn look(&mut self, innovation: crate::Innovation<T>) -> bool {
        let zero = T::of(0.0);
        let count = T::of(f64::from(innovation.taken));
        let told = T::of(0.5) * (T::of(1.0 - 1.0 / RATIO) * innovation.nis - count * T::of(core::f64::consts::LN_2));
        let most = T::of(THRESHOLD / LEAST_TICKS);
        // A filter that ran away tells nothing good.
        let told = if told < most { told } else { most };
        let sum = self.sum + told;
        self.sum = if sum > zero { sum } else { zero };
        let trips = self.sum > T::of(THRESHOLD);
        if trips {
            self.sum = T::of(THRESHOLD);
        }
        let is_new = trips && !self.has_tripped;
        self.has_tripped |= trips;
        is_new
    }

    /// Whether there was an event since the last [`Self::clear`].
    pub fn has_tripped(&self) -> bool {
        self.has_tripped
    }

    /// Share of the threshold, 0 to 1.
    pub fn level(&self) -> T {
        self.sum * T::of(1.0 / THRESHOLD)
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}
