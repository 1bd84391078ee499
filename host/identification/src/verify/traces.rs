//! The curves behind a verification, for its page: measured and freely predicted, sample by sample.

use std::ops::Range;

use super::calibrated::CalibratedModel;
use super::free_run::FreeRun;
use super::stage::Stage;
use crate::recording::Recording;
use crate::robot::ChannelKind;

/// What was measured and what the free run says.
#[derive(Debug, Clone)]
pub struct Traces {
    /// Time of each sample after the first one, s.
    pub t_s: Vec<f64>,
    /// The recording's channels: predicted by the free run, NaN where it does not predict.
    pub predicted: Vec<Vec<f64>>,
    /// Motor speed of each joint by the free run, rad/s (m/s).
    pub motor_speed: Vec<Vec<f64>>,
    /// Motor speed of each joint as its encoder shows it: the slope of a straight line through the readings within
    /// ±`SLOPE_S` (NaN near gaps). The encoder's step is too coarse for a difference of neighbours.
    pub measured_motor_speed: Vec<Vec<f64>>,
    /// Stages of the motion.
    pub stages: Vec<Stage>,
    /// First sample after each gap: a curve must not be drawn across.
    pub breaks: Vec<usize>,
}

/// Half the width of the slope's window, s.
pub const SLOPE_S: f64 = 0.01;

impl Traces {
    pub(super) fn new(
        model: &CalibratedModel,
        recording: &Recording,
        t_s: Vec<f64>,
        run: FreeRun,
        stages: Vec<Stage>,
    ) -> Self {
        let layout = model.model().layout();
        let segments = recording.segments();
        let half = ((SLOPE_S / recording.period_s).round() as usize).max(1);
        let joints = 0..layout.joints();
        let measured_motor_speed = joints
            .clone()
            .map(|joint| {
                let kind = ChannelKind::MotorPosition { joint };
                let encoder = recording.channels.iter().find(|c| c.spec.kind == kind);
                encoder.map_or_else(Vec::new, |c| slopes(&c.values, &segments, half, |k| recording.time_s(k)))
            })
            .collect();
        Self {
            t_s,
            predicted: run.outputs,
            motor_speed: joints.map(|joint| run.states[layout.thetad(joint)].clone()).collect(),
            measured_motor_speed,
            stages,
            breaks: segments.iter().skip(1).map(|s| s.start).collect(),
        }
    }
}

impl Traces {
    /// The stretch of `width_s` within `samples` in which the motors move most: what a zoom should show.
    pub fn busiest(&self, samples: Range<usize>, width_s: f64) -> Range<f64> {
        let (first, last) = (self.t_s[samples.start], self.t_s[samples.end - 1]);
        if last - first <= width_s {
            return first..last;
        }
        // Energy of the speeds up to each sample; NaN (near gaps) adds nothing.
        let mut energy = vec![0.0];
        for k in samples.clone() {
            let speeds = self.motor_speed.iter().map(|speed| speed[k] * speed[k]).filter(|e| e.is_finite());
            energy.push(energy[k - samples.start] + speeds.sum::<f64>());
        }
        let t = &self.t_s[samples];
        let mut best = (f64::NEG_INFINITY, first);
        let mut end = 0;
        for start in 0..t.len() {
            while end < t.len() && t[end] < t[start] + width_s {
                end += 1;
            }
            if end == t.len() {
                break;
            }
            let within = energy[end] - energy[start];
            if within > best.0 {
                best = (within, t[start]);
            }
        }
        best.1..best.1 + width_s
    }
}

/// Slope of the least-squares line through the `2·half + 1` values around each sample: Σ (t − t̄) y / Σ (t − t̄)².
fn slopes(values: &[f64], segments: &[Range<usize>], half: usize, time_s: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut slopes = vec![f64::NAN; values.len()];
    for segment in segments {
        for k in segment.start + half..segment.end.saturating_sub(half) {
            let around = k - half..=k + half;
            let mean_s = around.clone().map(&time_s).sum::<f64>() / (2 * half + 1) as f64;
            let (mut above, mut below) = (0.0, 0.0);
            for i in around {
                let t = time_s(i) - mean_s;
                // Sums of t are zero but for rounding, which a position far from zero would show.
                above += t * (values[i] - values[k]);
                below += t * t;
            }
            slopes[k] = above / below;
        }
    }
    slopes
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_slope_of_a_parabola_is_exact_and_gaps_are_left_out() {
        let y: Vec<f64> = (0..100).map(|k| 3.0 + 0.5 * f64::from(k) + 0.01 * f64::from(k * k)).collect();
        let slopes = super::slopes(&y, &[0..40, 40..100], 5, |k| 1e-3 * k as f64);
        for (k, slope) in slopes.iter().enumerate() {
            if (5..35).contains(&k) || (45..95).contains(&k) {
                let expected = (0.5 + 0.02 * k as f64) * 1e3;
                assert!((slope - expected).abs() < 1e-9 * expected);
            } else {
                assert!(slope.is_nan(), "{k}");
            }
        }
    }
}
