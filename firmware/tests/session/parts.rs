//! The parts on their own, as a board's tasks hold them; and the arithmetic that must not depend on the machine.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use firmware::motion::preset;
use firmware::queues::Queues;
use firmware::safety::Axis;
use firmware::{Config, ControlLoop, GyroInput, GyroSetup, Inputs, JointSetup, Receiver, Telemetry};
use protocol::frame::{CRC_BYTES, Decoder, MAX_PAYLOAD, crc32};
use protocol::message::{self, MAX_TO_DEVICE_FRAME, MAX_TO_HOST_FRAME};
use protocol::request::Heartbeat;
use protocol::{Command, EncoderInfo, GyroInfo, MAX_JOINTS, Motion, MotionId, Sample, Side, ToDevice, ToHost};

use crate::motions::limits;
use crate::plant::ALONG;

fn config(joints: usize) -> Config {
    let setup = |limits| JointSetup::new(limits, Axis::Turns([0.0, 0.0, 1.0]));
    let setups: Vec<_> = limits(joints).into_iter().map(setup).collect();
    let encoder = |joint| EncoderInfo { joint, side: Side::Motor, counts_per_turn: 1024, gear: 42.092, offset_us: 0 };
    let encoders: Vec<_> = (0..joints as u8).map(encoder).collect();
    let info = GyroInfo {
        body: 0,
        rad_s_per_lsb: 2.2777e-3,
        saturated_at: 32_767,
        offset_us: 20,
        filter_delay_us: None,
        output_rate_hz: None,
    };
    let gyro = GyroSetup { info, mount: ALONG, give_rad: 0.1, sag_rad: 0.0 };
    Config::new("parts", &setups, &encoders, &[gyro]).unwrap()
}

fn frame(message: &ToDevice) -> Vec<u8> {
    let mut frame = [0; MAX_TO_DEVICE_FRAME];
    let n = message::write_to_device(message, &mut frame).unwrap();
    frame[..n].to_vec()
}

/// Tick, telemetry and receiver in threads of their own, each with its ends of the queues only: every sample arrives,
/// in order, while requests come in.
#[test]
fn three_tasks_share_nothing_but_queues() {
    const TICKS: u32 = 20_000;
    let config = config(3);
    let mut queues = Queues::new();
    let (mut tick_ends, mut telemetry_ends, mut commands) = queues.split();
    let (done, accepted) = (AtomicBool::new(false), AtomicU32::new(0));
    let mut receiver = Receiver::new();
    receiver.receive(&frame(&ToDevice::Request { id: 0, command: Command::Stream { on: true } }), &mut commands);
    let (seqs, ticks) = std::thread::scope(|scope| {
        let (done, accepted, config) = (&done, &accepted, &config);
        scope.spawn(move || {
            let mut id = 0u8;
            while !done.load(Ordering::Acquire) {
                id = id.wrapping_add(1);
                for byte in frame(&ToDevice::Request { id, command: Command::Stop }) {
                    receiver.receive(&[byte], &mut commands);
                }
                std::thread::sleep(std::time::Duration::from_micros(100));
            }
        });
        let reader = scope.spawn(move || {
            let mut telemetry = Telemetry::new(config);
            let layout = config.layout();
            let mut decoder = Decoder::<{ MAX_PAYLOAD + CRC_BYTES }>::new();
            let mut seqs = Vec::new();
            let mut line = [0; MAX_TO_HOST_FRAME];
            loop {
                let finished = done.load(Ordering::Acquire);
                let n = telemetry.transmit(&mut line, &mut telemetry_ends);
                for byte in &line[..n] {
                    let Some(payload) = decoder.feed(*byte) else { continue };
                    match message::read_to_host(payload.unwrap(), Some(&layout)).unwrap() {
                        ToHost::Sample(sample) => seqs.push(sample.seq),
                        ToHost::Report(protocol::Report::Accepted { .. }) => {
                            accepted.fetch_add(1, Ordering::AcqRel);
                        }
                        ToHost::Report(_) => {}
                    }
                }
                if finished && n == 0 {
                    return seqs;
                }
                std::thread::yield_now();
            }
        });
        let mut control = ControlLoop::new(config);
        let mut inputs = Inputs::default();
        inputs.encoders[..3].fill(Some(0));
        let mut k = 0;
        // Until enough happened beside it, but not for ever.
        while k < TICKS || (accepted.load(Ordering::Acquire) < 10 && k < 100 * TICKS) {
            inputs.gyros[0] = GyroInput::Words([k as i16, 0, 1]);
            control.tick(1000 * k, &inputs, &mut tick_ends);
            // A test cannot hold a period; it holds what matters: the reader keeps up.
            while !tick_ends.samples.ready() {
                std::thread::yield_now();
            }
            k += 1;
        }
        done.store(true, Ordering::Release);
        (reader.join().unwrap(), k)
    });
    assert!(accepted.into_inner() >= 10, "requests were answered meanwhile");
    assert_eq!(seqs, (0..ticks).collect::<Vec<_>>());
}

/// A robot of integers: every bit of what the loop does with it is fixed.
struct IntegerRobot {
    position: [i64; 3],
    speed: [i64; 3],
}

impl IntegerRobot {
    fn inputs(&mut self, k: u32) -> Inputs {
        let mut inputs = Inputs { last_execution_us: 30 + k % 7, ..Inputs::default() };
        for joint in 0..3 {
            inputs.encoders[joint] = Some((self.position[joint] >> 12) as i32);
        }
        // On the first body: 64 steps a count and millisecond about z, and noise.
        let noise = (k.wrapping_mul(2_654_435_761) >> 30) as i16;
        inputs.gyros[0] = GyroInput::Words([noise, -noise, (self.speed[0] >> 6) as i16 ^ noise]);
        inputs
    }

