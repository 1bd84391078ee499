//! Good tables, and one test for each way in which a table can be wrong.

use std::io::Write;
use std::path::Path;

use proptest::prelude::*;

use super::read::unpack;
use super::{TableError, parse, write};
use crate::recording::fixture::{any_recording, assert_same_samples, plain};
use crate::recording::{NO_PHASE, Recording};
use crate::robot::Robot;

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
    refused(from(mcap::MAGIC), &["MCAP", "host check"]);
    refused(from(b"PK\x03\x04rest"), &["spreadsheet"]);
    refused(from(b"\xff\xfet\0_\0"), &["UTF-16"]);
    refused(from(b"a\0b"), &["binary"]);
    refused(from(format!("{HEADER}\n1000,0,\u{e4},0,0,0\n").as_bytes()), &["line 2", "not a number"]);
    refused(from(&[HEADER.as_bytes(), b"\n1000,0,\xe4,0,0,0\n"].concat()), &["line 2", "UTF-8"]);
}

#[test]
fn another_rate_is_refused() {
    let rows: String = (0..10).map(|k| format!("{},0,0,0,0,0\n", k * 2000)).collect();
    refused(read(&format!("{HEADER}\n{rows}")), &["2000 µs apart", "1000 µs", "sample_period_s"]);
}
