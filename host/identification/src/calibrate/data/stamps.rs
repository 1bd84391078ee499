//! When samples were really taken: where stamps jitter, the encoders tell whether the samples did too.
//!
//! ```text
//! stamps     |    |   |     |   |    |   |        δ: a stamp less the straight line through its neighbours
//! line       |    |    |    |    |    |    |      a joint at speed v reads v β δ beside a smooth motion
//!                                                 β = 1: taken at their stamps, 0: taken evenly, whatever the stamps say
//! ```
//!
//! A stamp may be late because the tick was, or because whoever wrote it was busy. 10 µs at 10 rad/s are more than an encoder's count, and
//! noise that grows with speed is taken for one defect or another. β is the slope of a regression through fourth differences, which
//! a smooth motion does not have; each channel weighs by its own. Where β cannot be told, or is 1 but for chance, stamps stay as they are.
//! Stamps that are late by more than a period are no jitter but another rate: they say nothing of β, and stay. So do all where channels do not
//! agree on β, or it is far outside of 0 … 1.

use std::ops::Range;

use crate::recording::Recording;
use crate::robot::ChannelKind;

/// Samples on either side of the line through a stamp's neighbours.
const HALF_LINE: usize = 50;
/// Samples on either side of one whose parabola tells speed and acceleration.
const HALF_SPEED: usize = 4;
/// Periods by which a stamp may be late and jitter. Logs of another clock (10, 10, 12 ms) have 0.1; where a rate changes it is 1 and more.
const MOST_LATE: f64 = 1.0;
/// Fourth differences.
const DIFFERENCE: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
/// A standard error of β that tells nothing.
const UNSURE: f64 = 0.1;
/// Standard errors within which β is what it usually is.
const SURE: f64 = 4.0;
/// Channels whose β differ by more from that of all, or a β so far outside of 0 … 1, have another cause than jitter: a drive that answers with the
/// reading of the loop before has −0.8 to −0.5 (two measured arms), loops that are simulated 0 to 1 within 0.02. At half of it a recording
/// with few samples in motion keeps its jitter; at twice of it a drive of two that answers late passes.
const UNLIKE: f64 = 0.2;

/// Time of every sample of a recording since its first one, µs; `runs` are those without a gap.
pub(crate) fn times_us(recording: &Recording, runs: &[Range<usize>]) -> Vec<f64> {
    let mut times: Vec<f64> = recording.t_us.iter().map(|t| (t - recording.t_us[0]) as f64).collect();
    let mut late = vec![0.0; times.len()];
    for run in runs {
        beside_line(&times[run.clone()], &mut late[run.clone()]);
    }
    late.iter_mut().filter(|late| late.abs() > MOST_LATE * 1e6 * recording.period_s).for_each(|late| *late = f64::NAN);
    let is_position = |kind| matches!(kind, ChannelKind::MotorPosition { .. } | ChannelKind::LinkPosition { .. });
    let positions = recording.channels.iter().filter(|channel| is_position(channel.spec.kind));
    let sums: Vec<Sums> = positions.map(|channel| Sums::of(&channel.values, &times, &late, runs)).collect();
    let share = share(&sums);
    if share < 1.0 {
        tracing::info!(share, "stamps jitter more than the samples");
        let jitter = times.iter_mut().zip(&late).filter(|(_, late)| late.is_finite());
        jitter.for_each(|(time, late)| *time -= (1.0 - share) * late);
    }
    times
}

/// Of every stamp of a run, how far it is beside the straight line through those around it, µs.
fn beside_line(times: &[f64], late: &mut [f64]) {
    let n = times.len();
    for (k, late) in late.iter_mut().enumerate() {
        let half = HALF_LINE.min(n - 1);
        let (from, to) = (k.saturating_sub(half), (k + half).min(n - 1));
        let window = from..=to;
        let count = (to - from + 1) as f64;
        let (x0, t0) = (0.5 * (from + to) as f64, times[window.clone()].iter().sum::<f64>() / count);
        let x = |i: usize| i as f64 - x0;
        let (mut above, mut below) = (0.0, 0.0);
        for i in window {
            above += x(i) * (times[i] - t0);
            below += x(i) * x(i);
        }
        let slope = if below > 0.0 { above / below } else { 0.0 };
        *late = times[k] - t0 - slope * x(k);
    }
}

