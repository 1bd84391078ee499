//! `host export`: recordings and calibrated models for other tools.

use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::verify::read_calibration;
use super::{Exit, Failure, NewFile, Ui, read_failure};
use crate::calibrate::Status;
use crate::export::{self, ExportError, Exported, Loss};
use crate::failure::{export_failure, observe_failure};
use crate::observe::Numbers;
use crate::recording::{self, csv};

/// Write a recording or a calibrated model for other tools
///
/// A recording becomes a table. A calibrated model becomes a robot description with the identified values, a program in C or Rust (rates, readings, exact
/// Jacobians, a step), an FMU for simulators, a model for MuJoCo, or a URDF; each of these begins with what it keeps of the model and what it loses. It also becomes an
/// observer's table of numbers.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording, or the calibration
    #[arg(value_name = "RUN.mcap|CAL.json")]
    input: PathBuf,
    #[command(flatten)]
    format: Format,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
}

/// What to write; exactly one.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Format {
    /// Of a recording: a CSV table, numbers in as many digits as they have; `host import` gives the same numbers back
    #[arg(long, value_name = "OUT.csv")]
    csv: Option<PathBuf>,
    /// Of a calibration: a description with the identified values, for the next --robot
    #[arg(long, value_name = "OUT.toml")]
    robot: Option<PathBuf>,
    /// Of a calibration: a Rust module without the standard library, generic over f32 and f64
    #[arg(long, value_name = "OUT.rs")]
    rust: Option<PathBuf>,
    /// Of a calibration: C99, and its header OUT.h beside it; CasADi takes it as an external function
    #[arg(long, value_name = "OUT.c")]
    c: Option<PathBuf>,
    /// Of a calibration: a model for MuJoCo
    #[arg(long, value_name = "OUT.xml")]
    mjcf: Option<PathBuf>,
    /// Of a calibration: chain, bodies and limits, damping and friction
    #[arg(long, value_name = "OUT.urdf")]
    urdf: Option<PathBuf>,
    /// Of a calibration: an FMU of FMI 3.0 for co-simulation and model exchange, compiled for this machine by CC or cc, with its sources for others
    #[arg(long, value_name = "OUT.fmu")]
    fmu: Option<PathBuf>,
    /// Of a calibration: the numbers of an observer, as bytes with a checksum (host/doc/observer.md)
    #[arg(long, value_name = "OUT.bin")]
    observer: Option<PathBuf>,
}

/// A file's text, and what it keeps of the model.
type Written = Result<(String, Vec<Loss>), ExportError>;

/// Writes what was asked for.
pub fn run(args: Args, ui: &Ui) -> Result<Exit, Failure> {
    let (input, force) = (&args.input, args.force);
    let one = |path: &Path, write: fn(&Exported<'_>) -> Written| {
        let file = NewFile::claim(path, force)?;
        write_model(input, ui, |exported| {
            let (text, losses) = write(exported).map_err(export_failure)?;
            file.finish_with(text.as_bytes())?;
            Ok((path.display().to_string(), losses))
        })
    };
    match args.format {
        Format { csv: Some(path), .. } => table(input, &path, force, ui),
        Format { robot: Some(path), .. } => one(&path, export::robot_file),
        Format { rust: Some(path), .. } => one(&path, export::rust),
        Format { mjcf: Some(path), .. } => one(&path, export::mjcf),
        Format { urdf: Some(path), .. } => one(&path, export::urdf),
        Format { c: Some(path), .. } => c(input, &path, force, ui),
        Format { fmu: Some(path), .. } => fmu(input, &path, force, ui),
        Format { observer: Some(path), .. } => observer(input, &path, force, ui),
        _ => Err(Failure::fault("no format was given, and the command line was accepted")),
    }
}

fn table(input: &Path, path: &Path, force: bool, ui: &Ui) -> Result<Exit, Failure> {
    if input.extension().is_some_and(|extension| extension == "json") {
        return Err(Failure::usage(format!("{} is a calibration: --csv writes a recording", input.display()))
            .advice("give the recording, or one of --robot, --rust, --c, --fmu, --mjcf, --urdf, --observer"));
    }
    let file = NewFile::claim(path, force)?;
    let reading = ui.busy("reading");
    let recording = recording::read(input).map_err(read_failure)?;
    reading.stage("writing");
    let file = csv::write(BufWriter::new(file), &recording).map_err(Failure::device)?;
    file.into_inner().map_err(|error| Failure::device(error.into_error()))?.finish()?;
    drop(reading);
    for damage in &recording.damage {
        ui.say(format_args!("{}: {damage}", input.display()));
    }
    ui.say(format_args!("{}: {}", path.display(), recording.summary()));
    Ok(Exit::Ok)
}

/// The code and its header, whichever of the two was named.
fn c(input: &Path, path: &Path, force: bool, ui: &Ui) -> Result<Exit, Failure> {
    let (code, header) = (path.with_extension("c"), path.with_extension("h"));
    let name = header.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| Failure::usage(format!("{} names no file", path.display())))?;
    let (code_file, header_file) = (NewFile::claim(&code, force)?, NewFile::claim(&header, force)?);
    write_model(input, ui, |exported| {
        let (files, losses) = export::c(exported, &name).map_err(export_failure)?;
        header_file.finish_with(files.header.as_bytes())?;
        code_file.finish_with(files.code.as_bytes())?;
        Ok((format!("{}, {}", code.display(), header.display()), losses))
    })
}

/// An archive with what the user's C compiler makes of it.
fn fmu(input: &Path, path: &Path, force: bool, ui: &Ui) -> Result<Exit, Failure> {
    let file = NewFile::claim(path, force)?;
    let compiler = std::env::var("CC").ok().filter(|command| !command.trim().is_empty());
    write_model(input, ui, |exported| {
        let (bytes, losses) = export::fmu(exported, compiler.as_deref().unwrap_or("cc")).map_err(export_failure)?;
        file.finish_with(&bytes)?;
        Ok((path.display().to_string(), losses))
    })
}

/// The table of an observer. Its equations are those of the model; single precision is all that it loses.
fn observer(input: &Path, path: &Path, force: bool, ui: &Ui) -> Result<Exit, Failure> {
    let file = NewFile::claim(path, force)?;
    write_model(input, ui, |exported| {
        let bytes = Numbers::of(exported).and_then(|numbers| numbers.to_bytes()).map_err(observe_failure)?;
        file.finish_with(&bytes)?;
        Ok((format!("{} ({} bytes)", path.display(), bytes.len()), Vec::new()))
    })
}

/// Reads the calibration, writes it by `write`, which gives the names of the files, and says what was lost.
fn write_model(
    input: &Path,
    ui: &Ui,
    write: impl FnOnce(&Exported<'_>) -> Result<(String, Vec<Loss>), Failure>,
) -> Result<Exit, Failure> {
    let calibration = read_calibration(input)?;
    let exported = Exported::of(&calibration).map_err(export_failure)?;
    let writing = ui.busy("writing");
    let (files, losses) = write(&exported)?;
    drop(writing);
    if let Some(warning) = exported.warning() {
        ui.say(format_args!("WARNING: {warning}"));
    }
    for loss in losses {
        ui.say(format_args!("{loss}"));
    }
    ui.say(format_args!("{files}: {} states, {} parameters", exported.states.len(), exported.parameters.len()));
    Ok(match calibration.status {
        Status::DoesNotFit => Exit::Data,
        status if status.is_usable() => Exit::Ok,
        _ => Exit::NoConvergence,
    })
}
