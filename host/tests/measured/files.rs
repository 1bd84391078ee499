//! What stories about measured machines share: their folder, and what is looked up in results.
//!
//! The data are read from `REALDATA_DIR`; without it a story says that it was skipped.

use std::path::{Path, PathBuf};

use serde_json::Value;

/// The folder of a machine's data.
pub fn machine(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("REALDATA_DIR").map(|folder| Path::new(&folder).join(name));
    if folder.is_none() {
        eprintln!("\n*** SKIPPED: REALDATA_DIR is not set, the measurements of {name} were not looked at ***\n");
    }
    folder
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