/// Speed and half the acceleration at `at_us` of the parabola through some readings, per s and s².
fn parabola(times_us: &[f64], values: &[f64], at_us: f64) -> [f64; 2] {
    let moment = |power: i32| times_us.iter().map(|t| ((t - at_us) * 1e-6).powi(power)).sum::<f64>();
    let with = |power: i32| times_us.iter().zip(values).map(|(t, v)| ((t - at_us) * 1e-6).powi(power) * v).sum::<f64>();
    let [s0, s1, s2, s3, s4] = [0, 1, 2, 3, 4].map(moment);
    let normal = nalgebra::Matrix3::new(s0, s1, s2, s1, s2, s3, s2, s3, s4);
    let right = nalgebra::Vector3::new(with(0), with(1), with(2));
    normal.try_inverse().map_or([f64::NAN; 2], |inverse| {
        let fit = inverse * right;
        [fit[1], fit[2]]
    })
}

/// Of a regression through one channel: Σ w e, Σ w², Σ e², and how many.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    we: f64,
    ww: f64,
    ee: f64,
    count: f64,
}

impl Sums {
    fn of(values: &[f64], times_us: &[f64], late_us: &[f64], runs: &[Range<usize>]) -> Self {
        let mut sums = Sums::default();
        let mut moved = Vec::new();
        for run in runs.iter().filter(|run| run.len() > 2 * HALF_SPEED + DIFFERENCE.len()) {
            let (values, times, late) = (&values[run.clone()], &times_us[run.clone()], &late_us[run.clone()]);
            let inner = HALF_SPEED..values.len() - HALF_SPEED;
            moved.clear();
            moved.extend(inner.clone().map(|k| {
                let around = k - HALF_SPEED..=k + HALF_SPEED;
                let [speed, half_acceleration] = parabola(&times[around.clone()], &values[around], times[k]);
                let late_s = late[k] * 1e-6;
                (speed - half_acceleration * late_s) * late_s
            }));
            for (place, w) in moved.windows(DIFFERENCE.len()).enumerate() {
                let at = inner.start + place;
                let difference = |of: &[f64]| of.iter().zip(DIFFERENCE).map(|(value, by)| by * value).sum::<f64>();
                let (w, e) = (difference(w), difference(&values[at..at + DIFFERENCE.len()]));
                // A reading that is none.
                if !(w.is_finite() && e.is_finite()) {
                    continue;
                }
                sums = Sums { we: sums.we + w * e, ww: sums.ww + w * w, ee: sums.ee + e * e, count: sums.count + 1.0 };
            }
        }
        sums
    }

    /// What a channel's fourth differences are beside the slope, squared.
    fn variance(&self, slope: f64) -> f64 {
        (self.ee - 2.0 * slope * self.we + slope * slope * self.ww) / self.count.max(1.0)
    }
}

