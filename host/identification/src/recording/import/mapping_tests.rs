//! Tables with other columns, units and separators, as `[import]` of the robot file says.

use std::path::Path;

use super::{Imported, TableError};
use crate::recording::csv::write;
use crate::robot::Robot;

/// The one-joint robot (gear 30, 2048 counts a turn) with a section [import].
fn robot(import: &str) -> Robot {
    let text = Robot::builtin("one_joint").unwrap().toml().to_owned() + "\n" + import;
    Robot::parse(&text).unwrap_or_else(|error| panic!("{error}"))
}

fn refused_robot(import: &str, parts: &[&str]) {
    let text = Robot::builtin("one_joint").unwrap().toml().to_owned() + "\n" + import;
    let error = Robot::parse(&text).unwrap_err().to_string();
    for part in parts {
        assert!(error.contains(part), "`{part}` is not in: {error}");
    }
}

fn parse(bytes: &[u8], robot: &Robot, path: &Path) -> Result<Imported, TableError> {
    super::parse(bytes, robot, path, None)
}

fn read(import: &str, table: &str) -> Result<Imported, TableError> {
    parse(table.as_bytes(), &robot(import), Path::new("data.csv"))
}

const MAPPING: &str = r#"
[import]
time = { column = "Time", unit = "ms", zero = -1.0 }
separator = ";"
decimal = ","
missing = ["NaN"]
[import.columns]
u1 = { column = "PWM", unit = "percent", sign = -1 }
theta1 = { column = "enc", unit = "counts", zero = 100 }
g1x = { column = "wx", unit = "deg/s", scale = 0.5 }
g1y = { column = "wy", unit = "rpm" }
"#;

#[test]
fn names_units_signs_and_gears_are_applied() {
    let text = "\u{feff}Time;Temperature;PWM;enc;wx;wy;g1z\r\n-1,0;20,5;-50;100;2;60;0\r\n0,0;;25,0;1124;NaN;0;0,5\r\n";
    let Imported { recording, ignored, .. } = read(MAPPING, text).unwrap();
    assert_eq!(ignored, ["Temperature"]);
    assert_eq!(recording.t_us, [0, 1000]);
    assert_eq!(recording.duty, [[0.5, -0.25]]);
    let values = |name: &str| recording.channel(name).unwrap().values.clone();
    // Half a turn of the motor, on the link side of a gear of 30.
    let half_turn = std::f64::consts::PI / robot("").joints[0].gear;
    assert_eq!(robot("").joints[0].gear, 30.0);
    assert_eq!(values("theta1")[0], 0.0);
    assert!((values("theta1")[1] - half_turn).abs() < 1e-15, "{:?}", values("theta1"));
    assert!((values("g1x")[0] - 1f64.to_radians()).abs() < 1e-15);
    assert!(values("g1x")[1].is_nan());
    assert!((values("g1y")[0] - std::f64::consts::TAU).abs() < 1e-14);
    assert_eq!(values("g1z"), [0.0, 0.5]);
    // What is exported has the robot's own columns, and comes back under the same robot.
    let own = write(Vec::new(), &recording).unwrap();
    let again = parse(&own, &recording.robot, Path::new("own.csv")).unwrap();
    assert_eq!((&again.recording.t_us, &again.recording.duty), (&recording.t_us, &recording.duty));
    assert!(again.ignored.is_empty());
}

#[test]
fn torques_at_the_motor_are_multiplied_by_the_gear() {
    let text = Robot::builtin("one_joint").unwrap().toml().replace("supply_v", "# supply_v");
    let text = text.replace("unit = \"duty\"", "unit = \"newton_metre\"");
    let has_no_volts = |line: &&str| !line.starts_with("k_pwm") && !line.starts_with("k_mi");
    let text: String = text.lines().filter(has_no_volts).map(|line| line.to_owned() + "\n").collect();
    let mapped = "[import.columns]\nu1 = { column = \"tau\", unit = \"N cm\", side = \"motor\" }\ntheta1 = { unit = \"turn\", side = \"motor\" }\n";
    let robot = Robot::parse(&(text + mapped)).unwrap_or_else(|error| panic!("{error}"));
    let table = "t_s,tau,theta1,g1x,g1y,g1z\n0.000,100,3,0,0,0\n0.001,-200,0,0,0,0\n";
    let recording = parse(table.as_bytes(), &robot, Path::new("data.csv")).unwrap().recording;
    assert_eq!(recording.duty, [[30.0, -60.0]]);
    let position = recording.channel("theta1").unwrap().values[0];
    assert!((position - 0.1 * std::f64::consts::TAU).abs() < 1e-15, "{position}");
}

