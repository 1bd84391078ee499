//! Rate and regularity of the ticks, by the device's own clock.

use protocol::Flags;
use serde::{Deserialize, Serialize};

use super::stats::spread;
use super::{About, Findings};
use crate::recording::import::rate::is_another_unit;
use crate::recording::{Recording, Severity};

/// Relative error of the rate that shows in the parameters (crystals are good to 1e-4).
const RATE_WARNING: f64 = 1e-3;
/// Relative difference of a table's rate from the robot file's that is worth a word.
const TABLE_RATE_NOTE: f64 = 2e-2;
/// Jitter, as a share of the period, that the integration of one period a sample begins to feel.
const JITTER_WARNING: f64 = 0.02;
/// Share of the period that the computation of a tick may take.
const EXECUTION_WARNING: f64 = 0.8;

/// Regularity of the time stamps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Ticks per second by the device's clock, Hz.
    pub rate_hz: f64,
    /// Standard deviation of the step between neighbouring ticks, µs.
    pub jitter_us: f64,
    /// Largest difference between such a step and the period, µs.
    pub worst_step_us: f64,
    /// Longest time that a tick took to compute, µs, if the device told.
    pub execution_us: Option<f64>,
    /// Ticks that overran their period.
    pub overruns: usize,
}

pub(super) fn look(recording: &Recording, findings: &mut Findings) -> Timing {
    let period_us = recording.period_s * 1e6;
    let ticks = match (recording.seq.first(), recording.seq.last()) {
        (Some(first), Some(last)) => last - first,
        _ => 0,
    };
    let rate_hz = match (recording.t_us.first(), recording.t_us.last()) {
        (Some(first), Some(last)) if ticks > 0 => ticks as f64 * 1e6 / (last - first) as f64,
        _ => 1.0 / recording.period_s,
    };
    let deviations: Vec<f64> = (1..recording.len())
        .filter(|&k| recording.seq[k] == recording.seq[k - 1] + 1)
        .map(|k| (recording.t_us[k] - recording.t_us[k - 1]) as f64 - period_us)
        .collect();
    let timing = Timing {
        rate_hz,
        jitter_us: spread(&deviations).map_or(0.0, |spread| spread.deviation),
        worst_step_us: deviations.iter().fold(0.0, |worst: f64, deviation| worst.max(deviation.abs())),
        execution_us: recording.ticks.iter().map(|tick| tick.execution_us).filter(|us| !us.is_nan()).reduce(f64::max),
        overruns: count(recording, Flags::OVERRUN),
    };
    report(&timing, recording, findings);
    timing
}

fn count(recording: &Recording, flag: Flags) -> usize {
    recording.ticks.iter().filter(|tick| Flags::from_bits_truncate(tick.flags).contains(flag)).count()
}

fn report(timing: &Timing, recording: &Recording, findings: &mut Findings) {
    let mut add = |severity, message, advice| findings.add(severity, About::Timing, None, message, advice);
    let nominal_hz = 1.0 / recording.robot.sample_period_s;
    let off = timing.rate_hz / nominal_hz - 1.0;
    let rates = format!(
        "{:.3} ticks a second where the robot file says {nominal_hz:.3} ({:+.2} %)",
        timing.rate_hz,
        100.0 * off
    );
    let is_table = recording.imported_from.is_some();
    if is_another_unit(timing.rate_hz, nominal_hz) {
        add(Severity::Error, rates, "check the unit of the times, and sample_period_s in the robot file");
    } else if off.abs() > RATE_WARNING && !is_table {
        let advice = "stamps are used as they are: if the device's clock is right, correct sample_period_s in the robot file; if it is \
                      not, its timer, or speeds and torques are off by as much";
        add(Severity::Warning, rates, advice);
    } else if off.abs() > TABLE_RATE_NOTE {
        add(Severity::Note, rates, "nothing to do: each row is taken at its own stamp");
    }
    if timing.jitter_us > JITTER_WARNING * recording.period_s * 1e6 {
        let message =
            format!("the ticks jitter by {:.1} µs rms, at worst {:.0} µs", timing.jitter_us, timing.worst_step_us);
        let (severity, advice) = match is_table {
            true => {
                (Severity::Note, "nothing to do if each row is stamped where it was taken: stamps are used as they are")
            }
            false => {
                (Severity::Warning, "stamp the samples in the control loop by a hardware timer, not where they arrive")
            }
        };
        add(severity, message, advice);
    }
    if timing.overruns > 0 {
        add(
            Severity::Warning,
            format!("{} ticks overran their period", timing.overruns),
            "the duty took effect late there: lower the rate or what the tick has to do",
        );
    }
    if let Some(execution_us) = timing.execution_us.filter(|us| *us > EXECUTION_WARNING * recording.period_s * 1e6) {
        add(
            Severity::Note,
            format!("a tick took up to {execution_us:.0} µs of {:.0} µs", recording.period_s * 1e6),
            "little time is left: lower the rate or what the tick has to do",
        );
    }
}
