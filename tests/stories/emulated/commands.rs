//! What the machine code in the emulator makes of a host that talks nonsense.

use std::fs::OpenOptions;
use std::io::Write;
use std::time::Duration;

use host::link::{self, Device, LinkError};
use host::robot::Robot;
use host::simulate::{Fault, description};
use protocol::motion::{MAX_MOTION_MS, MAX_SEGMENT_MS};
use protocol::{Action, Duty, Motion, MotionError, MotionId, Refusal};
use rand::{RngExt, SeedableRng};
use tests::machine::{Emulated, Log, Options, Recorded, SWING};

fn swing() -> Motion {
    toml::from_str(&std::fs::read_to_string(SWING).unwrap()).unwrap()
}

/// The motion is recorded to its end, and nothing is lost.
fn works(machine: &Emulated) {
    let Recorded { code, said, .. } = machine.record(&["--motion", SWING]);
    assert!(code == Some(0) && said.contains(", 0 lost"), "{said}");
}

#[test]
fn a_megabyte_of_nonsense_is_survived() {
    let machine = Emulated::start(&Options { seed: 3, ..Options::default() });
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut nonsense = vec![0; 1_000_000];
    rng.fill(&mut nonsense[..]);
    let mut line = OpenOptions::new().write(true).open(machine.port()).unwrap();
    line.write_all(&nonsense).unwrap();
    drop(line);
    // It takes 11 s of the line, during which nobody would be answered.
    let heard = |log: &Log| log.periods.iter().map(|period| period.sensors.host.len()).sum::<usize>();
    while machine.so_far(heard) < nonsense.len() {
        assert!(machine.is_running());
        std::thread::sleep(Duration::from_millis(50));
    }
    works(&machine);
    let (log, _) = machine.finish();
    assert_eq!(log.starts.len(), 1, "no reset");
    let motion = log.motion.unwrap();
    let at_rest = log.periods[..motion].iter().all(|period| period.duty.iter().all(|duty| duty.0 == 0));
    assert!(at_rest, "nothing moved before it was asked to");
}

#[test]
fn motions_and_jogs_that_break_a_rule_are_refused_and_nothing_moves() {
    let machine = Emulated::start(&Options { seed: 3, ..Options::default() });
    let mut device = Device::open(&machine.port().display().to_string(), &link::Options::default()).unwrap();
    device.settle().unwrap();
    device.set_zero().unwrap();
    let refused = |device: &mut Device, motion: &Motion| match device.upload(MotionId(1), motion) {
        Err(LinkError::Refused { refusal, .. }) => *refusal,
        other => panic!("not refused: {other:?}"),
    };

    let mut outside = swing();
    let chirp = outside.segments[1].clone();
    outside.segments[1].action = Action::MoveTo {
        joints: protocol::JointSet::only(1),
        targets: heapless::Vec::from_slice(&[0.61]).unwrap(),
        ceiling: Duty(1000),
        tolerance: 0.01,
        timeout_ms: 1000,
    };
    let reason = Refusal::Motion(MotionError::OutsideLimits { segment: 1, joint: 1, position: 0.61 });
    assert_eq!(refused(&mut device, &outside), reason);

    let mut malformed = swing();
    malformed.gain.truncate(2);
    assert_eq!(refused(&mut device, &malformed), Refusal::Motion(MotionError::Gains { got: 2, joints: 3 }));

    let mut long = swing();
    while long.longest_ms() <= MAX_MOTION_MS {
        let mut segment = chirp.clone();
        segment.action = Action::Zero { duration_ms: MAX_SEGMENT_MS };
        long.segments.push(segment).unwrap();
    }
    assert!(matches!(refused(&mut device, &long), Refusal::Motion(MotionError::TooLong { .. })));

    // From here on heartbeats are sent.
    device.stream().unwrap();
    let nothing_there = device.start(MotionId(1), None).unwrap_err();
    assert!(nothing_there.to_string().contains("is not there"), "{nothing_there}");
    for (joint, duty, duration_ms, reason) in [
        (0, 1501, 50, Refusal::JogBounds { duty: Duty(1501), duration_ms: 50 }),
        (0, -1500, 201, Refusal::JogBounds { duty: Duty(-1500), duration_ms: 201 }),
        (3, 500, 50, Refusal::NoSuchJoint { joint: 3, joints: 3 }),
    ] {
        match device.jog(joint, Duty(duty), duration_ms) {
            Err(LinkError::Refused { refusal, .. }) => assert_eq!(*refusal, reason),
            other => panic!("not refused: {other:?}"),
        }
    }
    drop(device);
    let at_rest = machine.so_far(|log| log.periods.iter().all(|period| period.duty.iter().all(|duty| duty.0 == 0)));
    assert!(at_rest, "nothing moved");
    works(&machine);
}

/// A description is stored while the robot rests, and what runs after the watchdog's reset in the next motion is that one.
#[test]
fn a_description_is_stored_and_runs_after_a_reset() {
    let faults = vec![Fault::Reset { at_s: 0.4 }];
    let machine = Emulated::start(&Options { seed: 3, faults, ..Options::default() });
    let port = machine.port().display().to_string();
    let mut wanted = description(&Robot::builtin("doggy").unwrap()).unwrap();
    wanted.robot = protocol::units::text("neighbour");
    wanted.joints[1].max_duty = Duty(5000);
    {
        let mut device = Device::open(&port, &link::Options::default()).unwrap();
        device.settle().unwrap();
        device.push(&wanted).unwrap();
        let hello = device.hello();
        assert_eq!(hello.description.stored.map(|stamp| stamp.crc()), Some(wanted.crc()));
        assert_eq!((hello.identity.robot.as_str(), hello.description.running), ("doggy", None), "until it starts anew");

        wanted.joints[1].limits.max = -1.0;
        match device.push(&wanted) {
            Err(LinkError::Refused { refusal, .. }) => {
                assert_eq!(*refusal, Refusal::Description(protocol::DescriptionError::Limits { joint: 1 }));
            }
            other => panic!("not refused: {other:?}"),
        }
    }
    let Recorded { code, said, .. } = machine.record(&["--motion", SWING]);
    assert_eq!(code, Some(3), "{said}");
    let hello = link::probe(&port, &link::Options::default()).unwrap();
    assert_eq!(hello.identity.robot, "neighbour");
    assert!(hello.description.running.is_some() && hello.description.running == hello.description.stored);
    let (log, _) = machine.finish();
    assert_eq!(log.starts.len(), 2, "one reset");
    let deepest = log.periods.iter().map(|period| period.stack_bytes).max().unwrap();
    eprintln!("the stack was {deepest} bytes deep");
    assert!(deepest < 9216 - 512, "{deepest}");
}
