//! Good tables, and one test for each way in which a table can be wrong.

use std::io::Write;
use std::path::Path;

use proptest::prelude::*;

use super::table::unpack;
use super::{EmptyInputs, Imported, TableError};
use crate::recording::csv::write;
use crate::recording::fixture::{any_recording, assert_same_samples, plain};
use crate::recording::{NO_PHASE, Recording};
use crate::robot::Robot;

fn parse(bytes: &[u8], robot: &Robot, path: &Path) -> Result<Imported, TableError> {
    super::parse(bytes, robot, path, None)
}

fn read(text: &str) -> Result<Recording, TableError> {
    Ok(parse(text.as_bytes(), &Robot::builtin("one_joint").unwrap(), Path::new("data.csv"))?.recording)
}

const HEADER: &str = "t_us,u1,theta1,g1x,g1y,g1z";

/// Three good rows with one replaced.
fn with_row(row: &str) -> Result<Recording, TableError> {
    read(&format!("# made by hand\n{HEADER}\n1000,0,0,0,0,0\n{row}\n3000,0,0,0,0,0\n"))
}

/// The error's text has the line and what is wrong, and there is advice.
fn refused(result: Result<Recording, TableError>, parts: &[&str]) {
    let error = result.unwrap_err();
    let text = format!("{error} | {}", error.advice());
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
    assert!(!error.advice().is_empty());
    assert!(!error.is_io());
}

proptest! {
    // Nine recordings in ten have their median step elsewhere and are drawn again.
    #![proptest_config(ProptestConfig { max_global_rejects: 100_000, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn samples_come_back_bit_for_bit(mut recording in any_recording()) {
        // A lone step decides the rate, so it must be one period; the others may jitter.
        prop_assume!(median_step_is_one_period(&recording));
        recording.motion = None;
        let text = write(Vec::new(), &recording).unwrap();
        let read = parse(&text, &recording.robot, Path::new("data.csv")).unwrap().recording;
        assert_same_samples(&read, &recording);
        prop_assert!(read.phase.iter().all(|&phase| phase == NO_PHASE));
    }

    #[test]
    fn any_text_is_survived(text in "[-0-9.,eE#\"\n\rtu_s1 ]*", bytes: Vec<u8>) {
        prop_assert!(read(&text).is_err());
        let result = read(&format!("{HEADER}\n{text}"));
        prop_assert!(result.map_or_else(|error| !error.advice().is_empty(), |recording| !recording.is_empty()));
        let _ = parse(&bytes, &Robot::builtin("one_joint").unwrap(), Path::new("data.csv"));
    }
}

fn median_step_is_one_period(recording: &Recording) -> bool {
    let mut steps: Vec<u64> = recording.t_us.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).is_none_or(|step| (990..=1010).contains(step))
}

#[test]
fn a_table_is_read_by_the_names_of_its_columns() {
    let read = read(
        "# a comment\ng1z, u1 ,theta1,t_us,g1x,g1y\n0.3,0.5,1.25,1000,0.1,0.2\n# another\n\n0.6,-0.5,1.5,2000,0.4,0.5\r\n",
    )
    .unwrap();
    assert_eq!(read.t_us, [1000, 2000]);
    assert_eq!(read.duty, [[0.5, -0.5]]);
    let columns: Vec<&[f64]> = read.channels.iter().map(|channel| channel.values.as_slice()).collect();
    assert_eq!(columns, [[1.25, 1.5], [0.1, 0.4], [0.2, 0.5], [0.3, 0.6]]);
}

#[test]
fn a_missing_row_is_a_missing_tick() {
    let read =
        read(&format!("{HEADER}\n1000,0,0,0,0,0\n2004,0,0,0,0,0\n2996,0,0,0,0,0\n6010,0,0,0,0,0\n7000,0,0,0,0,0\n"))
            .unwrap();
    assert_eq!(read.seq, [0, 1, 2, 5, 6]);
    assert_eq!((read.missing_ticks(), read.gaps()), (2, 1));
    assert_eq!(read.segments(), [0..3, 3..5]);
}

#[test]
fn seconds_are_accepted() {
    let read = read("t_s,u1,theta1,g1x,g1y,g1z\n0.1790148,0,0,0,0,0\n0.1800152,0,0,0,0,0\n").unwrap();
    assert_eq!(read.t_us, [179_015, 180_015]); // to the nearest microsecond
}

