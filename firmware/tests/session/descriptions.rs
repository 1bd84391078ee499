//! Descriptions: sent, checked, stored, and run from the next start on.

use firmware::motion::preset;
use firmware::robot::HARDWARE;
use firmware::store::{AREA_BYTES, RamFlash};
use firmware::{ControlCore, GyroInput, Inputs};
use proptest::prelude::*;
use protocol::description::{
    Axis, DESCRIPTION_PIECE, DescriptionError, EncoderDescription, GyroDescription, GyroPart, JointDescription,
    MAX_DESCRIPTION_BYTES,
};
use protocol::message::{self, MAX_TO_DEVICE_FRAME};
use protocol::motion::Limits;
use protocol::request::Heartbeat;
use protocol::units::text;
use protocol::{
    Command, Description, Descriptions, Duty, Fault, MAX_ENCODERS, MAX_GYROS, Refusal, Side, State, ToDevice,
};

use crate::bench::Bench;
use crate::motions::limits;
use crate::plant::Plant;

/// A robot of three joints that is not Doggy.
fn another() -> Description {
    let joint = |axis| JointDescription {
        limits: Limits { min: -0.5, max: 0.7 },
        axis: Axis::Turns(axis),
        standing_duty: Duty(400),
        max_duty: Duty(5000),
        coast_s: 0.09,
        held_s: 0.03,
        carried_s2: [0.006, 0.002, 0.001].into_iter().collect(),
    };
    let encoder = |joint, counts_per_turn| EncoderDescription { joint, side: Side::Motor, counts_per_turn, gear: 20.0 };
    let gyro = |part, body| GyroDescription {
        part,
        range_dps: 1000,
        body,
        mount: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        give_rad: 0.2,
        sag_rad: 0.0,
    };
    Description {
        robot: text("another"),
        joints: [joint([0.0, 0.0, 1.0]), joint([0.0, 1.0, 0.0]), joint([1.0, 0.0, 0.0])].into_iter().collect(),
        encoders: [encoder(0, 2048), encoder(1, -2048), encoder(2, 4096)].into_iter().collect(),
        gyros: [gyro(GyroPart::Icm42688p, 0), gyro(GyroPart::Bmi323, 2)].into_iter().collect(),
    }
}

fn empty() -> RamFlash<Vec<u8>> {
    RamFlash(vec![0xFF; 2 * AREA_BYTES])
}

fn encoded(description: &Description) -> Vec<u8> {
    let mut bytes = vec![0; MAX_DESCRIPTION_BYTES];
    let n = description.encode(&mut bytes).unwrap();
    bytes.truncate(n);
    bytes
}

fn piece(index: usize, bytes: &[u8]) -> Command {
    Command::DescriptionPiece { index: index as u8, bytes: bytes.iter().copied().collect() }
}

/// Sends encoded bytes as a host does.
fn push(bench: &mut Bench, bytes: &[u8]) -> Result<(), Refusal> {
    let pieces = bytes.chunks(DESCRIPTION_PIECE);
    bench.ask(Command::DescriptionBegin { pieces: pieces.len() as u8 })?;
    for (index, bytes) in pieces.enumerate() {
        bench.ask(piece(index, bytes))?;
    }
    bench.ask(Command::DescriptionEnd { checksum: protocol::frame::crc32(bytes) })
}

#[test]
fn a_description_is_stored_and_runs_from_the_next_start_on() {
    let mut bench = Bench::storing(empty());
    bench.run(20);
    let before = bench.hello();
    let none = Descriptions { running: None, stored: None, can_store: true };
    assert_eq!((before.identity.robot.as_str(), before.description), ("doggy", none));

    push(&mut bench, &encoded(&another())).unwrap();
    let hello = bench.hello();
    let stored = hello.description.stored.unwrap();
    assert_eq!((stored.sequence, stored.crc()), (1, another().crc()));
    assert_eq!((hello.description.running, hello.identity.robot.as_str()), (None, "doggy"), "until it starts anew");

    let flash = bench.flash.take().unwrap();
    bench.restart(flash);
    bench.run(20);
    let hello = bench.hello();
    assert_eq!(hello.description.running, Some(stored));
    assert_eq!(hello.description.stored, Some(stored));
    assert_eq!(hello.identity.robot, "another");
    assert_eq!(hello.encoders.iter().map(|e| e.counts_per_turn).collect::<Vec<_>>(), [2048, -2048, 4096]);
    assert_eq!(hello.gyros[1].body, 2);
    assert_eq!(hello.gyros[0].rad_s_per_lsb, before.gyros[0].rad_s_per_lsb, "the board's to know");
    assert!(hello.validate().is_ok());
}

