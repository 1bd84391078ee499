//! Every message there and back, whole or damaged, and the bounds of the largest.

use crate::examples;
use proptest::prelude::*;
use protocol::{
    Action, Command, Duty, Fault, Hello, JointSet, Layout, Motion, MotionEnd, MotionError, MotionId, Refusal, Report,
    Sample, Segment, State, Status, ToDevice, ToHost,
    frame::{CRC_BYTES, Decoder, MAX_PAYLOAD},
    hello::{Greeting, HelloError, SchemaKey},
    message::{
        self, MAX_TO_DEVICE_FRAME, MAX_TO_DEVICE_PAYLOAD, MAX_TO_HOST_FRAME, ReadError, peek_greeting, peek_identity,
        read_to_device, read_to_host, write_report, write_sample, write_to_device,
    },
    motion::Header,
    units::text,
};

/// Payloads of undamaged frames in some bytes.
fn payloads(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut decoder = Decoder::<{ MAX_PAYLOAD + CRC_BYTES }>::new();
    bytes.iter().filter_map(|b| decoder.feed(*b)?.ok().map(<[u8]>::to_vec)).collect()
}

/// Every message of the table in frames.
fn frames() -> Vec<Vec<u8>> {
    let mut out = [0; MAX_TO_HOST_FRAME];
    let mut frames = Vec::new();
    for (_, report) in examples::reports() {
        let n = write_report(&report, &mut out).unwrap();
        frames.push(out[..n].to_vec());
    }
    for (_, request) in examples::requests() {
        let n = write_to_device(&request, &mut out).unwrap();
        frames.push(out[..n].to_vec());
    }
    let n = write_sample(&Sample::default(), &Layout::DOGGY, &mut out).unwrap();
    frames.push(out[..n].to_vec());
    frames
}

#[test]
fn every_message_comes_back() {
    let mut out = [0; MAX_TO_HOST_FRAME];
    for (name, report) in examples::reports() {
        let n = write_report(&report, &mut out).unwrap();
        let payload = payloads(&out[..n]).pop().unwrap();
        assert_eq!(read_to_host(&payload, None), Ok(ToHost::Report(report)), "{name}");
    }
    for (name, request) in examples::requests() {
        let n = write_to_device(&request, &mut out).unwrap();
        let payload = payloads(&out[..n]).pop().unwrap();
        assert_eq!(read_to_device(&payload), Ok(request), "{name}");
    }
}

#[test]
fn a_sample_needs_the_layout_of_the_handshake() {
    let mut out = [0; MAX_TO_HOST_FRAME];
    let n = write_sample(&Sample::default(), &Layout::DOGGY, &mut out).unwrap();
    let payload = payloads(&out[..n]).pop().unwrap();
    assert_eq!(read_to_host(&payload, None), Err(ReadError::SampleBeforeHello));
    assert_eq!(read_to_host(&payload, Some(&Layout::DOGGY)), Ok(ToHost::Sample(Sample::default())));
    assert!(matches!(read_to_host(&payload, Some(&Layout::WIDEST)), Err(ReadError::Sample(_))));
}

