//! What a plant remembers of its last steps, for effects that act late.

use std::collections::VecDeque;

use crate::robot::Side;
use crate::robot::chain::MAX_JOINTS;

/// Inputs and positions of the last steps.
///
/// ```text
///   │ step │ step │ … │ newest step │          each holds its input, constant, and the positions at its start
///   t₀     t₁                       now        what lies before t₀ is rest: no input, positions as at t₀
/// ```
#[derive(Debug, Default)]
pub struct Past {
    memory_s: f64,
    now_s: f64,
    steps: VecDeque<Step>,
}

#[derive(Debug)]
struct Step {
    start_s: f64,
    end_s: f64,
    input: [f64; MAX_JOINTS],
    motor: [f64; MAX_JOINTS],
    link: [f64; MAX_JOINTS],
}

impl Past {
    /// Nothing yet; remembers `memory_s` seconds.
    pub fn new(memory_s: f64) -> Self {
        Self { memory_s, ..Self::default() }
    }

    /// A step of `step_s` begins: its commanded inputs, and where motors and links stand.
    pub fn push(&mut self, step_s: f64, input: &[f64], motor: &[f64], link: &[f64]) {
        if self.memory_s == 0.0 {
            return;
        }
        let fixed = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
        let start_s = self.now_s;
        self.now_s += step_s;
        let step = Step { start_s, end_s: self.now_s, input: fixed(input), motor: fixed(motor), link: fixed(link) };
        self.steps.push_back(step);
        // The newest step is asked for the input that far before its start.
        while self.steps.get(1).is_some_and(|second| second.start_s < start_s - self.memory_s) {
            self.steps.pop_front();
        }
    }

    /// Forgets everything: the robot rests.
    pub fn clear(&mut self) {
        self.steps.clear();
    }

    /// Mean input of joint `joint` over the newest step's span, `delay_s` before it. An input that changes inside the span
    /// counts with its share of the span, so that no impulse is lost.
    pub fn input(&self, joint: usize, delay_s: f64) -> f64 {
        let Some(newest) = self.steps.back() else { return 0.0 };
        let (from, to) = (newest.start_s - delay_s, newest.end_s - delay_s);
        let overlap = |step: &Step| (step.end_s.min(to) - step.start_s.max(from)).max(0.0);
        let impulse: f64 = self
            .steps
            .iter()
            .rev()
            .take_while(|step| step.end_s > from)
            .map(|step| overlap(step) * step.input[joint])
            .sum();
        impulse / (to - from)
    }

    /// Where a side of joint `joint` stood `delay_s` ago; `now` is where it stands. Linear between steps.
    pub fn position(&self, side: Side, joint: usize, delay_s: f64, now: f64) -> f64 {
        let wanted_s = self.now_s - delay_s;
        let (mut later_s, mut later) = (self.now_s, now);
        for step in self.steps.iter().rev() {
            let position = match side {
                Side::Motor => step.motor[joint],
                Side::Link => step.link[joint],
            };
            if step.start_s <= wanted_s {
                let share = (wanted_s - step.start_s) / (later_s - step.start_s);
                return position + share.min(1.0) * (later - position);
            }
            (later_s, later) = (step.start_s, position);
        }
        later
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp remembered in uneven steps is found again between them; before the first step there was rest.
    #[test]
    fn positions_and_inputs_are_found_again() {
        let mut past = Past::new(5e-3);
        let mut t = 0.0;
        for k in 0..200 {
            let step_s = if k % 3 == 0 { 0.7e-4 } else { 1e-4 };
            past.push(step_s, &[f64::from(k)], &[2.0 * t], &[-t]);
            t += step_s;
        }
        for delay in [0.0, 1e-4, 2.345e-3, 5e-3] {
            assert!((past.position(Side::Motor, 0, delay, 2.0 * t) - 2.0 * (t - delay)).abs() < 1e-12);
            assert!((past.position(Side::Link, 0, delay, -t) + (t - delay)).abs() < 1e-12);
        }
        assert_eq!(past.input(0, 0.0), 199.0);
        assert!(past.steps.len() < 62, "it forgets: {}", past.steps.len());

        let mut young = Past::new(5e-3);
        young.push(1e-4, &[1.0], &[0.5], &[0.5]);
        assert_eq!(young.input(0, 2e-3), 0.0);
        assert_eq!(young.position(Side::Motor, 0, 3e-3, 0.6), 0.5);
    }

    /// An input that changed 1 ms ago reaches a span of 0.1 ms, delayed by 0.97 ms, with its share.
    #[test]
    fn a_change_inside_the_span_counts_with_its_share() {
        let mut past = Past::new(2e-3);
        for k in 0..30 {
            past.push(1e-4, &[if k < 20 { 0.0 } else { 1.0 }], &[], &[]);
        }
        // The newest span is 2.9 to 3.0 ms; 0.93 ms before it lies 1.97 to 2.07 ms, and the input came at 2.0 ms.
        assert!((past.input(0, 0.93e-3) - 0.7).abs() < 1e-9);
        assert_eq!(past.input(0, 1.0e-3), 0.0);
        assert!((past.input(0, 0.9e-3) - 1.0).abs() < 1e-9);
    }
}