/// The copy is whole, but the board that finds it drives another number of motors: it runs what is built in, and says so.
#[test]
fn a_stored_robot_that_the_board_cannot_run_is_told_and_not_run() {
    let mut two = another();
    two.joints.pop();
    let mut flash = empty();
    let stored = firmware::store::save(&mut flash, &encoded(&two)).unwrap();
    let mut bench = Bench::storing(flash);
    bench.run(20);
    let hello = bench.hello();
    assert_eq!(hello.description, Descriptions { running: None, stored: Some(stored), can_store: true });
    assert_eq!(hello.identity.robot, "doggy");
}

#[test]
fn what_the_board_cannot_run_is_refused_by_name_and_changes_nothing() {
    let mut bench = Bench::storing(empty());
    bench.run(20);
    push(&mut bench, &encoded(&another())).unwrap();
    let before = bench.hello().description;
    type Change = fn(&mut Description);
    let wrong: [(Change, DescriptionError); 11] = [
        (|d| d.joints.truncate(2), DescriptionError::Motors { described: 2, board: 3 }),
        (|d| d.encoders.truncate(2), DescriptionError::Encoders { described: 2, board: 3 }),
        (|d| d.encoders[1].side = Side::Link, DescriptionError::EncoderPlace { encoder: 1 }),
        (
            |d| d.gyros.swap(0, 1),
            DescriptionError::GyroPart { gyro: 0, described: GyroPart::Bmi323, board: GyroPart::Icm42688p },
        ),
        (|d| d.gyros[1].body = 3, DescriptionError::NoSuchBody { gyro: 1 }),
        (|d| d.gyros[1].range_dps = 500, DescriptionError::GyroRange { gyro: 1, described: 500, board: 1000 }),
        (|d| d.joints[2].limits.min = 0.8, DescriptionError::Limits { joint: 2 }),
        (|d| d.joints[2].limits.max = f32::INFINITY, DescriptionError::Limits { joint: 2 }),
        (|d| d.joints[0].max_duty = Duty(10_001), DescriptionError::Duty { joint: 0 }),
        (|d| d.joints[1].carried_s2.truncate(2), DescriptionError::Carried { joint: 1 }),
        (|d| d.encoders[0].counts_per_turn = 0, DescriptionError::Scale { encoder: 0 }),
    ];
    for (change, error) in wrong {
        let mut description = another();
        change(&mut description);
        assert_eq!(push(&mut bench, &encoded(&description)), Err(Refusal::Description(error)));
    }
    // A robot with one gyro fewer fits.
    assert_eq!(bench.hello().description, before);
    let mut one_gyro = another();
    one_gyro.gyros.pop();
    push(&mut bench, &encoded(&one_gyro)).unwrap();
    assert_eq!(bench.hello().description.stored.unwrap().sequence, 2);
}

#[test]
fn what_is_not_whole_is_refused() {
    let mut bench = Bench::storing(empty());
    bench.run(20);
    let bytes = encoded(&another());
    let end = Command::DescriptionEnd { checksum: protocol::frame::crc32(&bytes) };
    assert_eq!(bench.ask(end.clone()), Err(Refusal::NoUpload));
    assert_eq!(bench.ask(piece(0, &bytes[..128])), Err(Refusal::NoUpload));
    for pieces in [0, 8, 255] {
        assert_eq!(bench.ask(Command::DescriptionBegin { pieces }), Err(Refusal::Unreadable));
    }
    bench.ask(Command::DescriptionBegin { pieces: 3 }).unwrap();
    bench.ask(piece(0, &bytes[..128])).unwrap();
    bench.ask(piece(0, &bytes[..128])).unwrap(); // repeated: its answer was lost
    assert_eq!(bench.ask(piece(2, &bytes[256..])), Err(Refusal::UploadOrder { expected: 1, got: 2 }));
    assert_eq!(bench.ask(end), Err(Refusal::UploadOrder { expected: 1, got: 3 }));
    assert!(push(&mut bench, &bytes[..bytes.len() - 1]).is_err(), "cut off");
    assert_eq!(push(&mut bench, &[0xFF; 300]), Err(Refusal::Unreadable));
    bench.ask(Command::DescriptionBegin { pieces: 1 }).unwrap();
    bench.ask(piece(0, &bytes[..128])).unwrap();
    let got = protocol::frame::crc32(&bytes[..128]);
    let refused = bench.ask(Command::DescriptionEnd { checksum: 7 });
    assert_eq!(refused, Err(Refusal::Checksum { expected: 7, got }));
    assert_eq!(bench.hello().description.stored, None);
}

