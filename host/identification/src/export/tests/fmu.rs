//! What a C compiler makes of an FMU's sources, driven through the standard's functions, against the model; and what an archive holds.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::path::Path;
use std::process::Command;

use zip::ZipArchive;

use super::compiled::{RTOL, RTOL_SLOPES, STEPS, compare, expected, numbers, run};
use super::fixtures::{calibration, robot};
use crate::calibrate::Status;
use crate::export::{Exported, Kept, Program, fmu};

const DRIVER: &str = include_str!("drive_fmu.c");

/// An archive's files by their names.
fn files(archive: &[u8]) -> BTreeMap<String, Vec<u8>> {
    let mut archive = ZipArchive::new(Cursor::new(archive)).unwrap();
    let mut files = BTreeMap::new();
    for i in 0..archive.len() {
        let mut file = archive.by_index(i).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        let name = file.name().unwrap().into_owned();
        files.insert(name, bytes);
    }
    files
}

fn text(files: &BTreeMap<String, Vec<u8>>, name: &str) -> String {
    String::from_utf8(files[name].clone()).unwrap()
}

/// The value of an attribute, where it occurs first.
fn attribute<'t>(text: &'t str, name: &str) -> &'t str {
    text.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next()).unwrap()
}

/// Writes the sources into a folder; the names of those to be compiled are those that the description of the build tells.
fn unpack_sources(files: &BTreeMap<String, Vec<u8>>, folder: &Path) -> Vec<String> {
    for (name, bytes) in files {
        if let Some(name) = name.strip_prefix("sources/") {
            std::fs::write(folder.join(name), bytes).unwrap();
        }
    }
    let build = text(files, "sources/buildDescription.xml");
    build
        .split("<SourceFile")
        .filter(|rest| rest.starts_with(' '))
        .map(|rest| attribute(rest, "name").to_owned())
        .collect()
}

fn is_the_model(name: &str, extensions: &[&str]) {
    let calibration = calibration(&robot(name), extensions);
    let exported = Exported::of(&calibration).unwrap();
    let expected = expected(&exported);
    // `false` compiles nothing: what is tested here is what other tools compile.
    let (archive, _) = fmu(&exported, "false").unwrap();
    let files = files(&archive);
    let folder = tempfile::tempdir().unwrap();
    let units = unpack_sources(&files, folder.path());
    let sizes = Program::of(&exported).unwrap().sizes;
    let points = format!(
        "enum {{ N = {}, M = {}, P = {}, Y = {}, COUNT = {}, SIZE = {}, STEPS = {STEPS} }};\n#define TOKEN \"{}\"\n#define PERIOD {:?}\n\
         static const double points[COUNT * SIZE] = {{ {} }};\n",
        sizes.states,
        sizes.inputs,
        sizes.parameters,
        sizes.readings,
        expected.points.len(),
        expected.points[0].len(),
        attribute(&text(&files, "modelDescription.xml"), "instantiationToken"),
        exported.calibrated.robot().sample_period_s,
        numbers(&expected.points),
    );
    std::fs::write(folder.path().join("points.h"), points).unwrap();
    std::fs::write(folder.path().join("drive_fmu.c"), DRIVER).unwrap();
    run(Command::new("cc")
        .current_dir(folder.path())
        .args([
            "-std=c99",
            "-O1",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-DMODEL_NO_CASADI=1",
            "-o",
            "drive",
            "drive_fmu.c",
        ])
        .args(units)
        .arg("-lm"));
    let output = run(&mut Command::new(folder.path().join("drive")));
    compare(&format!("{name} {extensions:?} as an FMU"), &expected, &output, [RTOL, RTOL_SLOPES]);
}

#[test]
fn sources_of_an_fmu_are_the_model_and_refuse_misuse() {
    is_the_model("doggy", &[]);
    is_the_model("emps", &[]);
    is_the_model("rigid", &["base_bearing"]);
    is_the_model("one_joint", &["gyro_lag", "backlash"]);
}

#[test]
fn an_archive_holds_binary_sources_and_description_or_says_what_is_missing() {
    let mut calibration = calibration(&robot("doggy"), &["integrator_error", "backlash"]);
    let exported = Exported::of(&calibration).unwrap();
    let (archive, losses) = fmu(&exported, "cc").unwrap();
    let of =
        |losses: &[crate::export::Loss], part: &str| losses.iter().find(|loss| loss.part == part).cloned().unwrap();
    let holds = files(&archive);
    let library = format!("binaries/{}-linux/doggy.so", std::env::consts::ARCH);
    if cfg!(target_os = "linux") {
        assert!(holds[&library].starts_with(b"\x7fELF"), "{:?}", holds.keys());
    }
    assert_eq!(of(&losses, "binary").kept, Kept::Exact);
    assert_eq!(of(&losses, "integrator_error in model exchange").kept, Kept::Lost);
    assert_eq!(of(&losses, "kinks in model exchange").kept, Kept::Approximate);
    // The same calibration gives the same bytes.
    assert!(fmu(&exported, "cc").unwrap().0 == archive);

    let description = text(&holds, "modelDescription.xml");
    let variables: Vec<&str> = description.split("<Float64").skip(1).collect();
    for (i, variable) in variables.iter().enumerate() {
        assert_eq!(attribute(variable, "valueReference"), i.to_string());
    }
    let variable = |name: &str| *variables.iter().find(|variable| attribute(variable, "name") == name).unwrap();
    for parameter in &exported.parameters {
        let found = variable(&parameter.name);
        assert_eq!(attribute(found, "start").parse::<f64>().unwrap(), parameter.value);
        assert_eq!(attribute(found, "unit"), parameter.unit);
    }
    assert!(variable("der(x.q2)").contains("unit=\"rad/s\"") && variable("gyro2.z").contains("causality=\"output\""));

    // Without a compiler, or with one that fails, there are sources; it is told.
    for (compiler, said) in
        [("no-such-compiler -O3", "no C compiler: `no-such-compiler -O3`"), ("false", "`false` ended with")]
    {
        let (archive, losses) = fmu(&exported, compiler).unwrap();
        let loss = of(&losses, "binary");
        assert!(loss.kept == Kept::Lost && loss.how.contains(said), "{loss}");
        let holds = files(&archive);
        assert!(holds.keys().all(|name| !name.starts_with("binaries/")) && holds.contains_key("sources/doggy.c"));
        assert!(text(&holds, "modelDescription.xml").contains(said));
    }

    // What must not be trusted says so before anything else; what is not identified is marked.
    calibration.status = Status::DoesNotFit;
    calibration.parameters[2].identifiable = false;
    calibration.parameters[2].std_error = None;
    let name = calibration.parameters[2].name.clone();
    let (archive, _) = fmu(&Exported::of(&calibration).unwrap(), "false").unwrap();
    let description = text(&files(&archive), "modelDescription.xml");
    assert!(description.lines().nth(2).unwrap().contains("WARNING: does_not_fit"));
    assert!(attribute(&description, "description").starts_with("WARNING: does_not_fit"));
    let marked = description.lines().find(|line| line.contains(&format!("name=\"{name}\""))).unwrap();
    assert!(marked.contains("NOT IDENTIFIED"), "{marked}");
}
