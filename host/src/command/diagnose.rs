//! `host diagnose`: what the model gets wrong, by name, and what knowing it brings.

use std::path::PathBuf;

use super::{Exit, Failure, FitnessArgs, ResultArgs, Ui, read_failure, robot_failure};
use crate::diagnose::{self, Diagnosis, Finding, Options, Verdict};
use crate::failure::diagnose_failure;
use crate::recording::Recording;
use crate::report::diagnosis::words::{self, Names};
use crate::report::number::{seconds, significant};
use crate::robot::Robot;
use crate::{recording, report};

/// Show what the model gets wrong, name the cause, measure what knowing it brings
///
/// Calibrates the base model, says whether it fits, and tries every effect of the catalogue on what it leaves unexplained. What predicts blocks of time that no
/// fit has seen is named. The gain is measured on another motion, or on the last third of each recording.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recordings to explain, of one robot
    #[arg(value_name = "RUN", required = true)]
    recordings: Vec<PathBuf>,
    /// Another motion of the same robot, to measure the gain on
    #[arg(long, value_name = "RUN2")]
    holdout: Option<PathBuf>,
    /// The robot, a built-in name or a file, instead of the one in the recording
    #[arg(long, value_name = "R")]
    robot: Option<String>,
    /// Leave this effect out of the catalogue. Can be given several times
    #[arg(long, value_name = "ID")]
    without: Vec<String>,
    #[command(flatten)]
    fitness: FitnessArgs,
    #[command(flatten)]
    result: ResultArgs,
}

/// Reads, diagnoses, writes the result, prints the findings.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let other = args.robot.as_deref().map(Robot::load).transpose().map_err(robot_failure)?;
    let runs: Vec<Recording> =
        args.recordings.iter().map(|path| recording::read(path)).collect::<Result<_, _>>().map_err(read_failure)?;
    let holdout = args.holdout.as_deref().map(recording::read).transpose().map_err(read_failure)?;
    for recording in runs.iter().chain(&holdout) {
        args.fitness.look(recording, recording.source.path.display(), ui)?;
    }
    let first = runs.first().ok_or_else(|| Failure::usage("no recording was given"))?;
    let robot = other.map_or_else(|| first.robot.clone(), |other| first.suited(other));
    let progress = ui.busy("reading");
    let options = Options { without: args.without, ..Options::default() };
    let runs: Vec<&Recording> = runs.iter().collect();
    let diagnosis = diagnose::diagnose(&robot, &runs, holdout.as_ref(), &options, &|step| progress.stage(step))
        .map_err(diagnose_failure)?;
    drop(progress);
    print(ui, &diagnosis);
    let file = args.result.output.as_deref().map_or("DIAG.json".into(), |path| path.to_string_lossy());
    for line in next_motion(&diagnosis, &file) {
        ui.say(line);
    }
    outputs.finish(ui, &diagnosis, || report::diagnosis::page(&diagnosis).to_html())?;
    Ok(exit(diagnosis.verdict))
}

/// The exit code of a verdict.
fn exit(verdict: Verdict) -> Exit {
    match verdict {
        Verdict::None => Exit::Ok,
        Verdict::Named => Exit::Named,
        Verdict::Unknown => Exit::Unknown,
        Verdict::NotSeparable => Exit::NotSeparable,
    }
}

/// The findings for people.
pub(super) fn print(ui: &Ui, diagnosis: &Diagnosis) {
    for line in lines(diagnosis) {
        ui.say(line);
    }
}

/// Lines are broken at this many characters where they can be.
const WIDTH: usize = 100;
const INDENT: &str = "    ";

/// Whether the model fits, causes in their order, what they bring together, what was rejected, what is left.
fn lines(diagnosis: &Diagnosis) -> Vec<String> {
    let names = Names::of(diagnosis);
    let mut lines = Vec::new();
    wrap(&mut lines, "", &diagnosis.base_fit.sentence);
    wrap(&mut lines, "", words::why(diagnosis));
    for (place, finding) in words::in_order(diagnosis).into_iter().enumerate() {
        cause(&mut lines, place + 1, finding, &names);
    }
    together(&mut lines, diagnosis, &names);
    for rejected in &diagnosis.rejected {
        let law = names.law(&rejected.effect, &rejected.axes);
        wrap(&mut lines, "", &format!("rejected: {law}: {}", rejected.why));
    }
    if let Some(left) = words::share(diagnosis.unexplained.excess, None) {
        lines.push(format!("left over that a curve shows: {left} of what the base model left unexplained"));
    }
    for defect in diagnosis.unexplained.places.iter().take(3) {
        let share = words::share(defect.share, None).map_or_else(String::new, |share| format!(": {share}"));
        wrap(&mut lines, INDENT, &format!("{}{share}", names.place(defect)));
    }
    wrap(&mut lines, "", &words::still_missed(diagnosis, &names).unwrap_or_default());
    lines
}

/// What the user can do where this motion leaves a question open.
fn next_motion(diagnosis: &Diagnosis, file: &str) -> Vec<String> {
    let mut lines = Vec::new();
    wrap(&mut lines, "", &words::next_motion(diagnosis, file).unwrap_or_default());
    lines
}