/// The answer is lost: the same request again is answered and stores nothing a second time.
#[test]
fn a_repeated_end_is_answered_from_memory() {
    let mut bench = Bench::storing(empty());
    bench.run(20);
    let bytes = encoded(&another());
    let pieces = bytes.chunks(DESCRIPTION_PIECE);
    bench.ask(Command::DescriptionBegin { pieces: pieces.len() as u8 }).unwrap();
    for (index, bytes) in pieces.enumerate() {
        bench.ask(piece(index, bytes)).unwrap();
    }
    let end = Command::DescriptionEnd { checksum: protocol::frame::crc32(&bytes) };
    bench.ask_as(200, end.clone()).unwrap();
    let kept = bench.flash.as_ref().unwrap().0.clone();
    bench.ask_as(200, end).unwrap();
    assert_eq!(bench.flash.as_ref().unwrap().0, kept);
}

#[test]
fn nothing_is_stored_outside_the_idle_state_or_without_a_place() {
    let motion = preset::validation(&limits(3));
    let mut bench = Bench::new(Plant::doggy(3, 1));
    bench.run(20);
    assert_eq!(push(&mut bench, &encoded(&another())), Err(Refusal::NoStore));
    let mut bench = Bench::storing(RamFlash(Vec::new()));
    bench.run(20);
    assert_eq!(push(&mut bench, &encoded(&another())), Err(Refusal::NoStore), "a flash without room");

    let mut bench = Bench::storing(empty());
    bench.prepare(&motion);
    bench.start().unwrap();
    bench.run(100);
    assert_eq!(push(&mut bench, &encoded(&another())), Err(Refusal::Running));
    bench.ask(Command::Stop).unwrap();
    assert_eq!(push(&mut bench, &encoded(&another())), Err(Refusal::Armed), "the drivers brake for half a second");
    bench.run(600);
    // Everything is uploaded, and the emergency stop is pressed before the end.
    let bytes = encoded(&another());
    let pieces = bytes.chunks(DESCRIPTION_PIECE);
    bench.ask(Command::DescriptionBegin { pieces: pieces.len() as u8 }).unwrap();
    for (index, bytes) in pieces.enumerate() {
        bench.ask(piece(index, bytes)).unwrap();
    }
    bench.disturb.inputs = Some(Box::new(|inputs: &mut Inputs| inputs.emergency_stop = true));
    let end = Command::DescriptionEnd { checksum: protocol::frame::crc32(&bytes) };
    assert_eq!(bench.ask(end.clone()), Err(Refusal::Fault(Fault::EmergencyStop)));
    bench.disturb.inputs = None;
    bench.run(5);
    bench.ask(Command::ClearFault).unwrap();
    bench.ask(end).unwrap();
    assert_eq!(bench.hello().description.stored.unwrap().crc(), another().crc());
}

/// The erase holds the core up for half a second: the tick after it is late, and nothing else happens.
#[test]
fn a_long_erase_raises_no_fault() {
    let mut bench = Bench::storing(empty());
    bench.run(20);
    push(&mut bench, &encoded(&another())).unwrap();
    bench.disturb.clock_us = 500_000;
    bench.run(200);
    assert_eq!(bench.core.control().state(), State::Idle);
}

/// Power of ten of the counts for a rad and whether they count backwards, limits as parts of the widest, axis, duty limits,
/// coasting time, time for which the belt holds, and what the joint carries.
type DrawnJoint = ((f64, bool), (f64, f64), Axis, (Duty, Duty), f32, f32, Vec<f32>);