#[test]
fn an_empty_field_is_a_sensor_without_a_reading() {
    let read = with_row("2000,0,0,,0.5,0").unwrap();
    assert!(read.channel("g1x").unwrap().values[1].is_nan());
    assert_eq!(read.channel("gyro1.y").unwrap().values[1], 0.5);
}

#[test]
fn gzip_is_told_by_its_first_bytes() {
    let recording = plain(500);
    let text = write(Vec::new(), &recording).unwrap();
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(&text).unwrap();
    let packed = packer.finish().unwrap();
    let robot = Robot::builtin("one_joint").unwrap();
    assert_same_samples(&parse(&packed, &robot, Path::new("data.csv.gz")).unwrap().recording, &recording);
    for cut in [2, packed.len() / 2, packed.len() - 1] {
        let error = parse(&packed[..cut], &robot, Path::new("data.csv.gz")).unwrap_err();
        assert!(matches!(error, TableError::Gzip { .. }), "{error}");
    }
}

#[test]
fn a_packed_table_is_unpacked_up_to_a_bound() {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(&[b'#'; 100_000]).unwrap();
    let packed = packer.finish().unwrap();
    assert_eq!(unpack(&packed, 100_000).unwrap().len(), 100_000);
    assert!(matches!(unpack(&packed, 99_999), Err(TableError::TooLarge { max_bytes: 99_999 })));
    // Members one after the other are bounded together.
    let twice = [&packed[..], &packed].concat();
    assert_eq!(unpack(&twice, 200_000).unwrap().len(), 200_000);
    assert!(matches!(unpack(&twice, 150_000), Err(TableError::TooLarge { .. })));
}

#[test]
fn bad_numbers_name_line_and_column() {
    refused(with_row("2000,0,NaN,0,0,0"), &["line 4", "`theta1`", "NaN", "leave the field empty"]);
    refused(with_row("2000,0,0,inf,0,0"), &["line 4", "`g1x`", "inf"]);
    refused(with_row("2000,0,0,-1e999,0,0"), &["line 4", "`g1x`", "finite"]);
    refused(with_row("2000,0,0,0,fast,0"), &["line 4", "`g1y`", "`fast` is not a number"]);
    refused(with_row("2000,nan,0,0,0,0"), &["line 4", "`u1`"]);
    refused(with_row("2000,,0,0,0,0"), &["line 4", "`u1`", "empty"]);
    refused(with_row("2000,35,0,0,0,0"), &["line 4", "`u1`", "35", "percent"]);
}

#[test]
fn bad_times_name_the_lines() {
    refused(with_row("1000,0,0,0,0,0"), &["line 4", "line 3", "already"]);
    refused(with_row("999,0,0,0,0,0"), &["line 4", "before", "line 3"]);
    refused(with_row("2000.5,0,0,0,0,0"), &["line 4", "t_us", "t_s"]);
    refused(with_row("-5,0,0,0,0,0"), &["line 4", "from 0 on"]);
    refused(with_row(",0,0,0,0,0"), &["line 4", "empty"]);
    refused(read("t_s,u1,theta1,g1x,g1y,g1z\n-0.5,0,0,0,0,0\n"), &["line 2", "seconds"]);
}

#[test]
fn bad_rows_name_the_line() {
    refused(with_row("2000,0,0,0,0"), &["line 4", "5 fields where the header has 6", "cut off"]);
    refused(with_row("2000,0,0,0,0,0,0"), &["line 4", "7 fields"]);
    refused(with_row("2000,0,\u{fffd},0,0,0"), &["line 4", "not a number"]);
}

#[test]
fn bad_headers_say_what_the_robot_has() {
    refused(read("t_us,u1,theta1,g1x,g1y\n"), &["line 1", "`g1z` is missing", "one_joint", HEADER, "--robot"]);
    refused(read("t_us,u1,theta1,g1x,g1y,g1z,temperature\n"), &["unknown column `temperature`"]);
    refused(read("t_us,u1,Theta_1,g1x,g1y,g1z\n"), &["did you mean `theta1`"]);
    refused(read("time,u1,theta1,g1x,g1y,g1z\n"), &["did you mean `t_us`"]);
    refused(read("t_us,u1,u1,theta1,g1x,g1y,g1z\n"), &["`u1` is there twice"]);
    refused(read("t_us,t_s,u1,theta1,g1x,g1y,g1z\n"), &["both"]);
    refused(read("t_us;u1;theta1;g1x;g1y;g1z\n"), &["separated by ';'"]);
    refused(read("1000,0,0,0,0,0\n"), &["no header"]);
}