#[test]
fn what_a_table_lacks_is_named_with_the_robots_name_for_it() {
    let missing = read(MAPPING, "Time;pwm;enc;wx;wy;g1z\n0;0;0;0;0;0\n").unwrap_err();
    let text = format!("{missing} | {}", missing.advice());
    for part in ["`PWM` for u1", "did you mean `pwm`", "import.columns.u1", "Time, pwm, enc"] {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
    let no_time = read(MAPPING, "time;PWM;enc;wx;wy;g1z\n0;0;0;0;0;0\n").unwrap_err();
    assert!(no_time.to_string().contains("`Time` with the time"), "{no_time}");
    let commas = read(MAPPING, "Time,PWM,enc,wx,wy,g1z\n0,0,0,0,0,0\n").unwrap_err();
    assert!(commas.to_string().contains("separated by ','"), "{commas}");
    let early = read(MAPPING, "Time;PWM;enc;wx;wy;g1z\n-2;0;0;0;0;0\n").unwrap_err();
    assert!(early.to_string().contains("`-2` is not a number of milliseconds from -1 on"), "{early}");
}

#[test]
fn a_mapping_that_makes_no_sense_is_refused() {
    let columns = |text: &str| format!("[import.columns]\n{text}\n");
    refused_robot(&columns("tau1 = { column = \"x\" }"), &["tau1", "no such column", "u1, theta1, g1x"]);
    refused_robot(&columns("u1 = { unit = \"V\" }"), &["import.columns.u1.unit", "measures something else", "percent"]);
    refused_robot(&columns("g1x = { unit = \"furlong\" }"), &["not a unit", "deg/s", "scale"]);
    refused_robot(&columns("u1 = { side = \"motor\" }"), &["import.columns.u1.side", "no gear"]);
    refused_robot(&columns("g1x = { side = \"motor\" }"), &["import.columns.g1x.side", "no gear"]);
    refused_robot(&columns("g1x = { unit = \"counts/s\" }"), &["counts_per_turn", "missing"]);
    refused_robot(&columns("theta1 = { counts_per_turn = 5 }"), &["only with unit"]);
    refused_robot(&columns("theta1 = { sign = 0 }"), &["1 or -1"]);
    refused_robot(&columns("theta1 = { scale = 0.0 }"), &["every reading would be zero"]);
    refused_robot(&columns("theta1 = { column = \"g1x\" }"), &["theta1 comes from this column already"]);
    refused_robot(&columns("theta1 = { colunm = \"g1x\" }"), &["colunm", "did you mean `column`"]);
    refused_robot("[import]\ntime = { column = \"t\", unit = \"h\" }\n", &["import.time.unit", "ms"]);
    refused_robot("[import]\nseparator = \"--\"\n", &["import.separator"]);
    refused_robot("[import]\ndecimal = \",\"\n", &["both be told by a comma"]);
    refused_robot("[import]\ntorque_on = \"u1\"\n", &["import.torque_on", "u1 comes from this column already"]);
}

#[test]
fn a_table_in_another_unit_of_time_is_told() {
    let table = |t: &dyn Fn(u32) -> String| {
        let rows: String = (0..200).map(|k| format!("{},0,0,0,0,0\n", t(k))).collect();
        format!("t_us,u1,theta1,g1x,g1y,g1z\n{rows}")
    };
    let milliseconds = read("", &table(&|k| k.to_string())).unwrap_err();
    let text = format!("{milliseconds} | {}", milliseconds.advice());
    assert!(text.contains("look like milliseconds") && text.contains("unit = \"ms\""), "{text}");
    let nanoseconds = read("", &table(&|k| (1_000_000 * k).to_string())).unwrap_err();
    assert!(nanoseconds.to_string().contains("look like nanoseconds"), "{nanoseconds}");
}
