//! Is this recording fit for calibration, and if not, what to change in the motion or the wiring?
//!
//! Each subject is a file that looks at the recording alone and adds its findings. What the model would say (which
//! parameters the motion can identify) comes from the calibration and is added by [`Check::add`].

mod continuity;
mod excitation;
mod plausibility;
mod rest;
mod saturation;
mod stats;
#[cfg(test)]
mod tests;
mod timing;

use serde::{Deserialize, Serialize};

use super::{LossBalance, Recording, Severity};

pub use excitation::JointExcitation;
pub use rest::ChannelAtRest;
pub use timing::Timing;

/// The result of `host check`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Whether there is no finding of severity error.
    pub usable: bool,
    /// Name of the robot.
    pub robot: String,
    /// The file.
    pub path: String,
    /// Its SHA-256, lower-case hexadecimal.
    pub sha256: String,
    /// Samples in the recording.
    pub samples: usize,
    /// Ticks between the first and the last sample without one.
    pub missing_ticks: u64,
    /// Places where ticks are missing.
    pub gaps: usize,
    /// From the first to the last sample, s.
    pub duration_s: f64,
    /// Ticks per second by the device's clock, Hz.
    pub rate_hz: f64,
    /// What is wrong or worth knowing, the worst first.
    pub findings: Vec<Finding>,
    /// Where missing samples went, if a device recorded.
    pub balance: Option<LossBalance>,
    /// Regularity of the time stamps.
    pub timing: Timing,
    /// Length of the window before the first input, s.
    pub rest_s: f64,
    /// Each channel in that window.
    pub rest: Vec<ChannelAtRest>,
    /// What each joint did.
    pub joints: Vec<JointExcitation>,
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// The subject.
    pub about: About,
    /// Name of a channel, or of a joint's input (`u2`), if one is meant.
    pub channel: Option<String>,
    /// What was found, with the number.
    pub message: String,
    /// What to change.
    pub advice: String,
}

/// Subjects of findings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum About {
    /// The window at rest before the motion.
    BiasWindow,
    /// Missing samples, loss balance, damage of the file.
    Gaps,
    /// Rate and jitter.
    Timing,
    /// Readings at the end of a sensor's range, or none at all.
    Saturation,
    /// What the motion moves, and how.
    Excitation,
    /// Which parameters the recording can tell.
    Identifiability,
    /// Units, signs, axes, zero positions.
    Units,
}

/// Looks at a recording.
pub fn check(recording: &Recording) -> Check {
    let mut findings = Findings::default();
    continuity::look(recording, &mut findings);
    let timing = timing::look(recording, &mut findings);
    let rest = rest::look(recording, &mut findings);
    saturation::look(recording, &mut findings);
    let joints = excitation::look(recording, &mut findings);
    plausibility::look(recording, &mut findings);
    let window = recording.rest_window();
    let mut check = Check {
        usable: true,
        robot: recording.robot.name.clone(),
        path: recording.source.path.display().to_string(),
        sha256: recording.source.sha256.clone(),
        samples: recording.len(),
        missing_ticks: recording.missing_ticks(),
        gaps: recording.gaps(),
        duration_s: recording.duration_s(),
        rate_hz: timing.rate_hz,
        findings: Vec::new(),
        balance: recording.balance,
        timing,
        rest_s: window.end.checked_sub(1).map_or(0.0, |last| recording.time_s(last)),
        rest,
        joints,
    };
    for finding in findings.0 {
        check.add(finding);
    }
    check
}

/// What makes any result of this recording worthless: wrong units, signs or columns, another rate, sensors that are not
/// there, no input at all. A small part of [`check`].
pub fn obstacles(recording: &Recording) -> Vec<Finding> {
    let mut findings = Findings::default();
    timing::look(recording, &mut findings);
    rest::look(recording, &mut findings);
    saturation::look(recording, &mut findings);
    plausibility::look(recording, &mut findings);
    findings.0.retain(|finding| finding.severity == Severity::Error);
    findings.0
}

impl Finding {
    /// What was found, with the channel that is meant.
    pub fn told(&self) -> String {
        match &self.channel {
            Some(channel) => format!("{channel}: {}", self.message),
            None => self.message.clone(),
        }
    }
}

impl Check {
    /// Adds a finding in its place; one of severity error makes the recording unusable.
    pub fn add(&mut self, finding: Finding) {
        self.usable &= finding.severity != Severity::Error;
        let place = self.findings.partition_point(|earlier| earlier.severity >= finding.severity);
        self.findings.insert(place, finding);
    }
}

/// Findings as they are made.
#[derive(Debug, Default)]
struct Findings(Vec<Finding>);

impl Findings {
    fn add(&mut self, severity: Severity, about: About, channel: Option<&str>, message: String, advice: &str) {
        let channel = channel.map(str::to_owned);
        self.0.push(Finding { severity, about, channel, message, advice: advice.to_owned() });
    }
}