/// Robots at the ends of what the checks let pass.
fn extreme() -> impl Strategy<Value = Description> {
    let figure = || prop_oneof![0.0..10.0_f32, Just(0.0), Just(f32::MAX), Just(1e-30), Just(1e10)];
    let coast_s = prop_oneof![0.0..10.0_f32, Just(0.0), Just(10.0)];
    let axis = prop_oneof![Just(Axis::Slides), Just(Axis::Turns([0.0, -1.0, 0.0])), Just(Axis::Turns([0.6, 0.8, 0.0]))];
    let duty = || prop_oneof![(0..=10_000_i16).prop_map(Duty), Just(Duty(0)), Just(Duty(10_000))];
    // Counts for a rad as a power of ten, and limits as a part of the widest.
    let scale = (0.1..7.99_f64, any::<bool>());
    let part = || prop_oneof![0.0..0.999_f64, 1e-9..1e-6_f64];
    let joint =
        (scale, (part(), part()), axis, (duty(), duty()), coast_s, figure(), proptest::collection::vec(figure(), 3));
    let gyro = (0..3_u8, 0.0..std::f32::consts::TAU, 0.0..std::f32::consts::TAU);
    let described = |(index, joint): (usize, DrawnJoint)| {
        let ((scale, reversed), (below, above), axis, (standing_duty, max_duty), coast_s, held_s, carried) = joint;
        let scale = 10_f64.powf(scale);
        let widest = f64::from(1 << 29) / scale;
        let limits = Limits { min: (-below * widest) as f32, max: (above * widest) as f32 };
        let counts_per_turn = if reversed { -1000 } else { 1000 };
        let gear = scale * std::f64::consts::TAU / 1000.0;
        let carried_s2 = carried.into_iter().collect();
        let encoder = EncoderDescription { joint: index as u8, side: Side::Motor, counts_per_turn, gear };
        (JointDescription { limits, axis, standing_duty, max_duty, coast_s, held_s, carried_s2 }, encoder)
    };
    (proptest::collection::vec(joint, 3), proptest::collection::vec(gyro, 0..3)).prop_map(move |(joints, gyros)| {
        let (joints, encoders): (Vec<_>, Vec<_>) = joints.into_iter().enumerate().map(described).unzip();
        let mount = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]];
        let gyros = gyros.into_iter().zip([GyroPart::Icm42688p, GyroPart::Bmi323]);
        let gyros = gyros.map(|((body, give_rad, sag_rad), part)| GyroDescription {
            part,
            range_dps: 1000,
            body,
            mount,
            give_rad,
            sag_rad,
        });
        Description {
            robot: text("extreme"),
            joints: joints.into_iter().collect(),
            encoders: encoders.into_iter().collect(),
            gyros: gyros.collect(),
        }
    })
}

fn send(core: &mut ControlCore, id: u8, command: Command) {
    let mut frame = [0; MAX_TO_DEVICE_FRAME];
    let n = message::write_to_device(&ToDevice::Request { id, command }, &mut frame).unwrap();
    core.receive(&frame[..n]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// Whatever passes the checks runs: extreme figures, a jog and wild readings overflow nothing.
    #[test]
    fn no_description_that_is_accepted_upsets_the_core(
        description in extreme(),
        readings in proptest::collection::vec((any::<[i32; 3]>(), any::<[[i16; 3]; 2]>()), 12),
        small: bool,
    ) {
        prop_assert_eq!(HARDWARE.check(&description), Ok(()));
        let mut core = ControlCore::new(&HARDWARE.config(&description).unwrap());
        let mut inputs = Inputs { encoders: [Some(0); MAX_ENCODERS], ..Inputs::default() };
        inputs.gyros = [GyroInput::Words([5, -3, 2]); MAX_GYROS];
        let heartbeat = ToDevice::Heartbeat(Heartbeat { count: 1, seen_seq: 0 });
        let mut frame = [0; MAX_TO_DEVICE_FRAME];
        let beat = message::write_to_device(&heartbeat, &mut frame).unwrap();
        for tick in 0..40 {
            match tick {
                20 => send(&mut core, 1, Command::SetZero),
                22 => core.receive(&frame[..beat]),
                24 => send(&mut core, 2, Command::Jog { joint: 1, duty: Duty(1000), duration_ms: 100 }),
                _ => {}
            }
            core.tick(tick * 1000, &inputs);
        }
        let state = core.control().state();
        let at_limit = state == State::Fault(Fault::JointLimit { joint: 1 });
        prop_assert!(state == (State::Jogging { joint: 1 }) || at_limit, "{:?}", state);
        for (tick, (counts, words)) in (40_u32..).zip(readings) {
            for (encoder, counts) in inputs.encoders.iter_mut().zip(counts) {
                *encoder = Some(if small { counts % 100 } else { counts });
            }
            inputs.gyros = words.map(GyroInput::Words);
            let outputs = core.tick(tick * 1000, &inputs);
            prop_assert_eq!([outputs.duty[0], outputs.duty[2]], [Duty::ZERO; 2]);
        }
    }

    /// Any figures are checked without a panic, and what is refused by the check is refused by the start.
    #[test]
    fn any_figures_are_survived(
        mut description in extreme(),
        joint in 0..3_usize,
        figures: [f32; 6],
        counts: i32,
        gear: f64,
        duty: i16,
    ) {
        let [min, max, coast_s, held_s, carried, give_rad] = figures;
        description.joints[joint].limits = Limits { min, max };
        (description.joints[joint].coast_s, description.joints[joint].held_s) = (coast_s, held_s);
        (description.joints[joint].carried_s2[0], description.joints[joint].max_duty) = (carried, Duty(duty));
        (description.encoders[joint].counts_per_turn, description.encoders[joint].gear) = (counts, gear);
        if let Some(gyro) = description.gyros.last_mut() {
            gyro.give_rad = give_rad;
        }
        prop_assert_eq!(HARDWARE.check(&description).err(), HARDWARE.config(&description).err());
    }
}
