//! Recordings for the tests of this room: small, arbitrary, and full of what may go wrong.

use proptest::prelude::*;

use super::{
    Event, Firmware, GyroTime, LogLevel, LogLine, LossBalance, MotionFile, NO_PHASE, Place, Recorder, Recording, Row,
    Session, Severity, Source, Tick,
};
use crate::robot::Robot;

/// `count` samples of the one-joint robot, 1 ms apart, with values that tell where they stand.
pub fn plain(count: usize) -> Recording {
    let robot = Robot::builtin("one_joint").unwrap();
    let width = robot.channels().len();
    let mut recorder = Recorder::new(Session::of(robot));
    for k in 0..count {
        let values: Vec<f64> = (0..width).map(|channel| (channel * count + k) as f64 * 1e-3).collect();
        recorder.push(&row(1_000 * k as u64, k as u64, &[0.1], &values)).unwrap();
    }
    recorder.finish(Source { path: "plain".into(), sha256: String::new() })
}

/// A row without phase or flags.
pub fn row<'a>(t_us: u64, seq: u64, duty: &'a [f64], values: &'a [f64]) -> Row<'a> {
    Row { t_us, seq, phase: NO_PHASE, tick: Tick::default(), duty, values }
}

/// Any recording of a built-in robot: gaps, invalid readings, extreme numbers, with and without session facts.
pub fn any_recording() -> impl Strategy<Value = Recording> {
    let robot = prop::sample::select(Robot::builtin_names().collect::<Vec<_>>());
    (robot, 1..60usize, any::<bool>()).prop_flat_map(|(name, count, from_device)| {
        let robot = Robot::builtin(name).unwrap();
        let (joints, width) = (robot.joints.len(), robot.channels().len());
        let percent_us = (robot.sample_period_s * 1e4) as u64;
        let rows = (
            prop::collection::vec((99 * percent_us..101 * percent_us, 1..4u64), count),
            prop::collection::vec(prop::collection::vec(-1.0..=1.0, joints), count),
            prop::collection::vec(prop::collection::vec(any_value(), width), count),
            prop::collection::vec((any::<u8>(), any::<u16>(), 0.0..1e3, -1e3..1e3), count),
        );
        let events = prop::collection::vec((any_severity(), ".*"), 0..4);
        let log = prop::collection::vec(any_log_line(), 0..4);
        (Just((robot, from_device)), rows, events, log, any::<[u64; 7]>()).prop_map(assemble)
    })
}

fn any_value() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -10.0..10.0, 1 => Just(f64::NAN), 1 => any::<f64>().prop_filter("finite", |v| v.is_finite())]
}

fn any_severity() -> impl Strategy<Value = Severity> {
    prop_oneof![Just(Severity::Note), Just(Severity::Warning), Just(Severity::Error)]
}

fn any_log_line() -> impl Strategy<Value = LogLine> {
    let level =
        prop::sample::select(vec![LogLevel::Trace, LogLevel::Debug, LogLevel::Info, LogLevel::Warn, LogLevel::Error]);
    let place = prop::option::of((".+", any::<u64>()).prop_map(|(file, line)| Place { file, line }));
    (any::<u64>(), level, ".*", place).prop_map(|(t_us, level, message, place)| LogLine { t_us, level, message, place })
}

type Rows = (Vec<(u64, u64)>, Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<(u8, u16, f64, f64)>);
type Parts = ((Robot, bool), Rows, Vec<(Severity, String)>, Vec<LogLine>, [u64; 7]);

fn assemble(parts: Parts) -> Recording {
    let ((robot, from_device), (steps, duty, values, ticks), events, log, counts) = parts;
    let mut session = Session::of(robot);
    if from_device {
        session.motion = Some(MotionFile { name: "calibration".into(), toml: "# empty\n".into() });
        session.zero_rad = vec![0.25, -0.5];
        session.firmware = Some(Firmware {
            version: "0.1.0".into(),
            protocol_version: 1,
            schema_key: "0123456789abcdef".into(),
            robot: session.robot.name.clone(),
            restarted_by: Some("a panic at src/main.rs:7".into()),
            details: String::new(),
        });
    }
    let gyros = session.robot.gyros().count();
    if from_device {
        session.gyro_times = vec![GyroTime { filter_delay_us: Some(563.0), output_rate_hz: None }; gyros];
    }
    let mut recorder = Recorder::new(session);
    let (mut t_us, mut seq) = (1_790_148, 7);
    for (k, (step_us, ticks_passed)) in steps.into_iter().enumerate() {
        t_us += step_us * ticks_passed;
        seq += ticks_passed;
        let (phase, flags, execution_us, jitter_us) = ticks[k];
        let age = |gyro: usize| if gyro < gyros { jitter_us + gyro as f64 } else { f64::NAN };
        let tick = Tick { flags, execution_us, jitter_us, gyro_ages_us: std::array::from_fn(age) };
        recorder.push(&Row { t_us, seq, phase, tick, duty: &duty[k], values: &values[k] }).unwrap();
    }
    for (severity, text) in events {
        recorder.event(Event { t_us, seq, severity, text });
    }
    for line in log {
        recorder.log(line);
    }
    if from_device {
        let [ticks, received, missing, device_dropped, host_dropped, line_lost, damaged_frames] = counts;
        recorder.balance(LossBalance {
            ticks,
            received,
            missing,
            device_dropped,
            host_dropped,
            line_lost,
            damaged_frames,
            closed: ticks % 2 == 0,
        });
    }
    recorder.finish(Source { path: "any".into(), sha256: String::new() })
}

/// Compares all but source, damage and NaN's bits.
pub fn assert_same(left: &Recording, right: &Recording) {
    assert_same_samples(left, right);
    assert_eq!(left.session(), right.session());
    assert_eq!(left.phase, right.phase);
    assert_eq!(left.gyro_times, right.gyro_times);
    assert_eq!(format!("{:?}", left.ticks), format!("{:?}", right.ticks)); // NaN is NaN here
    assert_eq!(left.events, right.events);
    assert_eq!(left.log, right.log);
    assert_eq!(left.balance, right.balance);
}

/// Compares time, numbers, inputs and values, bit for bit but for NaN.
pub fn assert_same_samples(left: &Recording, right: &Recording) {
    let bits = |values: &[f64]| -> Vec<u64> {
        values.iter().map(|v| if v.is_nan() { f64::NAN.to_bits() } else { v.to_bits() }).collect()
    };
    assert_eq!(left.t_us, right.t_us);
    for (a, b) in left.seq.iter().zip(&right.seq) {
        assert_eq!(a - left.seq[0], b - right.seq[0]);
    }
    assert_eq!(left.duty.len(), right.duty.len());
    for (a, b) in left.duty.iter().zip(&right.duty) {
        assert_eq!(bits(a), bits(b));
    }
    assert_eq!(left.channels.len(), right.channels.len());
    for (a, b) in left.channels.iter().zip(&right.channels) {
        assert_eq!((&a.spec, bits(&a.values)), (&b.spec, bits(&b.values)));
    }
}
