//! `host plan`: a motion that shows most.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use super::{Exit, Failure, NewFile, Ui, interrupt, json, read_failure, robot_failure};
use crate::calibrate::{Calibration, Status};
use crate::effect::Effect;
use crate::plan::{self, Belief, Criterion, Plan, PlanError, Settings};
use crate::recording;
use crate::report::plan_page;
use crate::robot::Robot;

/// Plan the motion that shows the parameters, or effects, best
///
/// Chooses moves, chirps and sines within the robot's limits, the firmware's watches, a length and a duty budget, by what a calibration or a diagnosis
/// will know after them, on robots drawn from what is known of it. `host record --motion FILE` plays the result. The same seed gives the same
/// file, unless a time limit or Ctrl-C ended the search.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A built-in robot, its description file, or a calibration or diagnosis of it (CAL.json, DIAG.json), which is less uncertain
    #[arg(value_name = "ROBOT|CAL.json|DIAG.json")]
    robot: String,
    /// What the motion is to show: the parameters, or an effect of the catalogue. Can be given several times: the parameters then have half of
    /// the weight [default: parameters]
    #[arg(long = "for", value_name = "parameters|EFFECT")]
    goals: Vec<String>,
    /// Effects of the catalogue that it is to tell from one another, as backlash,belt_hysteresis
    #[arg(long, value_name = "A,B…", value_delimiter = ',')]
    separate: Vec<String>,
    /// The motion file to make
    #[arg(short, long, value_name = "MOTION.toml")]
    output: PathBuf,
    /// Recordings of this robot: the motion adds to what they tell already
    #[arg(long, value_name = "RUN.mcap", num_args = 1..)]
    after: Vec<PathBuf>,
    /// Longest motion, s [default: as long as the preset calibration motion]
    #[arg(long, value_name = "SECONDS", value_parser = length)]
    length: Option<f64>,
    /// Highest root mean square of a joint's duty over the motion, a fraction of full [default: that of the preset]
    #[arg(long, value_name = "FRACTION", value_parser = fraction)]
    duty: Option<f64>,
    /// What the motion is chosen by
    #[arg(long, value_enum, default_value_t = Criterion::A)]
    criterion: Criterion,
    /// Rounds in which motions like the best so far are tried
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(..=1000))]
    rounds: u16,
    /// Ends the search after so many seconds with the best so far
    #[arg(long, value_name = "SECONDS", value_parser = length)]
    time_limit: Option<f64>,
    /// Decides what is tried
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Print what is expected as JSON to stdout
    #[arg(long)]
    json: bool,
    /// Write one self-contained page
    #[arg(long, value_name = "OUT.html")]
    report: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
}

/// The goal that is no effect.
const PARAMETERS: &str = "parameters";

fn length(text: &str) -> Result<f64, &'static str> {
    text.parse().ok().filter(|s: &f64| s.is_finite() && *s > 0.0).ok_or("a number of seconds above 0")
}

fn fraction(text: &str) -> Result<f64, &'static str> {
    text.parse().ok().filter(|part: &f64| *part > 0.0 && *part <= 1.0).ok_or("a number above 0, up to 1")
}

/// Plans, says what is gained, writes the motion.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let (parameters, effects) = goals(&args)?;
    let file = NewFile::claim(&args.output, args.force)?;
    let page = args.report.as_deref().map(|path| NewFile::claim(path, args.force)).transpose()?;
    let mut belief = belief(&args.robot)?;
    for path in &args.after {
        belief = belief.after(recording::read(path).map_err(read_failure)?).map_err(plan_failure)?;
    }
    let settings = Settings {
        seed: args.seed,
        length_s: args.length,
        duty_rms: args.duty,
        criterion: args.criterion,
        parameters,
        effects,
        rounds: args.rounds.into(),
        ..Settings::default()
    };
    let over = Arc::new(AtomicBool::new(false));
    let heard = Arc::clone(&over);
    interrupt::instead(move || {
        // A second time, nobody wants to wait for the best so far.
        if heard.swap(true, Relaxed) {
            interrupt::leave(interrupt::INTERRUPTED);
        }
    });
    let until = args.time_limit.map(|s| Instant::now() + Duration::from_secs_f64(s));
    let go_on = || !over.load(Relaxed) && until.is_none_or(|until| Instant::now() < until);
    let busy = ui.busy("planning");
    let planned = plan::plan(
        &belief,
        &settings,
        &|now| {
            busy.stage(now.stage);
            busy.note(now.error_ratio.map_or(String::new(), |ratio| format!("errors {ratio:.2} of the preset's")));
        },
        &go_on,
    );
    drop(busy);
    let plan = planned.map_err(plan_failure)?;
    say(&plan, ui);
    file.finish_with(plan.motion_toml.as_bytes())?;
    if let Some(page) = page {
        ui.say(format_args!("report: {}", page.path().display()));
        page.finish_with(plan_page(&plan).to_html().as_bytes())?;
    }
    if args.json {
        ui.print(&json(&plan)?)?;
    }
    ui.say(format_args!(
        "motion: {0}; play it with: host record --port PORT --motion {0} -o RUN.mcap",
        args.output.display()
    ));
    Ok(Exit::Ok)
}

