//! The bytes of every message, held against `golden.txt` beside this file.
//!
//! A change of the wire shows here first. If it is meant, raise `PROTOCOL_VERSION` where the schema key cannot see it
//! and write the file anew: `OVERWRITE=1 cargo test -p protocol --test wire`.

use crate::examples;
use protocol::{
    Duty, Flags, GyroAge, Layout, MotionId, Sample,
    hello::SchemaKey,
    message::{MAX_TO_HOST_FRAME, write_report, write_sample, write_to_device},
};
use std::{fmt::Write as _, fs, path::Path};

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut s, b| {
        write!(s, "{b:02x}").unwrap();
        s
    })
}

fn vectors() -> String {
    let mut out = format!("schema    key {}\n", SchemaKey::OURS);
    let mut frame = [0; MAX_TO_HOST_FRAME];
    let mut sample = Sample {
        seq: 70_000,
        t_us: 70_000_250,
        gyros: [[52, 0, -23], [50, -2, -12]],
        gyro_ages: [GyroAge::from_us(313), GyroAge::UNKNOWN],
        motion: MotionId(3),
        phase: 4,
        flags: Flags::ZEROED | Flags::RUNNING | Flags::DUTY_LIMITED,
        execution: 9,
        jitter_us: -2,
        ..Sample::default()
    };
    sample.encoders[..3].copy_from_slice(&[1200, -70_000, 0]);
    sample.duty[..3].copy_from_slice(&[Duty(9000), Duty(-150), Duty::ZERO]);
    let one_joint = Layout::new(1, 2, 0).unwrap();
    for (name, layout) in [("doggy", Layout::DOGGY), ("one_joint", one_joint), ("widest", Layout::WIDEST)] {
        let n = write_sample(&sample, &layout, &mut frame).unwrap();
        writeln!(out, "to_host   sample_{name} {}", hex(&frame[..n])).unwrap();
    }
    for (name, report) in examples::reports() {
        let n = write_report(&report, &mut frame).unwrap();
        writeln!(out, "to_host   {name} {}", hex(&frame[..n])).unwrap();
    }
    for (name, request) in examples::requests() {
        let n = write_to_device(&request, &mut frame).unwrap();
        writeln!(out, "to_device {name} {}", hex(&frame[..n])).unwrap();
    }
    out
}

#[test]
fn the_bytes_of_every_message_are_the_golden_ones() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/wire/golden.txt");
    let now = vectors();
    if std::env::var_os("OVERWRITE").is_some() {
        fs::write(&path, &now).unwrap();
    }
    let golden = fs::read_to_string(&path).unwrap();
    for (now, golden) in now.lines().zip(golden.lines()) {
        assert_eq!(now, golden, "the wire changed");
    }
    assert_eq!(now.lines().count(), golden.lines().count());
}