#[test]
fn what_is_no_table_is_named() {
    refused(read(""), &["no line"]);
    refused(read("# only a comment\n\n"), &["no line"]);
    refused(read(&format!("{HEADER}\n# no row\n")), &["a header and no row"]);
    let robot = Robot::builtin("one_joint").unwrap();
    let from = |bytes: &[u8]| Ok(parse(bytes, &robot, Path::new("x"))?.recording);
    let ours = crate::recording::mcap::write(Vec::new(), &plain(3)).unwrap();
    refused(from(&ours), &["a recording of this program", "host check"]);
    refused(from(b"PK\x03\x04rest"), &["spreadsheet"]);
    refused(from(b"SQLite format 3\0rest"), &["SQLite", "ros2 bag convert"]);
    refused(from(b"#ROSBAG V2.0\nrest"), &["ROS 1", "mcap convert"]);
    refused(from(b"\x28\xb5\x2f\xfdrest"), &["zstd -d"]);
    refused(from(b"MATLAB 5.0 MAT-file, rest"), &["MATLAB", "writetable"]);
    refused(from(b"\xff\xfet\0_\0"), &["UTF-16"]);
    refused(from(b"a\0b"), &["binary"]);
    refused(from(format!("{HEADER}\n1000,0,\u{e4},0,0,0\n").as_bytes()), &["line 2", "not a number"]);
    refused(from(&[HEADER.as_bytes(), b"\n1000,0,\xe4,0,0,0\n"].concat()), &["line 2", "UTF-8"]);
}

#[test]
fn words_where_numbers_are_wanted_are_told_by_what_they_are() {
    let dates = "t_s,u1,theta1,g1x,g1y,g1z\n2024-05-01T12:00:00.001,0,0,0,0,0\n";
    refused(read(dates), &["line 2", "`2024-05-01T12:00:00.001` is a date", "total_seconds"]);
    for date in ["2024-05-01 12:00:00", "01.05.2024", "5/1/24 3:00", "12:30:01.5"] {
        refused(with_row(&format!("{date},0,0,0,0,0")), &["line 4", "is a date", "microseconds"]);
    }
    // A number is none, even with a unit or two points.
    refused(with_row("2000us,0,0,0,0,0"), &["`2000us` is not a whole number of microseconds"]);
    refused(with_row(HEADER), &["line 4", "the header stands here again", "two tables"]);
    refused(with_row("us,duty,rad,rad/s,rad/s,rad/s"), &["line 4", "no number in it (`us`", "units", "#"]);
    refused(with_row("2000,0,\"1,5\",0,0,0"), &["line 4", "`theta1`", "`1,5` has a decimal comma", "decimal ="]);
}

/// A table with theta1 at these times, µs.
fn table(rows: impl Iterator<Item = (u64, f64)>) -> String {
    let rows: String = rows.map(|(t_us, theta)| format!("{t_us},{},{theta},0,0,0\n", 0.1)).collect();
    format!("{HEADER}\n{rows}")
}

fn import(text: &str) -> Imported {
    parse(text.as_bytes(), &Robot::builtin("one_joint").unwrap(), Path::new("data.csv")).unwrap()
}

#[test]
fn a_table_has_its_own_rate() {
    let Imported { recording, notes, .. } = import(&table((0..100).map(|k| (2000 * k, 0.0))));
    assert_eq!((recording.period_s, recording.missing_ticks()), (2e-3, 0));
    assert!(notes[0].contains("2000.0 µs apart (the robot file says 1000.0 µs)"), "{notes:?}");
    // A missing row is one of the table's own ticks.
    let Imported { recording, .. } = import(&table((0..100).filter(|k| *k != 50).map(|k| (2000 * k, 0.0))));
    assert_eq!((recording.gaps(), recording.missing_ticks()), (1, 1));
    // And the robot's own rate is not measured anew.
    let Imported { recording, notes, .. } = import(&table((0..100).map(|k| (1001 * k, 0.0))));
    assert_eq!(recording.period_s, 1e-3);
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(recording.session().period_s, None);
    // A factor of 1000 is another unit, one of 20 is not.
    refused(read(&table((0..100).map(|k| (1_000_000 * k, 0.0)))), &["look like nanoseconds", "unit = \"ns\""]);
    assert_eq!(import(&table((0..100).map(|k| (20_000 * k, 0.0)))).recording.period_s, 20e-3);
}

