//! The binary run as a process, and its results read as other programs read them.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// What `host` says in `folder` to these arguments; it ends with `code`.
pub fn host(folder: &Path, arguments: &[&str], code: i32) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_host")).current_dir(folder).args(arguments).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    text
}

/// A result.
pub fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}
