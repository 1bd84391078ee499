//! What stories about measured machines share: their folder, the binary, results read as other programs read them.
//!
//! The data are read from `REALDATA_DIR`; without it a story says that it was skipped.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use serde_json::Value;

/// The folder of a machine's data.
pub fn machine(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("REALDATA_DIR").map(|folder| Path::new(&folder).join(name));
    if folder.is_none() {
        eprintln!("\n*** SKIPPED: REALDATA_DIR is not set, the measurements of {name} were not looked at ***\n");
    }
    folder
}

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

/// The entry of this name.
pub fn parameter<'a>(list: &'a Value, name: &str) -> &'a Value {
    list.as_array().unwrap().iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

/// Asserts a range.
#[track_caller]
pub fn within(value: &Value, range: std::ops::RangeInclusive<f64>) {
    let value = value.as_f64().unwrap();
    assert!(range.contains(&value), "{value} is not in {range:?}");
}
