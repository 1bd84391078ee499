//! The binary of an FMU for the platform that this program runs on, by the user's own C compiler.

use std::process::Command;

use super::sources::{DEFINITION, Sources};

/// A shared library.
#[derive(Debug)]
pub(super) struct Binary {
    /// The standard's name of the platform: architecture and system.
    pub platform: String,
    /// Its file.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Why there is no binary.
#[derive(Debug, thiserror::Error)]
pub(super) enum CompileError {
    /// The command cannot be started.
    #[error("no C compiler: `{command}` does not start ({source}); install one, or name it in CC, and export again")]
    Missing {
        /// What was tried.
        command: String,
        /// The system's word.
        source: std::io::Error,
    },
    /// It ended with an error.
    #[error("`{command}` ended with {status}: {said}")]
    Failed {
        /// What was run.
        command: String,
        /// How it ended.
        status: std::process::ExitStatus,
        /// The first line of what it said.
        said: String,
    },
    /// Files beside it.
    #[error("a temporary file cannot be written or read ({0})")]
    File(#[from] std::io::Error),
}

/// Strict C99, so that no product and sum are contracted into one operation: results are those of the C files on any machine.
const OPTIONS: [&str; 5] = ["-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"];

/// Compiles the sources in a folder of their own.
pub(super) fn binary(sources: &Sources, compiler: &str) -> Result<Binary, CompileError> {
    let folder = tempfile::tempdir()?;
    for (name, text) in &sources.files {
        std::fs::write(folder.path().join(name), text)?;
    }
    let name = format!("{}{}", sources.identifier, std::env::consts::DLL_SUFFIX);
    let mut words = compiler.split_whitespace();
    let command = words.next().unwrap_or("cc");
    let output = Command::new(command)
        .args(words)
        .args(OPTIONS)
        .arg(format!("-D{DEFINITION}=1"))
        .arg("-o")
        .arg(&name)
        .args(sources.units())
        .arg("-lm")
        .current_dir(folder.path())
        .env("LC_ALL", "C")
        .output()
        .map_err(|source| CompileError::Missing { command: compiler.to_owned(), source })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr).lines().next().unwrap_or("nothing was said").to_owned();
        return Err(CompileError::Failed { command: compiler.to_owned(), status: output.status, said });
    }
    Ok(Binary { platform: platform(), bytes: std::fs::read(folder.path().join(&name))?, name })
}

/// The platform's tuple: `x86_64-linux`, `aarch64-darwin`.
fn platform() -> String {
    let system = match std::env::consts::OS {
        "macos" => "darwin",
        other => other,
    };
    format!("{}-{system}", std::env::consts::ARCH)
}