#[test]
fn the_largest_messages_fit_their_bounds() {
    let mut out = [0; MAX_TO_HOST_FRAME];
    let hello = examples::longest_hello();
    hello.validate().unwrap();
    let n = write_report(&Report::Hello(hello), &mut out).unwrap();
    // Measured 515 of 520: a field more and the bound must grow with it.
    let payload = payloads(&out[..n]).pop().unwrap().len();
    assert!((500..=MAX_PAYLOAD).contains(&payload), "{payload}");

    let header = Header {
        name: text(&"n".repeat(24)),
        stages: (0..8).map(|_| text(&"s".repeat(16))).collect(),
        gain: [f32::MAX; 7].into_iter().collect(),
    };
    let begin = Command::UploadBegin { motion: MotionId(255), header, segments: 96 };
    let n = write_to_device(&ToDevice::Request { id: 255, command: begin }, &mut out).unwrap();
    let payload = payloads(&out[..n]).pop().unwrap().len();
    assert!((180..=MAX_TO_DEVICE_PAYLOAD).contains(&payload), "{payload}");
    assert!(n <= MAX_TO_DEVICE_FRAME);

    // What the budget takes for the longest answer.
    let late = MotionEnd::Fault(Fault::JointLimit { joint: 255 });
    for report in [
        Report::Status(Status {
            state: State::Waiting { at_seq: u32::MAX },
            streaming: true,
            first_seq: u32::MAX,
            end_seq: u32::MAX,
            dropped: u32::MAX,
            motion: MotionId(255),
            last_end: Some((MotionId(255), late)),
        }),
        Report::Refused { id: 255, refusal: Refusal::Motion(MotionError::Duration { segment: 255, ms: u32::MAX }) },
    ] {
        let n = write_report(&report, &mut out).unwrap();
        let payload = payloads(&out[..n]).pop().unwrap().len();
        assert!(payload <= protocol::budget::ANSWERS.payload, "{payload}");
    }
    let n = write_report(&Report::HeartbeatSeen { count: u16::MAX, t_us: u32::MAX }, &mut out).unwrap();
    let payload = payloads(&out[..n]).pop().unwrap().len();
    assert!(payload <= protocol::budget::HEARTBEATS_SEEN.payload, "{payload}");
    let n = write_report(&Report::Log { level: message::Level::Error, text: text(&"l".repeat(80)) }, &mut out).unwrap();
    let payload = payloads(&out[..n]).pop().unwrap().len();
    assert!(payload <= protocol::budget::LOG.payload, "{payload}");
}

#[test]
fn the_largest_parts_of_a_motion_are_as_the_checksum_s_buffer_takes_them() {
    let mut bytes = [0; 256];
    let header = Header {
        name: text(&"n".repeat(24)),
        stages: (0..8).map(|_| text(&"s".repeat(16))).collect(),
        gain: [f32::MAX; 7].into_iter().collect(),
    };
    assert_eq!(postcard::to_slice(&header, &mut bytes).unwrap().len(), 191);
    let segment = Segment {
        stage: 255,
        action: Action::MoveTo {
            joints: JointSet::first(7),
            targets: [f32::MAX; 7].into_iter().collect(),
            ceiling: Duty(i16::MIN),
            tolerance: f32::MAX,
            timeout_ms: u32::MAX,
        },
    };
    assert_eq!(postcard::to_slice(&segment, &mut bytes).unwrap().len(), 44);
}

#[test]
fn a_handshake_that_contradicts_itself_is_refused() {
    let broken = |change: fn(&mut Hello)| {
        let mut hello = examples::hello();
        change(&mut hello);
        hello.validate().unwrap_err()
    };
    assert_eq!(examples::hello().validate(), Ok(()));
    assert!(matches!(
        broken(|h| h.encoders.truncate(2)),
        HelloError::Count { what: "encoders", announced: 3, described: 2 }
    ));
    assert!(matches!(
        broken(|h| h.zero.as_mut().unwrap().truncate(1)),
        HelloError::Count { what: "zero positions", .. }
    ));
    assert_eq!(broken(|h| h.tick_us = 0), HelloError::Tick);
    assert_eq!(broken(|h| h.encoders[1].gear = f64::NAN), HelloError::EncoderScale { index: 1 });
    assert_eq!(broken(|h| h.gyros[1].rad_s_per_lsb = 0.0), HelloError::GyroScale { index: 1 });
    assert_eq!(broken(|h| h.gyros[1].body = 3), HelloError::Joint { joint: 3, joints: 3 });
}

#[test]
fn another_version_still_says_who_it_is() {
    let hello = examples::hello();
    let identity = hello.identity.clone();
    let mut frame = [0; MAX_TO_HOST_FRAME];
    let n = write_report(&Report::Hello(hello), &mut frame).unwrap();
    let mut payload = payloads(&frame[..n]).pop().unwrap();
    assert_eq!(peek_identity(&payload), Some(identity.clone()));
    assert!(!identity.agrees(&Greeting::OURS));
    // Whatever a later version puts behind the frozen part.
    payload.truncate(1 + 1 + 8 + 1 + 5 + 1 + 5);
    payload.extend([0xff; 40]);
    assert!(read_to_host(&payload, None).is_err());
    assert_eq!(peek_identity(&payload), Some(identity));

    let greeting = Greeting { protocol_version: 300, schema_key: SchemaKey([9; 8]) };
    let n = write_to_device(&ToDevice::Hello(greeting), &mut frame).unwrap();
    let mut payload = payloads(&frame[..n]).pop().unwrap();
    payload.extend([1, 2, 3]);
    assert_eq!(peek_greeting(&payload), Some(greeting));
    assert_eq!(peek_greeting(&[1]), None);
    assert_eq!(peek_identity(&[]), None);
}