/// How much of a stamp's jitter its sample has: 1 where nothing else is sure.
fn share(channels: &[Sums]) -> f64 {
    let told: Vec<&Sums> = channels.iter().filter(|sums| sums.ww > 0.0 && sums.ee > 0.0).collect();
    let (mut above, mut below) = (0.0, 0.0);
    for sums in &told {
        let variance = sums.variance(sums.we / sums.ww).max(f64::MIN_POSITIVE);
        above += sums.we / variance;
        below += sums.ww / variance;
    }
    let error = below.sqrt().recip();
    if below <= 0.0 || error > UNSURE {
        return 1.0;
    }
    let slope = above / below;
    let is_unlike = |sums: &&Sums| {
        let own = sums.we / sums.ww;
        let error = (sums.variance(own) / sums.ww).sqrt();
        (own - slope).abs() > UNLIKE.max(SURE * error)
    };
    if !(-UNLIKE..=1.0 + UNLIKE).contains(&slope) || told.iter().any(is_unlike) {
        tracing::info!(slope, "readings do not follow the jitter of their stamps in one way: stamps stay as they are");
        return 1.0;
    }
    tracing::debug!(slope, error, "share of the stamps' jitter that the samples have");
    if (slope - 1.0).abs() < SURE * error {
        1.0
    } else if slope.abs() < SURE * error {
        0.0
    } else {
        slope.clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::robot::Robot;
    use crate::simulated::{Options, SHORT_MOTION, record};

    /// 20,000 samples of a joint that swings with up to `speed`, with stamps that jitter by 10 µs, of which the samples have a share.
    fn swinging(speed: f64, has: f64) -> (Vec<f64>, Vec<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let rate = std::f64::consts::TAU * 3.0;
        (0..20_000)
            .map(|k| {
                let (even, jitter) = (1e3 * k as f64, (10.0 * normal()).round());
                let t = 1e-6 * (even + has * jitter);
                (even + jitter, speed / rate * (rate * t).sin() + 7e-5 * normal())
            })
            .unzip()
    }

    fn share_of(speed: f64, has: f64) -> f64 {
        let (times, values) = swinging(speed, has);
        let mut late = vec![0.0; times.len()];
        beside_line(&times, &mut late);
        let all = 0..times.len();
        share(&[Sums::of(&values, &times, &late, std::slice::from_ref(&all))])
    }

    #[test]
    fn encoders_tell_whether_the_samples_jitter_as_their_stamps_do() {
        assert_eq!(share_of(6.0, 1.0), 1.0);
        assert_eq!(share_of(6.0, 0.0), 0.0);
        let half = share_of(6.0, 0.5);
        assert!((half - 0.5).abs() < 0.05, "{half}");
        // Too slow to tell: as the stamps say.
        assert_eq!([share_of(0.1, 0.0), share_of(0.1, 1.0)], [1.0, 1.0]);
    }

    #[test]
    fn a_drive_that_answers_with_the_reading_before_leaves_the_stamps_alone() {
        // Stamps and readings jitter together, but each reading is that of the stamp before.
        let (times, values) = swinging(6.0, 1.0);
        let mut late = vec![0.0; times.len() - 1];
        beside_line(&times[1..], &mut late);
        let all = 0..late.len();
        let of = |values: &[f64]| Sums::of(values, &times[1..], &late, std::slice::from_ref(&all));
        let before = of(&values[..values.len() - 1]);
        // rtol 10 %: white jitter that is one sample late has four fifths of its fourth differences with the sign turned.
        let slope = before.we / before.ww;
        assert!((slope + 0.8).abs() < 0.08, "{slope}");
        assert_eq!(share(&[before]), 1.0);
        // So does one such drive of two.
        let even = swinging(6.0, 0.0).1;
        assert_eq!(share(&[of(&values[1..]), of(&even[1..])]), 1.0);
        assert_eq!(share(&[of(&even[1..]), of(&even[1..])]), 0.0);
    }

    #[test]
    fn samples_of_another_clock_are_taken_at_their_stamps() {
        // A loop of 500 Hz that is written every 10, 10 and 12 ms: a joint that swings at half a hertz is 3 mrad off an even one.
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut t_us = 0.0;
        let (times, values): (Vec<f64>, Vec<f64>) = (0..4000)
            .map(|k| {
                t_us += if k % 3 == 2 { 12e3 } else { 10e3 };
                (t_us, (std::f64::consts::PI * 1e-6 * t_us).sin() + 2e-4 * normal())
            })
            .unzip();
        let mut late = vec![0.0; times.len()];
        beside_line(&times, &mut late);
        let all = 0..times.len();
        let share = share(&[Sums::of(&values, &times, &late, std::slice::from_ref(&all))]);
        // Off by at most a thousandth of a jitter of a millisecond: a microsecond.
        assert!((share - 1.0).abs() < 1e-3, "{share}");
    }

    #[test]
    fn a_recording_whose_stamps_alone_jitter_is_taken_evenly() {
        let options = Options { seed: 3, ..Options::new(Robot::builtin("doggy").unwrap()) };
        let even = record(&options, SHORT_MOTION).recording;
        let mut jittered = even.clone();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for t in jittered.t_us.iter_mut().skip(1) {
            let normal: f64 = StandardNormal.sample(&mut rng);
            *t = t.saturating_add_signed((10.0 * normal.clamp(-4.0, 4.0)).round() as i64);
        }
        let [even, mended] = [&even, &jittered].map(|recording| times_us(recording, &recording.segments()));
        let raw: Vec<f64> = jittered.t_us.iter().map(|t| (t - jittered.t_us[0]) as f64).collect();
        let off = |times: &[f64]| {
            let squares: f64 = times.iter().zip(&even).map(|(a, b)| (a - b).powi(2)).sum();
            (squares / even.len() as f64).sqrt()
        };
        // Left is the mean of a hundred stamps: 10 µs / √101.
        assert!((9.0..11.0).contains(&off(&raw)) && off(&mended) < 1.3, "{} µs, then {}", off(&raw), off(&mended));
    }
}