/// One cause: gains, parameters with intervals, what a reader has to know beside the name.
fn cause(lines: &mut Vec<String>, number: usize, finding: &Finding, names: &Names<'_>) {
    lines.push(format!("{number}. {}, {}", names.law(&finding.effect, &finding.axes), finding.effect));
    if let Some(acts_like) = &finding.acts_like {
        wrap(lines, INDENT, acts_like);
    }
    let on_other = finding.holdout_gain.as_ref().and_then(|gain| words::error_change(gain.share, gain.ci95));
    lines.extend(on_other.map(|change| format!("{INDENT}on the other motion: {change}")));
    let unexplained = words::gain(&finding.cv_gain);
    lines.extend(unexplained.map(|share| format!("{INDENT}out of sample: {share} of what was unexplained")));
    for p in &finding.parameters {
        let interval = words::interval_of(p).map_or_else(String::new, |interval| format!("   95 %: {interval}"));
        let name = names.parameter(&finding.effect, &p.name);
        lines.push(format!("{INDENT}{name:<20} {:>24}{interval}", words::estimate(p)));
        let described = names.in_robot_file(&finding.effect, &p.name);
        lines.extend(described.map(|described| format!("{INDENT}{:<20} {described}", "")));
    }
    let flags: Vec<&str> = finding.flags.iter().map(|flag| flag.words()).collect();
    wrap(lines, INDENT, &flags.join("; "));
    if !finding.aliases.is_empty() {
        let others: Vec<String> = finding.aliases.iter().map(|alias| words::title(alias)).collect();
        wrap(lines, INDENT, &format!("this motion cannot tell it from: {}", others.join("; ")));
    }
    if !finding.rivals.is_empty() {
        let weight = |effect: &str, axes: &[usize], weight: f64| {
            format!("{} {}", names.law(effect, axes), significant(weight, 3))
        };
        let rivals = finding.rivals.iter().map(|rival| weight(&rival.effect, &rival.axes, rival.weight));
        let all: Vec<String> =
            std::iter::once(weight(&finding.effect, &finding.axes, finding.weight)).chain(rivals).collect();
        wrap(lines, INDENT, &format!("weights: {}", all.join("; ")));
    }
}

/// What all causes bring together on the other motion.
fn together(lines: &mut Vec<String>, diagnosis: &Diagnosis, names: &Names<'_>) {
    let Some(all) = &diagnosis.holdout_gain else { return };
    if let Some(change) = words::error_change(all.share, all.ci95) {
        wrap(lines, "", &format!("together, on {}: {change}", words::other_motion(diagnosis)));
    }
    for horizon in &all.by_horizon {
        if let Some(change) = words::error_change(horizon.share, horizon.ci95) {
            lines.push(format!("{INDENT}{:>6} ahead: {change}", seconds(horizon.horizon_s)));
        }
    }
    let gains = diagnosis.findings.first().map_or(&[][..], |finding| &finding.gain);
    for gain in gains.iter().filter(|gain| gain.horizon_s == 0.5) {
        let Some(change) = words::error_change(gain.gain, gain.ci95) else { continue };
        let [before, after] = words::in_unit([gain.rmse_base, gain.rmse_extended], names.unit(&gain.channel));
        let channel = names.channel(&gain.channel);
        lines.push(format!("{INDENT}500 ms ahead, {channel:<24} {before} → {after}, {change}"));
    }
}

/// Adds text that is broken between words; further lines are indented by a step more. Nothing of an empty text.
fn wrap(lines: &mut Vec<String>, indent: &str, text: &str) {
    let mut line = String::new();
    let mut is_first = true;
    for word in text.split_whitespace() {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > WIDTH {
            lines.push(std::mem::take(&mut line));
            is_first = false;
        }
        if line.is_empty() {
            line.push_str(indent);
            line.push_str(if is_first { "" } else { "  " });
        } else {
            line.push(' ');
        }
        line.push_str(word);
    }
    if !line.is_empty() {
        lines.push(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::diagnosis::fixture;

    #[test]
    fn the_first_line_says_whether_the_model_fits_and_lines_fit_a_terminal() {
        let text = "of axis one ".repeat(20);
        let diagnosed = fixture::diagnosis(0.7, text.trim());
        let lines = lines(&diagnosed);
        assert!(lines[0].starts_with("The base model does not fit of axis one"), "{lines:#?}");
        assert!(lines.iter().all(|line| line.chars().count() <= 110), "{lines:#?}");
        let place = |start: &str| {
            let found = lines.iter().position(|line| line.starts_with(start));
            found.unwrap_or_else(|| panic!("no line starts with {start}: {lines:#?}"))
        };
        let order = [
            "1. torque ripple of the motors (pitch)",
            "2. friction that differs",
            "together, on",
            "rejected:",
            "left over that a curve shows: 70 %",
        ];
        assert!(order.map(place).is_sorted(), "{lines:#?}");
        assert!(lines.iter().any(|line| line.contains("28 % less error [21, 35]")), "{lines:#?}");
        assert!(!lines_of_nothing().iter().any(|line| line.contains("NaN")));
    }

    fn lines_of_nothing() -> Vec<String> {
        let mut diagnosed = fixture::diagnosis(f64::NAN, "x");
        let mut all = lines(&diagnosed);
        diagnosed.findings.clear();
        diagnosed.holdout_gain = None;
        all.extend(lines(&diagnosed));
        all
    }
}