#[test]
fn a_motion_is_the_same_after_its_upload() {
    let motion = examples::motion();
    let mut frame = [0; MAX_TO_DEVICE_FRAME];
    let mut carry = |command: Command| {
        let n = write_to_device(&ToDevice::Request { id: 1, command }, &mut frame).unwrap();
        let payload = payloads(&frame[..n]).pop().unwrap();
        match read_to_device(&payload).unwrap() {
            ToDevice::Request { command, .. } => command,
            other => panic!("{other:?}"),
        }
    };
    let begin = Command::UploadBegin { motion: MotionId(1), header: motion.header(), segments: 5 };
    let Command::UploadBegin { header, .. } = carry(begin) else { panic!() };
    let mut there = Motion::new(header);
    for (index, segment) in (0..).zip(motion.segments.clone()) {
        let Command::UploadSegment { segment, .. } = carry(Command::UploadSegment { index, segment }) else { panic!() };
        there.segments.push(segment).unwrap();
    }
    assert_eq!(there, motion);
    assert_eq!(there.checksum(), motion.checksum());
    let Segment { stage, .. } = there.segments[0];
    there.segments[0].stage = stage + 1;
    assert_ne!(there.checksum(), motion.checksum());
}

proptest! {
    #[test]
    fn any_payload_is_survived(payload: Vec<u8>) {
        let _ = read_to_host(&payload, Some(&Layout::DOGGY));
        let _ = read_to_device(&payload);
        let _ = peek_identity(&payload);
        let _ = peek_greeting(&payload);
    }

    #[test]
    fn any_payload_behind_a_known_tag_is_survived(tag in 0u8..10, rest: Vec<u8>) {
        let mut payload = vec![tag];
        payload.extend(rest);
        let _ = read_to_host(&payload, Some(&Layout::DOGGY));
        let _ = read_to_device(&payload);
    }

    #[test]
    fn a_damaged_frame_is_rejected(
        frame in prop::sample::select(frames()),
        hits in prop::collection::vec((any::<prop::sample::Index>(), 1u8..), 1..=3),
    ) {
        let mut line = frame.clone();
        for (place, flip) in hits {
            let i = place.index(frame.len());
            line[i] = frame[i] ^ flip;
        }
        line.push(0);
        prop_assert_eq!(payloads(&line), Vec::<Vec<u8>>::new());
    }

    #[test]
    fn bytes_cut_out_of_a_stream_cost_the_frames_they_touch_and_no_more(
        from in 0usize..55 * 20, len in 1usize..200,
    ) {
        let mut line = Vec::new();
        for seq in 0..20 {
            let mut frame = [0; 55];
            let n = write_sample(&Sample { seq, ..Sample::default() }, &Layout::DOGGY, &mut frame).unwrap();
            prop_assert_eq!(n, 55);
            line.extend(frame);
        }
        let end = (from + len).min(line.len());
        line.drain(from..end);
        let seqs: Vec<u32> = payloads(&line).iter().map(|p| match read_to_host(p, Some(&Layout::DOGGY)) {
            Ok(ToHost::Sample(s)) => s.seq,
            other => panic!("{other:?}"),
        }).collect();
        let untouched: Vec<u32> = (0..20u32).filter(|i| {
            let (a, b) = (*i as usize * 55, *i as usize * 55 + 55);
            b <= from || a >= end
        }).collect();
        // A cut that swallows a delimiter but not the beginning of the next frame spoils that one as well; a cut of
        // whole frames' length may join the halves of two frames to one that was sent.
        prop_assert!(seqs.is_sorted() && seqs.iter().all(|seq| *seq < 20), "{:?}", seqs);
        let spoilt = untouched.iter().filter(|seq| !seqs.contains(seq)).count();
        prop_assert!(spoilt <= 1 && seqs.len() <= untouched.len() + 1, "{:?} of {:?}", seqs, untouched);
    }
}
