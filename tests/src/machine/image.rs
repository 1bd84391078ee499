//! The images: the firmware for the Cortex-M4F, with the real board and with the emulated one.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const TARGET: &str = "thumbv7em-none-eabihf";

/// Whose image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The STM32F405 board's.
    F405,
    /// The emulated board's.
    Emulated,
}

/// Builds the image of the emulated board and gives its path.
///
/// # Panics
/// If it cannot be built.
pub fn image() -> &'static Path {
    image_of(Kind::Emulated)
}

/// Builds an image and gives its path. The emulated one lies in a folder of its own, so that the one to be flashed stays
/// where it is.
///
/// # Panics
/// If it cannot be built.
pub fn image_of(kind: Kind) -> &'static Path {
    static F405: OnceLock<PathBuf> = OnceLock::new();
    static EMULATED: OnceLock<PathBuf> = OnceLock::new();
    let (place, folder, features): (_, _, &[&str]) = match kind {
        Kind::F405 => (&F405, "target", &[]),
        Kind::Emulated => (&EMULATED, "target/emulated", &["--features", "emulated"]),
    };
    place.get_or_init(|| {
        let arguments = [&["-p", "firmware", "--bin", "firmware"], features].concat();
        built(folder, &arguments, None).join("firmware")
    })
}

/// Builds the image of the observer with the numbers of this Rust file and gives its path.
///
/// # Panics
/// If it cannot be built.
pub fn observer_image(numbers: &Path) -> PathBuf {
    let arguments = ["-p", "observer", "--example", "on_chip"];
    built("target/emulated", &arguments, Some(("OBSERVER_NUMBERS", numbers))).join("examples/on_chip")
}

/// Builds for the chip into this folder of the workspace, and gives where images are.
fn built(folder: &str, arguments: &[&str], variable: Option<(&str, &Path)>) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
    let folder = root.join(folder);
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--locked", "--release"])
        .args(arguments)
        .args(["--target", TARGET, "--target-dir"])
        .arg(&folder)
        .envs(variable)
        .current_dir(root)
        .output()
        .expect("cargo runs the tests, so it can be started");
    assert!(
        built.status.success(),
        "the image of {arguments:?} was not built (is the target there? rustup target add {TARGET}):\n{}",
        String::from_utf8_lossy(&built.stderr)
    );
    folder.join(TARGET).join("release")
}
