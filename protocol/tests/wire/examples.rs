//! One of every message: ordinary ones for the golden bytes, the largest ones for the bounds.

use protocol::{
    Action, Command, Duty, EncoderInfo, Event, EventKind, Fault, GyroInfo, Hello, Identity, JointSet, Loss, LossCause,
    Motion, MotionEnd, MotionError, MotionId, Refusal, Report, ResetReason, Segment, Side, State, Status, ToDevice,
    description::{DescriptionError, Descriptions, GyroPart, Stamp},
    hello::{Greeting, PanicPlace, SchemaKey},
    message::Level,
    motion::Header,
    request::Heartbeat,
    sample::Layout,
    units::text,
};

/// A handshake of Doggy, with fixed versions so that its golden bytes only change with the format.
pub fn hello() -> Hello {
    let encoder = |joint| EncoderInfo { joint, side: Side::Motor, counts_per_turn: 1024, gear: 42.092, offset_us: 0 };
    let gyro = |body, offset_us, output_rate_hz| GyroInfo {
        body,
        rad_s_per_lsb: 0.001,
        saturated_at: 32_767,
        offset_us,
        filter_delay_us: Some(563),
        output_rate_hz,
    };
    Hello {
        identity: Identity {
            protocol_version: 1,
            schema_key: SchemaKey([1, 2, 3, 4, 5, 6, 7, 8]),
            firmware_version: text("0.1.0"),
            robot: text("doggy"),
        },
        layout: Layout::DOGGY,
        tick_us: 1000,
        encoders: (0..3).map(encoder).collect(),
        gyros: [gyro(0, 40, Some(2000)), gyro(2, 80, None)].into_iter().collect(),
        zero: Some([-5, 0, 70_000].into_iter().collect()),
        reset: ResetReason::PowerOn,
        panic: None,
        description: Descriptions {
            running: None,
            stored: Some(Stamp { sequence: 3, crc: [1, 2, 3, 4] }),
            can_store: true,
        },
        code_crc: Some(0x1234_5678),
    }
}

/// The longest handshake that there can be.
pub fn longest_hello() -> Hello {
    let mut hello = hello();
    hello.identity = Identity {
        protocol_version: u16::MAX,
        firmware_version: text(&"v".repeat(24)),
        robot: text(&"r".repeat(24)),
        ..hello.identity
    };
    hello.layout = Layout::WIDEST;
    hello.tick_us = u16::MAX;
    hello.encoders = (0..14)
        .map(|i| EncoderInfo {
            joint: i / 2,
            side: Side::Link,
            counts_per_turn: i32::MIN,
            gear: f64::MAX,
            offset_us: u16::MAX,
        })
        .collect();
    hello.gyros.iter_mut().for_each(|g| {
        (g.saturated_at, g.offset_us) = (u16::MAX, u16::MAX);
        (g.filter_delay_us, g.output_rate_hz) = (Some(u16::MAX), Some(u16::MAX));
    });
    hello.zero = Some([i32::MIN; 14].into_iter().collect());
    let stamp = Some(Stamp { sequence: u32::MAX, crc: [u8::MAX; 4] });
    hello.description = Descriptions { running: stamp, stored: stamp, can_store: true };
    hello.panic = Some(PanicPlace { file: text(&"f".repeat(40)), line: u32::MAX });
    hello
}

/// One segment of each kind.
pub fn actions() -> Vec<Action> {
    let joints = JointSet::first(3);
    let (ceiling, duration_ms) = (Duty(9000), 3000);
    vec![
        Action::Zero { duration_ms },
        Action::Hold { ceiling, duration_ms },
        Action::MoveTo {
            joints: JointSet::only(0).with(2),
            targets: [0.5, -0.25].into_iter().collect(),
            ceiling,
            tolerance: 0.01,
            timeout_ms: 4000,
        },
        Action::Chirp {
            joints,
            amplitude: ceiling,
            from_hz: 1.4,
            to_hz: 10.0,
            spread: 0.0,
            centring: 0.5,
            duration_ms,
        },
        Action::Sine { joints, amplitude: 0.25, frequency_hz: 0.5, spread: 0.5, ceiling, duration_ms },
    ]
}

/// A motion of these segments.
pub fn motion() -> Motion {
    let mut motion = Motion::new(Header {
        name: text("trial"),
        stages: [text("rest"), text("fast")].into_iter().collect(),
        gain: [2.0, 2.0, 3.0].into_iter().collect(),
    });
    motion.segments = actions().into_iter().map(|action| Segment { stage: 1, action }).collect();
    motion
}