    /// Duty of 1 makes 5.7 counts/ms² at rest and 28 counts/ms in the end, as on Doggy.
    fn advance(&mut self, duty: &[protocol::Duty; MAX_JOINTS]) {
        for joint in 0..3 {
            self.speed[joint] += i64::from(duty[joint].0) * 2 - self.speed[joint] / 6;
            self.position[joint] += self.speed[joint];
        }
    }
}

/// Plays a motion on the integer robot; the checksum over every sample and output of it.
fn fingerprint(motion: &Motion, ticks: u32) -> (u32, Sample) {
    let config = config(3);
    let mut control = ControlLoop::new(&config);
    let mut receiver = Receiver::new();
    let mut queues = Queues::new();
    let mut robot = IntegerRobot { position: [0; 3], speed: [0; 3] };
    let mut requests = vec![Command::Stream { on: true }, Command::SetZero];
    let id = MotionId(1);
    requests.push(Command::UploadBegin { motion: id, header: motion.header(), segments: motion.segments.len() as u8 });
    let segment =
        |(index, segment): (u8, &protocol::Segment)| Command::UploadSegment { index, segment: segment.clone() };
    requests.extend((0..).zip(&motion.segments).map(segment));
    requests.push(Command::UploadEnd { checksum: motion.checksum() });
    requests.push(Command::Start { motion: id, at_seq: Some(1000) });
    let mut requests = (1u8..=255).zip(requests);

    let mut sum = 0;
    let mut last = Sample::default();
    for k in 0..ticks {
        let (mut ends, mut out, mut commands) = queues.split();
        if k.is_multiple_of(20) {
            let heartbeat = Heartbeat { count: k as u16, seen_seq: k };
            receiver.receive(&frame(&ToDevice::Heartbeat(heartbeat)), &mut commands);
        } else if k > 20
            && k.is_multiple_of(4)
            && let Some((id, command)) = requests.next()
        {
            receiver.receive(&frame(&ToDevice::Request { id, command }), &mut commands);
        }
        let inputs = robot.inputs(k);
        let outputs = control.tick(k * 1000, &inputs, &mut ends);
        robot.advance(&outputs.duty);
        while out.replies.dequeue().is_some() {}
        while let Some(sample) = out.samples.dequeue() {
            let mut bytes = [0; 4 + 200];
            bytes[..4].copy_from_slice(&u32::to_le_bytes(sum));
            let n = sample.write(&config.layout(), &mut bytes[4..]).unwrap();
            sum = crc32(&bytes[..4 + n]);
            last = sample;
        }
    }
    (sum, last)
}

/// The same inputs give the same bytes on every machine: this number must come out of every build.
#[test]
fn the_fingerprint_of_a_run_is_fixed() {
    let (sum, last) = fingerprint(&preset::calibration(&limits(3)), 100_000);
    assert_eq!(last.phase, protocol::sample::NO_PHASE, "the motion was played to its end");
    assert!(!last.flags.contains(protocol::Flags::FAULT), "{last:?}");
    assert_eq!(sum, 0x041a_b3b3, "is {sum:#010x}");
}

/// The log goes out piece by piece behind the samples, one in 20 ticks, and waits while there are none.
#[test]
fn the_log_follows_the_samples() {
    let config = config(3);
    let mut control = ControlLoop::new(&config);
    let mut telemetry = Telemetry::new(&config);
    let mut receiver = Receiver::new();
    let mut queues = Queues::new();
    // Frames of 63 and 100 bytes, each with its delimiter.
    let said: Vec<u8> = [62, 99].into_iter().flat_map(|n| (1..=n).chain([0])).collect();
    let (mut taken, mut pieces, mut heard) = (0, Vec::new(), Vec::<u8>::new());
    let mut line = [0; MAX_TO_HOST_FRAME];
    for k in 0..1000u32 {
        let (mut tick_ends, mut telemetry_ends, mut commands) = queues.split();
        let switch = |on| frame(&ToDevice::Request { id: k as u8, command: Command::Stream { on } });
        match k {
            100 => receiver.receive(&switch(true), &mut commands),
            150 => receiver.receive(&switch(false), &mut commands),
            500 => receiver.receive(&switch(true), &mut commands),
            _ => {}
        }
        control.tick(k * 1000, &Inputs::default(), &mut tick_ends);
        while telemetry.transmit(&mut line, &mut telemetry_ends) > 0 {}
        let n = telemetry.transmit_log(&mut line, |out| {
            let n = out.len().min(said.len() - taken);
            out[..n].copy_from_slice(&said[taken..taken + n]);
            taken += n;
            n
        });
        let mut decoder = Decoder::<{ MAX_PAYLOAD + CRC_BYTES }>::new();
        for byte in &line[..n] {
            let Some(payload) = decoder.feed(*byte) else { continue };
            let ToHost::Report(protocol::Report::Defmt { at, bytes }) =
                message::read_to_host(payload.unwrap(), None).unwrap()
            else {
                panic!("not a piece of the log")
            };
            assert_eq!(at as usize, heard.len());
            heard.extend(&bytes);
            pieces.push((k, bytes.len(), bytes[0] == 0));
        }
    }
    // 50 samples of the first stream carry two pieces, and ten that are left count for the second one.
    // A piece at the beginning of a frame opens with the delimiter.
    assert_eq!(pieces, [(119, 64, true), (139, 64, true), (509, 37, false)]);
    assert_eq!([&heard[1..64], &heard[65..]].concat(), said);
}