#[test]
fn uneven_stamps_are_used_as_they_are() {
    // A loop of 500 Hz that is logged every 10, 10 and 12 ms.
    let stamps = |count: u64| (0..count).map(|k| 1000 * (10 * k + 2 * (k / 3)));
    let Imported { recording, notes, .. } = import(&table(stamps(300).map(|t| (t, 0.0))));
    assert_eq!((recording.gaps(), recording.missing_ticks()), (0, 0));
    assert!((recording.period_s - 10.66e-3).abs() < 0.02e-3, "{}", recording.period_s);
    assert_eq!(recording.t_us, stamps(300).collect::<Vec<_>>());
    assert!(notes[0].contains("10000 to 12000 µs apart"), "{notes:?}");
    let check = crate::recording::check::check(&recording);
    assert!(
        !check
            .findings
            .iter()
            .any(|f| f.message.contains("ticks a second") && f.severity == crate::recording::Severity::Error)
    );
    // A row that is missing is a gap all the same.
    let rows = stamps(300).enumerate().filter(|(k, _)| *k != 100).map(|(_, t)| (t, 0.0));
    assert_eq!(import(&table(rows)).recording.gaps(), 1);
    // Two rates by turns: each row follows the one before it.
    let mut t_us = 0;
    let rows: Vec<(u64, f64)> = (0..400)
        .map(|k| {
            t_us += if k / 100 % 2 == 0 { 1000 } else { 4000 };
            (t_us, 0.0)
        })
        .collect();
    let Imported { recording, .. } = import(&table(rows.into_iter()));
    // Where it becomes slower, half a window still says that four milliseconds are long.
    assert!(recording.gaps() <= 2, "{} gaps", recording.gaps());
    assert!((2e-3..3e-3).contains(&recording.period_s), "{}", recording.period_s);
}

/// A joint that turns to and fro through two turns and more, 5 ms apart.
fn turning(k: u64) -> f64 {
    9.0 * (0.002 * k as f64).sin() + 1.0
}

/// Its table after `wrap`, at the robot with [import] `columns`.
fn wrapped(columns: &str, wrap: impl Fn(f64) -> f64) -> Result<Imported, TableError> {
    let text = Robot::builtin("one_joint").unwrap().toml().to_owned() + "\n[import.columns]\n" + columns;
    let robot = Robot::parse(&text).unwrap();
    let table = table((0..4000).map(|k| (5000 * k, wrap(turning(k)))));
    parse(table.as_bytes(), &robot, Path::new("data.csv"))
}

