//! What users give by mistake: each ends with the cause, what to do and the exit code of its kind, and without a result.

use std::io::Write;
use std::path::{Path, PathBuf};

use host::recording::csv;
use host::robot::Robot;
use host::simulate::{Direct, Options, SHORT_MOTION};
use tempfile::TempDir;
use tests::{host_succeeds, run_host};

const DEGREES: f64 = 180.0 / std::f64::consts::PI;
const GEAR: f64 = 42.092;
const UNUSABLE: i32 = 4;

/// A good table, and a folder to spoil it in.
struct Bench {
    folder: TempDir,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Bench {
    fn new() -> Self {
        let options = Options { seed: 5, ..Options::new(Robot::builtin("doggy").unwrap()) };
        let recording = Direct::record(&options, SHORT_MOTION).unwrap().recording;
        let text = String::from_utf8(csv::write(Vec::new(), &recording).unwrap()).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let header = lines.next().unwrap();
        Self { folder: tempfile::tempdir().unwrap(), header, rows: lines.collect() }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self) -> String {
        self.with(|_, _| {})
    }

    /// The table with every row changed; the row comes with its number.
    fn with(&self, change: impl Fn(usize, &mut Row<'_>)) -> String {
        let mut text = self.header.join(",") + "\n";
        for (k, row) in self.rows.iter().enumerate() {
            let mut row = Row { header: &self.header, fields: row.clone(), left_out: false };
            change(k, &mut row);
            if !row.left_out {
                text += &(row.fields.join(",") + "\n");
            }
        }
        text
    }

    /// Imports the bytes; they must be refused with these words, and leave no recording.
    fn refused(&self, what: &str, bytes: impl AsRef<[u8]>, code: i32, parts: &[&str]) {
        let (table, run) = (self.file("data.csv"), self.file("run.mcap"));
        std::fs::write(&table, bytes).unwrap();
        said(what, &[Path::new("import"), &table, Path::new("-o"), &run], code, parts);
        assert!(!run.exists(), "{what}: there is a recording");
    }

    /// Imports a table that can be read and is wrong: that is said at once, and no result is drawn from it.
    fn useless(&self, what: &str, text: impl AsRef<[u8]>, parts: &[&str]) {
        let (table, run) = (self.file("data.csv"), self.file("useless.mcap"));
        std::fs::write(&table, text).unwrap();
        let import = [Path::new("import"), &table, Path::new("-o"), &run, Path::new("--force")];
        said(what, &import, 0, parts);
        said(what, &import, 0, &["will be refused"]);
        said(what, &[Path::new("check"), &run], UNUSABLE, parts);
        let result = self.file("useless.json");
        said(what, &[Path::new("calibrate"), &run, Path::new("-o"), &result], UNUSABLE, parts);
        assert!(!result.exists(), "{what}: there is a result");
    }
}

struct Row<'a> {
    header: &'a [String],
    fields: Vec<String>,
    left_out: bool,
}

impl Row<'_> {
    fn field(&mut self, column: &str) -> &mut String {
        let index = self.header.iter().position(|name| name == column).unwrap();
        &mut self.fields[index]
    }

    fn scale(&mut self, columns: &[&str], factor: f64) {
        for column in columns {
            let field = self.field(column);
            *field = (field.parse::<f64>().unwrap() * factor).to_string();
        }
    }

    fn swap(&mut self, a: &str, b: &str) {
        let left = self.field(a).clone();
        let right = std::mem::replace(self.field(b), left);
        *self.field(a) = right;
    }
}

