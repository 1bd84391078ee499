//! Typed errors of the rooms below as failures: kind and advice.

use std::fmt::Display;

use super::{Failure, Kind};
use crate::calibrate::CalibrateError;
use crate::diagnose::DiagnoseError;
use crate::effect::EffectError;
use crate::export::ExportError;
use crate::observe::ObserveError;
use crate::recording::ReadError;
use crate::recording::check::Finding;
use crate::recording::import::TableError;
use crate::robot::RobotError;
use crate::simulate::SimulateError;
use crate::verify::VerifyError;

/// A recording that could not be read.
pub fn read_failure(error: ReadError) -> Failure {
    let (kind, advice) = (of(error.is_io()), error.advice());
    Failure::new(kind, error).advice(advice)
}

/// A table that could not be read.
pub fn table_failure(error: TableError) -> Failure {
    let (kind, advice) = (of(error.is_io()), error.advice());
    Failure::new(kind, error).advice(advice)
}

fn of(is_io: bool) -> Kind {
    if is_io { Kind::Device } else { Kind::Data }
}

/// A robot that does not exist, or a description that is refused.
pub fn robot_failure(error: RobotError) -> Failure {
    let (kind, advice) = match &error {
        RobotError::Read { .. } => (Kind::Device, "check the path and that you may read the file"),
        RobotError::UnknownRobot { .. } => {
            (Kind::Usage, "give a built-in name (host robot list) or the path of a description file")
        }
        _ => (Kind::Data, "correct the robot file at that place; `host robot show doggy` prints a whole one"),
    };
    Failure::new(kind, error).advice(advice)
}

/// A file that is not the calibration that it should be; `name` is how the user calls it.
pub fn calibration_failure(name: impl Display, error: &serde_json::Error) -> Failure {
    Failure::data(format!("{name} is not a calibration: {error}"))
        .advice("give the file that `host calibrate … -o CAL.json` wrote")
}

/// A recording from which no conclusion should be drawn; `name` is how the user calls it.
pub fn unfit(name: impl Display, finding: &Finding) -> Failure {
    Failure::data(format!("{name} cannot be used: {}", finding.told())).advice(finding.advice.clone())
}

/// A recording that cannot be calibrated.
pub fn calibrate_failure(error: CalibrateError) -> Failure {
    match error {
        CalibrateError::NoRecording | CalibrateError::NotThePapersRobot => Failure::usage(error),
        CalibrateError::ExtendsThePaper | CalibrateError::Extension(_) => Failure::usage(error),
        CalibrateError::Twice { .. } => {
            Failure::usage(error).advice("a recording counts once: what it says would seem twice as sure as it is")
        }
        CalibrateError::Effect(EffectError::Unsuited { .. }) => Failure::data(error).advice("leave this effect out"),
        CalibrateError::Effect(_) => Failure::usage(error),
        CalibrateError::Solve(_) | CalibrateError::Undetermined => Failure::no_convergence(error)
            .advice("`host check` says whether the recording is fit; look for a wrong unit or a wrong robot file"),
        CalibrateError::TooShort { .. } => Failure::data(error).advice("record the whole calibration motion"),
        CalibrateError::DifferentRobot { .. } => Failure::data(error),
        CalibrateError::DifferentColumns { .. } => {
            Failure::data(error).advice("give the description of the robot that was recorded, or leave --robot out")
        }
        CalibrateError::NoPosition { .. } => {
            Failure::data(error).advice("add the joint's encoder to the robot file and to the recording")
        }
    }
}

/// A recording that cannot be predicted.
pub fn verify_failure(error: VerifyError) -> Failure {
    let failure = Failure::data(error.to_string());
    match error {
        VerifyError::DifferentRobot { .. } | VerifyError::DifferentChannels { .. } => {
            failure.advice("`host calibrate` a recording of this robot first")
        }
        VerifyError::TooShort { .. } => failure.advice("record a whole motion"),
        VerifyError::Torque(_) => failure,
        VerifyError::MissingParameter { .. }
        | VerifyError::Robot(_)
        | VerifyError::Effect(_)
        | VerifyError::Model(_) => {
            failure.advice("the calibration was written by another version or edited: calibrate again")
        }
    }
}

/// A recording that cannot be diagnosed.
pub fn diagnose_failure(error: DiagnoseError) -> Failure {
    match error {
        DiagnoseError::Calibrate(error) => calibrate_failure(error),
        DiagnoseError::Effect(error) => Failure::usage(error).advice("`host effects` prints the catalogue"),
    }
}

/// A calibration or a recording that cannot be observed.
pub fn observe_failure(error: ObserveError) -> Failure {
    match error {
        ObserveError::Recording(error) | ObserveError::Export(ExportError::Calibration(error)) => verify_failure(error),
        error => Failure::data(error.to_string()),
    }
}

/// A robot that cannot be simulated.
pub fn simulate_failure(error: SimulateError) -> Failure {
    match error {
        SimulateError::Robot(error) => robot_failure(error),
        SimulateError::Effect(_) => {
            Failure::usage(error).advice("write effects as backlash, backlash=large or backlash=0.008")
        }
        SimulateError::UnknownOption { .. } | SimulateError::Option { .. } => {
            Failure::usage(error).advice("write a simulated port as sim:seed=3,effect=base_bearing")
        }
        SimulateError::Unsuited { .. } => {
            Failure::data(error).advice("change the description, or simulate another robot")
        }
        SimulateError::Motion { .. } => Failure::data(error).advice("correct the motion file"),
        SimulateError::Flash(_) => {
            Failure::device(error).advice("give another file, or move this one away: a new one is made")
        }
        SimulateError::Port(_) => Failure::device(error).advice("a file in the way of --link must be moved first"),
        SimulateError::Gyro { .. } | SimulateError::Machine { .. } | SimulateError::Died => Failure::fault(error),
    }
}

/// A model that cannot be written.
pub fn export_failure(error: ExportError) -> Failure {
    let failure = Failure::data(error.to_string());
    match error {
        ExportError::Calibration(_) | ExportError::Description { .. } => {
            failure.advice("the calibration was written by another version or edited: calibrate again")
        }
        ExportError::Untraceable | ExportError::Archive { .. } => failure,
    }
}
