//! `host check`: is this recording fit for calibration?

use std::path::PathBuf;

use super::{Exit, Failure, ResultArgs, Ui, read_failure};
use crate::calibrate;
use crate::recording::check::{About, Check, Finding};
use crate::recording::{self, Recording, Severity, check};
use crate::report::check_page;

/// Tell whether a recording is fit for calibration, and what to change if not
///
/// Looks at gaps and the loss balance, the window at rest, what each joint does, saturation, timing, units and signs, and
/// foresees which parameters a calibration will be able to tell.
/// Ends with exit code 4 if the recording is unusable.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording
    #[arg(value_name = "RUN.mcap")]
    input: PathBuf,
    #[command(flatten)]
    result: ResultArgs,
}

/// Checks, prints the findings, writes the result.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let outputs = args.result.claim()?;
    let reading = ui.busy("reading");
    let recording = recording::read(&args.input).map_err(read_failure)?;
    reading.stage("checking");
    let mut check = check::check(&recording);
    if check.usable {
        foresee(&recording, &mut check);
    }
    drop(reading);
    ui.say(format_args!("{}: {}", args.input.display(), recording.summary()));
    for finding in &check.findings {
        let channel = finding.channel.as_ref().map_or(String::new(), |channel| format!("{channel}: "));
        ui.say(format_args!("{}: {channel}{}\n    {}", finding.severity.name(), finding.message, finding.advice));
    }
    ui.say(if check.usable { "fit for calibration" } else { "not fit for calibration" });
    outputs.finish(ui, &check, || check_page(&recording, &check).to_html())?;
    Ok(if check.usable { Exit::Ok } else { Exit::Data })
}

/// A parameter whose expected standard error is a larger share of its start value than this is hardly shown by the motion.
const WORST_SHARE: f64 = 0.05;
/// A gyro's bias and rotation have no size of their own: these errors, rad/s and rad, are what a calibration is for.
const WORST_BIAS_RAD_S: f64 = 1e-3;
const WORST_TURN_RAD: f64 = 5e-3;

/// Adds what a calibration will not be able to tell.
fn foresee(recording: &Recording, check: &mut Check) {
    let mut add = |severity, message, advice: &str| {
        check.add(Finding {
            severity,
            about: About::Identifiability,
            channel: None,
            message,
            advice: advice.to_string(),
        });
    };
    let foresight = match calibrate::foresee(&recording.robot, recording) {
        Ok(foresight) => foresight,
        Err(error) => {
            return add(Severity::Error, error.to_string(), "see the other findings, and the robot file");
        }
    };
    for unobservable in foresight.unobservable {
        let names: Vec<_> = unobservable.direction.into_iter().map(|(name, _)| name).collect();
        let message = format!("{} will be given no number: {}", names.join(", "), unobservable.reason);
        add(Severity::Note, message, "nothing to do unless you need it; it is held at its nominal value");
    }
    for p in foresight.parameters {
        let Some(error) = p.std_error else { continue };
        let worst = match p.unit.as_str() {
            "rad" => WORST_TURN_RAD,
            "rad/s" => WORST_BIAS_RAD_S,
            _ => WORST_SHARE * p.start.abs(),
        };
        if error > worst {
            let message = format!("{} is hardly shown: expected ± {error:.2e} {} at {:.4}", p.name, p.unit, p.start);
            let advice = "move the joint more: slow moves with reversals for mu, fast ones and a chirp for k_s and d_s, \
                          large angles of all joints for a gyro's rotation, rest before the motion for its bias";
            add(Severity::Warning, message, advice);
        }
    }
}