/// Whether the motion is to show the parameters, and the effects that it is to show.
fn goals(args: &Args) -> Result<(bool, Vec<&'static Effect>), Failure> {
    if args.separate.len() == 1 {
        return Err(Failure::usage("--separate was given one effect").advice("name two or more, as --separate A,B"));
    }
    let is_parameters = |goal: &&String| goal.as_str() == PARAMETERS;
    let ids = args.goals.iter().filter(|goal| !is_parameters(goal)).chain(&args.separate);
    let effects: Vec<&Effect> = ids
        .map(|id| Effect::by_id(id))
        .collect::<Result<_, _>>()
        .map_err(|error| Failure::usage(error).advice("give --for parameters, or ids that `host effects` lists"))?;
    Ok((effects.is_empty() || args.goals.iter().any(|goal| is_parameters(&goal)), effects))
}

/// What is known of the robot of this name or file.
fn belief(name_or_path: &str) -> Result<Belief, Failure> {
    if !name_or_path.ends_with(".json") {
        return Robot::load(name_or_path).map(Belief::of_description).map_err(robot_failure);
    }
    let text = std::fs::read_to_string(name_or_path).map_err(|error| {
        Failure::device(format!("cannot read {name_or_path}: {error}"))
            .advice("give a built-in robot, a description file, or a result of `host calibrate -o`")
    })?;
    let (calibration, is_diagnosed) = calibration(&text).map_err(|error| {
        Failure::data(format!("{name_or_path} is not a calibration: {error}"))
            .advice("give a result of `host calibrate -o`, or of `host diagnose -o`")
    })?;
    // The base model of a diagnosis need not fit: what it lacks is what the motion is to show.
    let is_usable = calibration.status.is_usable() || is_diagnosed && calibration.status == Status::DoesNotFit;
    if !is_usable {
        return Err(Failure::data(format!("{name_or_path} is a calibration that did not end well"))
            .advice("plan from the robot's description instead"));
    }
    let robot = Robot::parse(&calibration.robot_toml).map_err(robot_failure)?;
    Ok(Belief::of_calibration(robot, &calibration))
}

/// The calibration of a result, or that of the base model in a diagnosis, and whether it is one.
fn calibration(text: &str) -> serde_json::Result<(Calibration, bool)> {
    #[derive(serde::Deserialize)]
    struct Diagnosed {
        base: Calibration,
    }
    match serde_json::from_str(text) {
        Ok(calibration) => Ok((calibration, false)),
        Err(error) => serde_json::from_str(text).map(|Diagnosed { base }| (base, true)).map_err(|_| error),
    }
}

fn say(plan: &Plan, ui: &Ui) {
    ui.say(format_args!(
        "{:.1} s in {} segments, the preset {:.1} s; {} blocks tried, the whole motion on {} robots",
        plan.duration_s, plan.segments, plan.preset_duration_s, plan.blocks_tried, plan.robots
    ));
    if plan.is_preset {
        ui.say("nothing better than the preset calibration motion was found: it is the plan");
    } else {
        ui.say(format_args!(
            "expected errors {:.2} of the preset's, {:.2} on the worst of the robots that it may be",
            plan.error_ratio, plan.worst_error_ratio
        ));
    }
    for p in &plan.sizes {
        let seen = |error: Option<f64>| {
            error.map_or("not seen".to_owned(), |error| format!("{:.1} standard errors", (p.value / error).abs()))
        };
        let ratio = p.ratio.map_or(f64::NAN, |ratio| ratio.powi(-2));
        ui.say(format_args!(
            "  {:<28} typically {:.3e} {}, {} (preset {}): information × {ratio:.2}",
            p.name,
            p.value,
            p.unit,
            seen(p.std_error),
            seen(p.preset_std_error),
        ));
    }
    for p in &plan.parameters {
        let told = |error: Option<f64>| error.map_or("not determined".to_owned(), |error| format!("± {error:.2e}"));
        let ratio = p.ratio.map_or(String::new(), |ratio| format!(", {ratio:.2} of the preset's"));
        ui.say(format_args!(
            "  {:<10} {:>10.4} {} (preset {}) {}{ratio}",
            p.name,
            p.value,
            told(p.std_error),
            told(p.preset_std_error),
            p.unit
        ));
    }
    for joint in &plan.joints {
        ui.say(format_args!(
            "  {0}: {2:.2} to {3:.2} {1}, {4:.1} {1}/s, motor {5:.0}, transmission {6:.0}, duty {7:.2} rms",
            joint.joint,
            joint.unit,
            joint.travel[0],
            joint.travel[1],
            joint.speed,
            joint.motor_torque,
            joint.transmission_torque,
            joint.duty_rms
        ));
    }
    if !plan.complete {
        ui.warn(
            "the search was ended early",
            "the same seed may give another motion; without a limit it gives the same one",
        );
    }
}

fn plan_failure(error: PlanError) -> Failure {
    let advice = error.advice();
    match &error {
        PlanError::TooShort { .. } | PlanError::Effect(_) | PlanError::NotForPlans { .. } => {
            Failure::usage(error).advice(advice)
        }
        PlanError::NoTime => Failure::no_convergence(error).advice(advice),
        _ => Failure::data(error).advice(advice),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::diagnosis::fixture;

    #[test]
    fn a_diagnosis_is_taken_by_its_base_model_and_a_calibration_as_it_is() {
        let diagnosis = fixture::diagnosis(0.7, "x");
        let (base, is_diagnosed) = calibration(&serde_json::to_string(&diagnosis).unwrap()).unwrap();
        assert!(is_diagnosed && base == diagnosis.base);
        let (same, is_diagnosed) = calibration(&serde_json::to_string(&base).unwrap()).unwrap();
        assert!(!is_diagnosed && same == base);
        assert!(calibration("{}").unwrap_err().to_string().contains("missing field"));
    }
}