/// Runs `host`; it must end with this code and say these words, and no panic.
fn said(what: &str, arguments: &[&Path], code: i32, parts: &[&str]) {
    let output = run_host(arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{what} ended with {}:\n{text}", output.status);
    assert!(!text.contains("panicked"), "{what}:\n{text}");
    for part in parts {
        assert!(text.contains(part), "{what}: `{part}` is not in:\n{text}");
    }
}

/// Rest and a slow sine of a robot with one joint.
const ONE_JOINT_MOTION: &str = r#"
name = "sine"
stages = ["rest", "slow"]
gain = [3.0]

[[segments]]
stage = 0
action.zero = { duration_ms = 3000 }

[[segments]]
stage = 1
action.sine = { joints = [1], amplitude = 0.25, frequency_hz = 0.35, spread = 0.0, ceiling = 0.15, duration_ms = 5000 }
"#;

const ENCODERS: [&str; 3] = ["theta1", "theta2", "theta3"];
const GYROS: [&str; 6] = ["g1x", "g1y", "g1z", "g2x", "g2y", "g2z"];

#[test]
fn tables_with_wrong_units_signs_and_columns_are_refused_by_name() {
    let bench = Bench::new();
    type Change = fn(usize, &mut Row<'_>);
    let cases: [(&str, Change, &[&str]); 12] = [
        ("degrees", |_, r| r.scale(&ENCODERS, DEGREES), &["encoder1", "looks like degrees", "divide by 57.29578"]),
        ("counts", |_, r| r.scale(&ENCODERS, 1024.0 * GEAR / std::f64::consts::TAU), &["looks like encoder counts"]),
        ("no gear", |_, r| r.scale(&ENCODERS, GEAR), &["motor's side of the gear", "divide by the gear ratio 42.092"]),
        ("gear twice", |_, r| r.scale(&ENCODERS, 1.0 / GEAR), &["as if the gear had been applied twice"]),
        ("sign of u", |_, r| r.scale(&["u2"], -1.0), &["pitch runs against its input", "sign = -1"]),
        ("gyro in deg/s", |_, r| r.scale(&GYROS, DEGREES), &["it looks like degrees per second"]),
        ("swapped encoders", |_, r| r.swap("theta2", "theta3"), &["theta2 and theta3 look swapped"]),
        ("swapped inputs", |_, r| r.swap("u1", "u3"), &["yaw follows u3", "look swapped"]),
        ("swapped gyro axes", |_, r| r.swap("g2x", "g2y"), &["gyro2", "look like (y, x, z)"]),
        ("constant encoder", |_, r| *r.field("theta1") = "0.25".into(), &["encoder1", "0.25 rad in every sample"]),
        ("constant gyro", |_, r| *r.field("g1z") = "0".into(), &["gyro1.z", "in every sample", "connected?"]),
        ("no gyro", |_, r| r.field("g2z").clear(), &["gyro2.z", "(100.00 %) have no valid reading"]),
    ];
    for (what, change, parts) in cases {
        bench.useless(what, bench.with(change), parts);
    }

    let (table, run) = (bench.file("data.csv"), bench.file("run.mcap"));
    std::fs::write(&table, bench.with(|_, row| row.scale(&["u2"], -1.0))).unwrap();
    host_succeeds([Path::new("import"), &table, Path::new("-o"), &run]);
    said("check", &[Path::new("check"), &run], UNUSABLE, &["pitch runs against its input", "not fit for calibration"]);
    for verb in ["calibrate", "diagnose"] {
        let result = bench.file("result.json");
        said(
            verb,
            &[Path::new(verb), &run, Path::new("-o"), &result],
            UNUSABLE,
            &["pitch runs against", "--unchecked"],
        );
        assert!(!result.exists(), "{verb} left a result");
    }
}

#[test]
fn tables_with_broken_times_and_numbers_are_refused_with_their_line() {
    let bench = Bench::new();
    let time = |row: &mut Row<'_>, of: &dyn Fn(u64) -> String| {
        let t_us = row.field("t_us").parse().unwrap();
        *row.field("t_us") = of(t_us);
    };
    let at_100 = |column: &'static str, value: &'static str| {
        bench.with(|k, row| {
            if k == 100 {
                *row.field(column) = value.to_owned()
            }
        })
    };
    let refused = |what, text: String, parts: &[&str]| bench.refused(what, text, UNUSABLE, parts);
    refused("milliseconds", bench.with(|_, row| time(row, &|t| (t / 1000).to_string())), &["look like milliseconds"]);
    refused("nanoseconds", bench.with(|_, row| time(row, &|t| (t * 1000).to_string())), &["look like nanoseconds"]);
    refused(
        "seconds",
        bench.with(|_, row| time(row, &|t| (t as f64 * 1e-6).to_string())),
        &["line 3", "`t_us`", "t_s"],
    );
    refused("negative", at_100("t_us", "-100"), &["line 102", "`-100`", "from 0 on"]);
    refused("twice", at_100("t_us", "99000"), &["line 102", "stands in line 101 already"]);
    refused("backwards", at_100("t_us", "500"), &["line 102", "before the 99000 µs of line 101", "sort"]);
    refused(
        "another unit",
        bench.with(|_, row| time(row, &|t| (t * 40).to_string())),
        &["40000 µs apart", "sample_period_s"],
    );
    // Another rate, and two by turns, are taken as they are stamped.
    let slower = bench.with(|k, row| row.left_out = k > 15_000 && k % 5 != 0);
    for (what, text, says) in [
        (
            "another rate",
            bench.with(|_, row| time(row, &|t| (t * 4).to_string())),
            "rows are 4000.0 µs apart (the robot file says 1000.0 µs)",
        ),
        ("two rates", slower, "rows are 1000 to 5000 µs apart"),
    ] {
        let (table, run) = (bench.file("rate.csv"), bench.file("rate.mcap"));
        std::fs::write(&table, text).unwrap();
        said(what, &[Path::new("import"), &table, Path::new("-o"), &run, Path::new("--force")], 0, &[says]);
    }
    refused("a date", at_100("t_us", "2024-05-01T12:00:00"), &["line 102", "is a date", "microseconds"]);
    refused(
        "a second header",
        bench.text().replace("\n100000,", &format!("\n{}\n100000,", bench.text().lines().next().unwrap())),
        &["the header stands here again"],
    );
    refused("NaN", at_100("g1x", "NaN"), &["line 102", "`g1x`", "NaN", "leave the field empty"]);
    refused("infinite", at_100("theta2", "1e999"), &["line 102", "`theta2`", "not a finite number"]);
    bench.useless("huge angle", at_100("theta2", "1e30"), &["encoder2", "no positions (up to 1.000e30"]);
    bench.useless("huge rate", at_100("g1x", "1e30"), &["gyro1.x", "no rates (up to 1.000e30"]);
    refused("percent", bench.with(|_, row| row.scale(&["u1"], 100.0)), &["`u1`", "outside of -1 … 1", "percent"]);
    refused("words", at_100("g2y", "fast"), &["line 102", "`g2y`", "`fast` is not a number"]);
    refused("a field too few", at_100("g2z", "0").replacen(",0\n", "\n", 1), &["fields where the header has 13"]);
}

#[test]
fn files_that_are_no_tables_of_this_robot_are_refused() {
    let bench = Bench::new();
    let text = bench.text();
    let header = text.lines().next().unwrap();
    let refused = |what, bytes: &[u8], parts: &[&str]| bench.refused(what, bytes, UNUSABLE, parts);
    refused("empty", b"", &["no line"]);
    refused("header only", format!("{header}\n").as_bytes(), &["a header and no row"]);
    refused("no header", text.split_once('\n').unwrap().1.as_bytes(), &["there is no header", "t_us,u1,u2,u3,theta1"]);
    refused("semicolons", text.replace(',', ";").as_bytes(), &["separated by ';'", "separator = \";\""]);
    refused("decimal commas", text.replace('.', ",").as_bytes(), &["line 2", "decimal comma?"]);
    refused(
        "missing column",
        text.replace("g2z", "temperature").as_bytes(),
        &["unknown column `temperature`", "[import]"],
    );
    refused("another robot's", b"t_us,u1,theta1,g1x,g1y,g1z\n0,0,0,0,0,0\n", &["`u2`, `u3`", "`doggy`", "--robot"]);
    refused("MCAP", b"\x89MCAP0\r\n", &["no sensor_msgs/msg/JointState message"]);
    refused("spreadsheet", b"PK\x03\x04....", &["spreadsheet", "save"]);
    let utf16: Vec<u8> = "t_us,u1".encode_utf16().flat_map(u16::to_le_bytes).collect();
    refused("UTF-16", &[&[0xff, 0xfe][..], &utf16].concat(), &["UTF-16", "UTF-8"]);
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(text.as_bytes()).unwrap();
    let packed = packer.finish().unwrap();
    refused("cut-off gzip", &packed[..packed.len() / 2], &["damaged or cut off", "gzip -t"]);

    let (table, run) = (bench.file("good.csv"), bench.file("good.mcap"));
    let import = |table: &Path, run: &Path| [Path::new("import"), table, Path::new("-o"), run].map(Path::to_owned);
    let said = |what: &str, arguments: &[PathBuf], code: i32, parts: &[&str]| {
        let arguments: Vec<&Path> = arguments.iter().map(PathBuf::as_path).collect();
        said(what, &arguments, code, parts);
    };
    said("no file", &import(&bench.file("none.csv"), &run), 3, &["cannot read", "check the path"]);

    // What spreadsheets add does no harm: the mark of UTF-8, two characters at the end of a line.
    std::fs::write(&table, format!("\u{feff}{}", text.replace('\n', "\r\n"))).unwrap();
    host_succeeds(import(&table, &run));
    said("existing", &import(&table, &run), 2, &["exists already", "--force"]);
    said("no folder", &import(&table, &bench.file("none/run.mcap")), 3, &["cannot write"]);
    let robot = |name: &str| {
        vec!["import".into(), table.clone(), "-o".into(), bench.file("x.mcap"), "--robot".into(), name.into()]
    };
    said("wrong robot", &robot("one_joint"), UNUSABLE, &["unknown column `u2`", "for the robot `one_joint`"]);
    said("no robot", &robot("dogy"), 2, &["did you mean `doggy`"]);
}

#[test]
fn files_that_are_no_recordings_or_results_are_refused() {
    let bench = Bench::new();
    let (table, run) = (bench.file("good.csv"), bench.file("good.mcap"));
    let result = bench.file("result.json");
    let refused = |what: &str, arguments: &[&Path], parts: &[&str]| {
        said(what, arguments, UNUSABLE, parts);
        assert!(!result.exists(), "{what} left a result");
    };
    std::fs::write(&table, bench.text()).unwrap();
    host_succeeds([Path::new("import"), &table, Path::new("-o"), &run]);
    let calibrate = |runs: &[&Path], parts: &[&str], what: &str| {
        let all = [&[Path::new("calibrate")][..], runs, &[Path::new("-o"), &result]].concat();
        refused(what, &all, parts);
    };
    calibrate(&[&table], &["host import"], "a table for a recording");

    let bytes = std::fs::read(&run).unwrap();
    let broken = bench.file("broken.mcap");
    let scrambled: Vec<u8> = bytes.iter().enumerate().map(|(i, b)| if i > 100 { b ^ (i as u8) } else { *b }).collect();
    std::fs::write(&broken, scrambled).unwrap();
    calibrate(&[&broken], &["broken.mcap", "before the first sample"], "a scrambled recording");
    std::fs::write(&broken, &bytes[..2000]).unwrap();
    calibrate(&[&broken], &["broken.mcap"], "a recording cut off before its first sample");

    let short = bench.file("short.mcap");
    let few = bench.with(|k, row| row.left_out = k > 150);
    std::fs::write(&table, few).unwrap();
    host_succeeds([Path::new("import"), &table, Path::new("-o"), &short]);
    calibrate(&[&short], &["151 samples", "at least 200", "record the whole"], "too few samples");

    let still = bench.file("still.mcap");
    std::fs::write(&table, bench.with(|k, row| row.left_out = k >= 2900)).unwrap();
    host_succeeds([Path::new("import"), &table, Path::new("-o"), &still]);
    refused("rest only", &[Path::new("check"), &still], &["the input is zero in the whole recording", "not fit"]);
    calibrate(&[&still], &["zero in the whole recording"], "a robot that never moved");

    let one_joint = Robot::builtin("one_joint").unwrap();
    let other = Direct::record(&Options::new(one_joint), ONE_JOINT_MOTION).unwrap();
    let (other_table, other_run) = (bench.file("other.csv"), bench.file("other.mcap"));
    std::fs::write(&other_table, csv::write(Vec::new(), &other.recording).unwrap()).unwrap();
    let robot = [Path::new("--robot"), Path::new("one_joint")];
    host_succeeds([&[Path::new("import"), &other_table, Path::new("-o"), &other_run][..], &robot].concat());
    calibrate(&[&run, &other_run], &["other.mcap", "doggy"], "recordings of two robots");
    calibrate(
        &[&run, robot[0], robot[1]],
        &["the description of `one_joint` wants u1,theta1"],
        "another robot's description",
    );

    said("a recording twice", &[Path::new("calibrate"), &run, &run], 2, &["good.mcap is given twice", "counts once"]);
    std::fs::write(bench.file("cal.json"), "{\"robot\": \"doggy\"}").unwrap();
    refused(
        "not a result",
        &[Path::new("verify"), &bench.file("cal.json"), &run],
        &["is not a calibration", "host calibrate"],
    );
    std::fs::write(bench.file("robot.toml"), Robot::builtin("doggy").unwrap().toml().replace("gear", "gears")).unwrap();
    calibrate(
        &[&run, robot[0], &bench.file("robot.toml")],
        &["gears", "did you mean `gear`"],
        "a robot file with a typo",
    );
}