/// Every kind of report, by name.
pub fn reports() -> Vec<(&'static str, Report)> {
    let motion = MotionId(3);
    let refused = |refusal| Report::Refused { id: 7, refusal };
    let event = |kind| Report::Event(Event { seq: 300, t_us: 300_012, kind });
    vec![
        ("hello", Report::Hello(hello())),
        ("accepted", Report::Accepted { id: 7 }),
        ("refused_not_zeroed", refused(Refusal::NotZeroed)),
        ("refused_running", refused(Refusal::Running)),
        ("refused_fault", refused(Refusal::Fault(Fault::GyroStuck { gyro: 1 }))),
        ("refused_no_such_motion", refused(Refusal::NoSuchMotion { asked: motion, there: MotionId::NONE })),
        ("refused_late", refused(Refusal::Late { asked: 10, now: 300 })),
        ("refused_order", refused(Refusal::UploadOrder { expected: 3, got: 5 })),
        ("refused_no_upload", refused(Refusal::NoUpload)),
        ("refused_checksum", refused(Refusal::Checksum { expected: 1, got: u32::MAX })),
        (
            "refused_motion",
            refused(Refusal::Motion(MotionError::OutsideLimits { segment: 4, joint: 1, position: 0.75 })),
        ),
        ("refused_stop_not_tested", refused(Refusal::StopNotTested)),
        ("refused_not_quiet", refused(Refusal::NotQuiet)),
        ("refused_no_such_joint", refused(Refusal::NoSuchJoint { joint: 3, joints: 3 })),
        ("refused_jog_bounds", refused(Refusal::JogBounds { duty: Duty(-1501), duration_ms: 201 })),
        ("refused_no_store", refused(Refusal::NoStore)),
        ("refused_armed", refused(Refusal::Armed)),
        ("refused_unreadable", refused(Refusal::Unreadable)),
        ("refused_motors", refused(Refusal::Description(DescriptionError::Motors { described: 2, board: 3 }))),
        (
            "refused_gyro_part",
            refused(Refusal::Description(DescriptionError::GyroPart {
                gyro: 1,
                described: GyroPart::Icm42688p,
                board: GyroPart::Bmi323,
            })),
        ),
        ("refused_store_failed", refused(Refusal::StoreFailed)),
        ("heartbeat_seen", Report::HeartbeatSeen { count: 260, t_us: 1_000_000 }),
        (
            "status",
            Report::Status(Status {
                state: State::Running { phase: 4 },
                streaming: true,
                first_seq: 100,
                end_seq: 20_100,
                dropped: 3,
                motion,
                last_end: Some((motion, MotionEnd::Fault(Fault::HeartbeatLost))),
            }),
        ),
        ("loss", Report::Loss(Loss { cause: LossCause::QueueFull, count: 12, first_seq: 288, total: 15 })),
        ("event_started", event(EventKind::Started(ResetReason::Watchdog))),
        ("event_zero_set", event(EventKind::ZeroSet)),
        ("event_motion_started", event(EventKind::MotionStarted(motion))),
        ("event_move_timed_out", event(EventKind::MoveTimedOut { segment: 9 })),
        ("event_motion_ended", event(EventKind::MotionEnded { motion, end: MotionEnd::Finished })),
        ("event_fault_raised", event(EventKind::FaultRaised(Fault::JointLimit { joint: 2 }))),
        ("event_clock", event(EventKind::FaultRaised(Fault::Clock))),
        ("event_wrong_way", event(EventKind::FaultRaised(Fault::WrongWay { joint: 1 }))),
        ("event_rotation_mismatch", event(EventKind::FaultRaised(Fault::RotationMismatch { gyro: 1 }))),
        ("event_fault_cleared", event(EventKind::FaultCleared)),
        ("event_jog_ended", event(EventKind::JogEnded { joint: 2, end: MotionEnd::Finished })),
        ("log", Report::Log { level: Level::Warn, text: text("gyro 2 answers late") }),
        ("defmt", Report::Defmt { at: 300, bytes: [0, 1, 0xff].into_iter().collect() }),
    ]
}

/// Every kind of message to the device, by name.
pub fn requests() -> Vec<(String, ToDevice)> {
    let motion = motion();
    let id = MotionId(3);
    let mut commands: Vec<(String, Command)> = [
        ("stream", Command::Stream { on: true }),
        ("status", Command::Status),
        ("set_zero", Command::SetZero),
        (
            "upload_begin",
            Command::UploadBegin { motion: id, header: motion.header(), segments: motion.segments.len() as u8 },
        ),
        ("upload_end", Command::UploadEnd { checksum: motion.checksum() }),
        ("start_next", Command::Start { motion: id, at_seq: None }),
        ("start_at", Command::Start { motion: id, at_seq: Some(70_000) }),
        ("jog", Command::Jog { joint: 2, duty: Duty(-1500), duration_ms: 200 }),
        ("stop", Command::Stop),
        ("clear_fault", Command::ClearFault),
        ("description_begin", Command::DescriptionBegin { pieces: 3 }),
        ("description_piece", Command::DescriptionPiece { index: 2, bytes: [0, 1, 0xff].into_iter().collect() }),
        ("description_end", Command::DescriptionEnd { checksum: 0x1234_5678 }),
    ]
    .map(|(name, command)| (name.to_owned(), command))
    .to_vec();
    for (index, segment) in (0..).zip(motion.segments) {
        commands.push((format!("upload_segment_{index}"), Command::UploadSegment { index, segment }));
    }
    let mut all = vec![
        (
            "hello".to_owned(),
            ToDevice::Hello(Greeting { protocol_version: 1, schema_key: SchemaKey([1, 2, 3, 4, 5, 6, 7, 8]) }),
        ),
        ("heartbeat".to_owned(), ToDevice::Heartbeat(Heartbeat { count: 260, seen_seq: 70_000 })),
    ];
    all.extend(commands.into_iter().map(|(name, command)| (name, ToDevice::Request { id: 7, command })));
    all
}
