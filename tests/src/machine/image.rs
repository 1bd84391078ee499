//! The image: the firmware for the Cortex-M4F, with the emulated board.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const TARGET: &str = "thumbv7em-none-eabihf";

/// Builds the image and gives its path. A folder of its own, so that the image to be flashed stays where it is.
///
/// # Panics
/// If it cannot be built.
pub fn image() -> &'static Path {
    static IMAGE: OnceLock<PathBuf> = OnceLock::new();
    IMAGE.get_or_init(|| {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the workspace");
        let folder = root.join("target/emulated");
        let built = Command::new(env!("CARGO"))
            .args(["build", "--quiet", "--locked", "-p", "firmware", "--bin", "firmware", "--release"])
            .args(["--features", "emulated", "--target", TARGET, "--target-dir"])
            .arg(&folder)
            .current_dir(root)
            .output()
            .expect("cargo runs the tests, so it can be started");
        assert!(
            built.status.success(),
            "the image of the emulated board was not built (is the target there? rustup target add {TARGET}):\n{}",
            String::from_utf8_lossy(&built.stderr)
        );
        folder.join(TARGET).join("release/firmware")
    })
}