#[test]
fn positions_that_wrap_are_unwrapped_where_that_is_certain() {
    const TURN: f64 = std::f64::consts::TAU;
    let degrees = 180.0 / std::f64::consts::PI;
    let gear = 30.0;
    let centred = |x: f64, turn: f64| (x + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
    let counts = 4096.0 / TURN;
    // What the table's column is called, how it wraps, what is said of it; rtol of the steps 1e-9, of counts one count.
    type Wrap<'a> = (&'a str, &'a dyn Fn(f64) -> f64, &'a str, f64);
    let cases: [Wrap<'_>; 6] = [
        ("", &|x| centred(x, TURN), "one turn (6.2832 rad)", 1e-9),
        ("", &|x| x.rem_euclid(TURN), "one turn (6.2832 rad)", 1e-9),
        ("theta1 = { unit = \"deg\" }", &|x| (x * degrees).rem_euclid(360.0), "one turn (6.2832 rad)", 1e-9),
        ("theta1 = { unit = \"turn\" }", &|x| (x / TURN).rem_euclid(1.0), "one turn", 1e-9),
        // The turn of an absolute encoder on the motor.
        ("theta1 = { side = \"motor\" }", &|x| (x * gear).rem_euclid(TURN), "one turn of the motor (0.2094 rad)", 1e-9),
        // A counter of 12 bit that has 4096 counts for a turn of the link: its counts are not those of the motor.
        (
            "theta1 = { unit = \"counts\", side = \"link\", counts_per_turn = 8192 }",
            &|x| centred((2.0 * x * counts).round(), 4096.0),
            "4096 counts, a counter of 12 bit (3.1416 rad)",
            TURN / 8192.0,
        ),
    ];
    for (columns, wrap, says, atol) in cases {
        let Imported { recording, notes, .. } =
            wrapped(columns, wrap).unwrap_or_else(|error| panic!("{columns}: {error}"));
        let told =
            notes.iter().any(|note| note.contains(says) && note.contains("more places") && note.contains("line "));
        assert!(told, "{columns}: {notes:?}");
        let values = &recording.channel("theta1").unwrap().values;
        for k in 1..4000 {
            let step = values[k as usize] - values[k as usize - 1];
            let expected = turning(k) - turning(k - 1);
            assert!((step - expected).abs() <= 1.01 * atol, "{columns}: row {k}: {step}, not {expected}");
        }
        assert!(crate::recording::wrap::find(&recording, &[]).is_empty());
    }
}

#[test]
fn jumps_that_leave_open_where_the_joint_is_are_refused_with_their_rows() {
    const TURN: f64 = std::f64::consts::TAU;
    let refused = |result: Result<Imported, TableError>, parts: &[&str]| {
        let error = result.unwrap_err();
        let text = format!("{error} | {}", error.advice());
        parts.iter().for_each(|part| assert!(text.contains(part), "`{part}` is not in: {text}"));
    };
    let slow = |k: u64| turning(k).rem_euclid(TURN);
    let with = |value: &dyn Fn(u64) -> f64, keep: &dyn Fn(u64) -> bool| {
        let rows = (0..4000).filter(|k| keep(*k)).map(|k| (5000 * k, value(k)));
        parse(table(rows).as_bytes(), &Robot::builtin("one_joint").unwrap(), Path::new("data.csv"))
    };
    // A wheel that turns by 2 rad from sample to sample.
    refused(
        with(&|k| (2.0 * k as f64).rem_euclid(TURN), &|_| true),
        &["`theta1` jumps by one turn", "line ", "quarter of a turn"],
    );
    // At half a turn less it is followed.
    assert!(with(&|k| (1.5 * k as f64).rem_euclid(TURN), &|_| true).is_ok());
    // A reading that was set to zero in mid-file: from 5.5 rad to 0 between lines 2002 and 2003.
    let reset = |k: u64| if k < 2000 { 5.5 * k as f64 / 2000.0 } else { 1e-4 * (k - 2000) as f64 };
    refused(with(&reset, &|_| true), &["between line 2001 and line 2002", "(-5.4973 rad)", "go on as it went before"]);
    // A range that is no turn of anything.
    refused(with(&|k| turning(k).rem_euclid(2.5), &|_| true), &["no turn of this joint", "line "]);
    // Seven of ten rows of a wrapped column are no reason to guess.
    assert!(with(&slow, &|k| k % 10 < 7).is_ok());
    // What moves within a turn, or steps between two counts, is no jump.
    for still in [&|k: u64| (0.01 * k as f64).sin() as _, &|k: u64| 6e-5 * (k % 2) as f64] as [&dyn Fn(u64) -> f64; 2] {
        let Imported { notes, .. } = with(still, &|_| true).unwrap();
        assert!(!notes.iter().any(|note| note.contains("jumps")), "{notes:?}");
    }
}

