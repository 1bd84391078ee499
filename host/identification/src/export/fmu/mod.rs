//! The model as a Functional Mock-up Unit (FMI 3.0): model exchange and co-simulation by the C that `--c` writes.
//!
//! ```text
//! Program ─▶ C ─┐
//! interface/ ───┼─▶ sources/ ─▶ compiler ─▶ binaries/PLATFORM/ ─┐
//! standard/ ────┘      └───────────────────────────────────────┼─▶ OUT.fmu, a zip
//! Exported ─▶ modelDescription.xml, documentation/ ─────────────┘
//! ```
//! `interface/` is the model-independent half in C: the standard's functions over instances. `standard/` holds the headers of FMI 3.0 as the Modelica
//! Association publishes them, under the 2-Clause BSD License that stands in each.

mod compile;
mod description;
mod sources;
mod unit;

use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::loss::of_programs;
use super::{ExportError, Exported, Loss, Program};
use crate::model::Expression;
use crate::model::expression::{Function, Node};
use compile::{Binary, CompileError};
use sources::Sources;

/// The archive, and what it keeps.
///
/// `compiler` is the command line of a C compiler, to which arguments are appended. An archive without a binary, because there is no compiler or because it
/// fails, is told as a loss and is no error: other tools compile the sources.
///
/// # Errors
/// A model that cannot be written down; an archive that cannot be made.
pub fn fmu(exported: &Exported<'_>, compiler: &str) -> Result<(Vec<u8>, Vec<Loss>), ExportError> {
    let program = Program::of(exported)?;
    let sources = Sources::of(exported, &program);
    let binary = compile::binary(&sources, compiler);
    let losses = losses(exported, &program, &binary);
    let description = description::model_description(exported, &program, &sources, &losses);
    let mut files = vec![
        ("modelDescription.xml".to_owned(), description.into_bytes()),
        ("documentation/index.html".to_owned(), description::page(exported, &losses).into_bytes()),
        ("sources/buildDescription.xml".to_owned(), sources.build_description().into_bytes()),
    ];
    files.extend(sources.files.iter().map(|(name, text)| (format!("sources/{name}"), text.clone().into_bytes())));
    if let Ok(binary) = binary {
        files.push((format!("binaries/{}/{}", binary.platform, binary.name), binary.bytes));
    }
    let archive = archive(&files).map_err(|error| ExportError::Archive { message: error.to_string() })?;
    Ok((archive, losses))
}

/// A zip whose bytes follow from its files: no times, no owners.
fn archive(files: &[(String, Vec<u8>)]) -> zip::result::ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let plain = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, bytes) in files {
        zip.start_file(name.as_str(), plain.unix_permissions(0o644))?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

fn losses(exported: &Exported<'_>, program: &Program, binary: &Result<Binary, CompileError>) -> Vec<Loss> {
    let mut losses = of_programs(exported);
    losses.push(Loss::exact(
        "co-simulation",
        "steps of the estimator, none longer than the sample period; u is held over a communication step",
    ));
    losses.push(Loss::exact("model exchange", "rates, readings and all their derivatives; the tool integrates"));
    if exported.calibration.extensions.iter().any(|id| id == "integrator_error") {
        losses.push(Loss::lost(
            "integrator_error in model exchange",
            "the tool integrates in its own way: use co-simulation",
        ));
    }
    if has_kinks(program) {
        losses.push(Loss::approximate(
            "kinks in model exchange",
            "they are no events: a solver with error control finds them, one of fixed steps errs by a step",
        ));
    }
    losses.push(match binary {
        Ok(Binary { platform, .. }) => Loss::exact("binary", format!("for {platform}; sources for other platforms")),
        Err(error) => Loss::lost("binary", format!("{error}; tools that build FMUs compile the sources")),
    });
    losses
}

/// Whether a law switches by state or input.
fn has_kinks(program: &Program) -> bool {
    let moving = program.sizes.states + program.sizes.inputs;
    let moves = |condition: Expression| {
        let needed = program.needed([condition]);
        needed.into_iter().any(|of| matches!(program.node(of), Node::Variable(place) if (place as usize) < moving))
    };
    let roots = program.rates.iter().chain(&program.readings).copied();
    program.needed(roots).into_iter().any(|of| match program.node(of) {
        Node::WherePositive(condition, ..) | Node::Call(Function::Abs, condition) => moves(condition),
        _ => false,
    })
}
