//! The libraries for other programs: what comes along with them.

use std::process::Command;

/// Names of all packages that a library is built from.
fn built_from(library: &str) -> Vec<String> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let arguments = ["tree", "--package", library, "--edges", "normal", "--prefix", "none", "--locked", "--offline"];
    let output = Command::new(cargo).args(arguments).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo tree: {said}");
    let lines = String::from_utf8(output.stdout).unwrap();
    let mut names: Vec<String> =
        lines.lines().filter_map(|line| line.split_whitespace().next()).map(str::to_owned).collect();
    names.sort();
    names.dedup();
    names
}

/// What talks to devices, terminals and the firmware's log, and the tool itself.
const OF_THE_TOOL: [&str; 12] = [
    "clap",
    "console",
    "ctrlc",
    "defmt",
    "defmt-decoder",
    "firmware",
    "host",
    "indicatif",
    "miette",
    "nix",
    "serialport",
    "tracing-subscriber",
];

#[test]
fn the_libraries_come_without_the_tools_dependencies() {
    for library in ["solve", "robot_model", "identification"] {
        let names = built_from(library);
        assert!(names.iter().any(|name| name == library) && names.iter().any(|name| name == "nalgebra"), "{names:?}");
        let tools: Vec<&str> = OF_THE_TOOL.into_iter().filter(|tool| names.iter().any(|name| name == tool)).collect();
        assert!(tools.is_empty(), "{library} needs {tools:?}");
    }
    // The tool has them: the test can see them.
    let tool = built_from("host");
    for name in OF_THE_TOOL.into_iter().filter(|name| *name != "defmt") {
        assert!(tool.iter().any(|found| found == name), "{name} is not one of the tool's: {tool:?}");
    }
}

#[test]
fn each_library_knows_only_those_below_it() {
    let knows = |library: &str, other: &str| built_from(library).iter().any(|name| name == other);
    assert!(!knows("solve", "robot_model") && !knows("solve", "identification"));
    assert!(knows("robot_model", "solve") && !knows("robot_model", "identification"));
    assert!(knows("identification", "robot_model"));
}