#[test]
fn rows_of_joined_topics_are_told_and_joined_on_demand() {
    let robot = Robot::builtin("one_joint").unwrap();
    // A command every 2 ms, readings 0.7 ms behind it.
    let rows: String = (0..100)
        .map(|k| format!("{},{},,,,\n{},,{},0,0,0\n", 2000 * k, 0.01 * k as f64, 2000 * k + 700, 1e-3 * k as f64))
        .collect();
    let text = format!("{HEADER}\n{rows}");
    let parse = |how| super::parse(text.as_bytes(), &robot, Path::new("data.csv"), how);
    let error = parse(None).unwrap_err();
    let told = format!("{error} | {}", error.advice());
    for part in
        ["line 3", "100 rows with an input and no reading", "two topics", "--inputs hold", "--inputs interpolate"]
    {
        assert!(told.contains(part), "`{part}` is not in: {told}");
    }
    let held = parse(Some(EmptyInputs::Hold)).unwrap();
    assert_eq!((held.recording.len(), held.recording.t_us[1]), (100, 2700));
    // For 1.3 ms of the two until the next reading the command is the last one, then the next: atol 1e-12, sums of 100 numbers.
    let expected = |k: usize| 0.01 * k as f64 + 0.01 * 0.7 / 2.0;
    assert!((0..99).all(|k| (held.recording.duty[0][k] - expected(k)).abs() < 1e-12), "{:?}", held.recording.duty[0]);
    assert_eq!(held.recording.duty[0][99], 0.99);
    assert!(held.notes[0].contains("held") && held.notes[0].contains("100 rows without a reading"), "{:?}", held.notes);
    // On straight lines, the mean is that of the middle, a millisecond behind the reading.
    let drawn = parse(Some(EmptyInputs::Interpolate)).unwrap();
    let expected = |k: usize| 0.01 * (k as f64 + 1.7 / 2.0);
    assert!((0..98).all(|k| (drawn.recording.duty[0][k] - expected(k)).abs() < 1e-12), "{:?}", drawn.recording.duty[0]);
    // A lone empty input is no second topic, and is filled on demand only.
    let lone = format!("{HEADER}\n0,0.5,0,0,0,0\n1000,,0,0,0,0\n2000,0.7,0,0,0,0\n");
    refused(read(&lone), &["line 3", "`u1`", "empty", "--inputs"]);
    let filled = super::parse(lone.as_bytes(), &robot, Path::new("x"), Some(EmptyInputs::Hold)).unwrap();
    assert_eq!(filled.recording.duty, [[0.5, 0.5, 0.7]]);
}

#[test]
fn rows_with_the_drives_off_are_used_or_left_out() {
    let rows: String =
        (0..100).map(|k| format!("{},0.4,0,0,0,0,{}\n", 1000 * k, i32::from(!(40..60).contains(&k)))).collect();
    let text = format!("{HEADER},on\n{rows}");
    let duty = Robot::builtin("one_joint").unwrap().toml().to_owned() + "\n[import]\ntorque_on = \"on\"\n";
    let parse = |robot: &str| super::parse(text.as_bytes(), &Robot::parse(robot).unwrap(), Path::new("x"), None);
    let Imported { recording, notes, ignored } = parse(&duty).unwrap();
    assert!(notes[0].contains("20 rows (0.02 s) with the drives off are left out") && ignored.is_empty(), "{notes:?}");
    assert_eq!((recording.len(), recording.missing_ticks(), recording.gaps()), (80, 20, 1));
    // Half as many rows stand for as long a time where they come half as often.
    let is_kept = |(k, line): &(usize, &str)| (!(40..60).contains(k) || k % 2 == 0).then_some(format!("{line}\n"));
    let sparse: String = rows.lines().enumerate().filter_map(|row| is_kept(&row)).collect();
    let duty_robot = Robot::parse(&duty).unwrap();
    let read = super::parse(format!("{HEADER},on\n{sparse}").as_bytes(), &duty_robot, Path::new("x"), None).unwrap();
    assert!(read.notes[0].contains("10 rows (0.02 s)"), "{:?}", read.notes);
    // A torque is zero there.
    let torque = duty.replace("supply_v", "# supply_v").replace("unit = \"duty\"", "unit = \"newton_metre\"");
    let has_no_volts = |line: &&str| !line.starts_with("k_pwm") && !line.starts_with("k_mi");
    let torque: String = torque.lines().filter(has_no_volts).map(|line| line.to_owned() + "\n").collect();
    let Imported { recording, notes, .. } = parse(&torque).unwrap();
    assert!(notes[0].contains("off in 20 rows: their inputs are taken as 0"), "{notes:?}");
    assert_eq!((recording.len(), recording.duty[0][39], recording.duty[0][40]), (100, 0.4, 0.0));
}
