//! A user installs the Python package into an environment of its own and works with it: the same numbers as the binary, errors with advice, robots from
//! other people's files, the notebook.
//!
//! Needs Python 3.10 with `venv`, and PyPI; `PYTHON` names another interpreter. Without them the stories say that they were skipped.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::Instant;

use tests::host;

/// Largest wheel, bytes.
const LARGEST_WHEEL: u64 = 20_000_000;

const CRATE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../host/python");

/// Packages from PyPI that the stories need beside the wheel's own.
const PACKAGES: [&str; 6] = ["numpy", "pandas", "mujoco", "nbclient", "nbformat", "ipykernel"];

/// An environment with the package installed.
struct Environment {
    folder: tempfile::TempDir,
}

impl Environment {
    fn python(&self) -> PathBuf {
        self.folder.path().join("venv/bin/python")
    }

    /// Runs the stories of a file.
    fn tell(&self, file: &str) {
        let path = Path::new(CRATE).join("tests").join(file);
        let output = Command::new(self.python())
            .arg(path)
            .arg("-v")
            .env("FLEXCAL_HOST", host().get_program())
            .current_dir(self.folder.path())
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{file}: {}\n{told}", String::from_utf8_lossy(&output.stdout));
        eprintln!("{told}");
    }
}

/// The environment, made once: the wheel built as a user builds it, and installed. None where there is no Python or no PyPI.
fn environment() -> Option<&'static Environment> {
    static MADE: OnceLock<Option<Environment>> = OnceLock::new();
    MADE.get_or_init(make).as_ref()
}

fn make() -> Option<Environment> {
    let skip = |why: &str| {
        eprintln!("SKIPPED the stories of the Python package: {why}");
        None
    };
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let suits = "import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 10))";
    if !succeeds(Command::new(&python).args(["-c", suits])) {
        return skip(
            "there is no Python 3.10 with venv; PYTHON names an interpreter (Debian: apt-get install python3-venv)",
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for name in ["tools", "venv"] {
        run(Command::new(&python).args(["-m", "venv"]).arg(at(name)));
    }
    let clock = Instant::now();
    let pip = |venv: &str| {
        let mut command = Command::new(at(venv).join("bin/python"));
        command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        command
    };
    if !succeeds(pip("tools").arg("maturin>=1.9,<2")) || !succeeds(pip("venv").args(PACKAGES)) {
        return skip("PyPI does not answer");
    }
    eprintln!("packages from PyPI after {:.0} s", clock.elapsed().as_secs_f64());
    let mut maturin = Command::new(at("tools").join("bin/maturin"));
    maturin.args(["build", "--quiet", "--locked", "--profile", "dev", "--out"]).arg(at("wheels"));
    run(maturin.arg("--interpreter").arg(at("venv").join("bin/python")).current_dir(CRATE));
    let wheel = std::fs::read_dir(at("wheels")).unwrap().next().unwrap().unwrap();
    let (name, bytes) = (wheel.file_name().into_string().unwrap(), wheel.metadata().unwrap().len());
    eprintln!("{name}: {:.1} MB, built after {:.0} s", bytes as f64 * 1e-6, clock.elapsed().as_secs_f64());
    assert!(name.contains("-cp310-abi3-"), "{name} is not for every Python from 3.10 on");
    assert!(bytes <= LARGEST_WHEEL, "{name} has {bytes} bytes, at most {LARGEST_WHEEL} are allowed");
    run(pip("venv").arg(wheel.path()));
    Some(Environment { folder })
}

fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}

fn run(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}:\n{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn numbers_are_those_of_the_binary() {
    environment().inspect(|environment| environment.tell("test_same_numbers.py"));
}

#[test]
fn errors_have_types_and_advice_and_ctrl_c_interrupts() {
    environment().inspect(|environment| environment.tell("test_errors.py"));
}

#[test]
fn robots_come_from_mujoco_and_urdf() {
    environment().inspect(|environment| environment.tell("test_robots.py"));
}

#[test]
fn the_notebook_runs_from_end_to_end() {
    environment().inspect(|environment| environment.tell("test_notebook.py"));
}
