//! What a device shows at the moment: arrivals of its stream in, a picture out a few times a second.
//!
//! ```text
//!   Device::next ─▶ Watch::take (every tick) ─▶ Watch::picture (now and then) ─▶ whoever draws, in a thread of its own
//! ```
//!
//! The picture owns what it shows. So the screen, however slow, holds up neither the line nor the heartbeats.

use std::f64::consts::TAU;

use protocol::{EventKind, Fault, Flags, Hello, Sample, Side, State, Status};
use serde::Serialize;

use crate::link::Arrival;
use crate::recording::LossBalance;

/// Follows a stream.
#[derive(Debug)]
pub struct Watch {
    hello: Hello,
    state: State,
    /// Counts of the first sample: angles are from there while no zero is known.
    first: Option<Sample>,
    last: Option<(u64, Sample)>,
    since: Since,
}

/// What came since the last picture.
#[derive(Debug, Default)]
struct Since {
    samples: u64,
    first_us: Option<u64>,
    execution_sum_us: u64,
    execution_max_us: u32,
    jitter_max_us: i8,
    flags: u16,
    counts: Vec<i32>,
}

/// A device at one moment. Angles and speeds are those of the joint, by encoder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Device time of the last sample, s.
    pub t_s: f64,
    /// What the device is doing, in words.
    pub state: String,
    /// Whether the emergency stop is pressed, or its wire broken.
    pub stop_pressed: bool,
    /// Whether zero positions are known; if not, angles are from where the joints stood at the first sample.
    pub zeroed: bool,
    /// Encoders in the sample's order.
    pub encoders: Vec<EncoderNow>,
    /// Gyros in the sample's order.
    pub gyros: Vec<GyroNow>,
    /// Duty of each joint, −1 … 1.
    pub duty: Vec<f64>,
    /// Names of the flags that were set since the last picture.
    pub flags: Vec<String>,
    /// Samples a second of device time since the last picture.
    pub rate_hz: f64,
    /// Largest lateness of a tick since the last picture, µs; 127 for that much or more.
    pub jitter_max_us: i8,
    /// Mean time that a tick took, µs.
    pub execution_mean_us: f64,
    /// Longest time that a tick took, µs.
    pub execution_max_us: u32,
    /// Where samples were lost.
    pub balance: LossBalance,
}

/// An encoder at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EncoderNow {
    /// Joint, from 1.
    pub joint: u8,
    /// `motor` or `link`.
    pub side: &'static str,
    /// Raw counts.
    pub counts: i32,
    /// Position of the joint, rad or m.
    pub angle_rad: f64,
    /// Mean speed since the last picture, rad/s or m/s.
    pub speed_rad_s: f64,
}

/// A gyro at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GyroNow {
    /// Joint (from 1) that moves the body that it sits on.
    pub body: u8,
    /// Raw words x, y, z.
    pub words: [i16; 3],
    /// The same, rad/s in the sensor's axes.
    pub rate_rad_s: [f64; 3],
}

impl Watch {
    /// Begins with what handshake and status tell.
    pub fn new(hello: &Hello, status: &Status) -> Self {
        Self { hello: hello.clone(), state: status.state, first: None, last: None, since: Since::default() }
    }

    /// Takes what the device sent.
    pub fn take(&mut self, arrival: &Arrival) {
        match arrival {
            Arrival::Sample { t_us, sample, .. } => self.sample(*t_us, sample),
            Arrival::Event { kind, .. } => self.event(kind),
            Arrival::Loss(_) | Arrival::Log { .. } | Arrival::Defmt { .. } => {}
        }
    }

    fn sample(&mut self, t_us: u64, sample: &Sample) {
        self.first.get_or_insert(*sample);
        let since = &mut self.since;
        if since.first_us.is_none() {
            let (from_us, from) = self.last.as_ref().map_or((t_us, sample), |(t_us, last)| (*t_us, last));
            since.first_us = Some(from_us);
            since.counts = from.encoders.to_vec();
        }
        since.samples += 1;
        since.execution_sum_us += u64::from(sample.execution_us());
        since.execution_max_us = since.execution_max_us.max(sample.execution_us());
        since.jitter_max_us = since.jitter_max_us.max(sample.jitter_us.saturating_abs());
        since.flags |= sample.flags.bits();
        self.last = Some((t_us, *sample));
    }

    fn event(&mut self, kind: &EventKind) {
        match kind {
            EventKind::MotionStarted(_) => self.state = State::Running { phase: 0 },
            EventKind::MotionEnded { .. } | EventKind::JogEnded { .. } => {
                if !matches!(self.state, State::Fault(_)) {
                    self.state = State::Idle;
                }
            }
            EventKind::FaultRaised(fault) => self.state = State::Fault(*fault),
            EventKind::FaultCleared => self.state = State::Idle,
            EventKind::Started(_) | EventKind::ZeroSet | EventKind::MoveTimedOut { .. } => {}
        }
    }

    /// What there is to see now; `None` before the first sample. What is told of a stretch of time begins anew.
    pub fn picture(&mut self, balance: LossBalance) -> Option<Picture> {
        let since = std::mem::take(&mut self.since);
        let (t_us, sample) = self.last.as_ref()?;
        let duration_s = since.first_us.map_or(0.0, |first| (t_us - first) as f64 * 1e-6);
        let per_s = |number: f64| if duration_s > 0.0 { number / duration_s } else { 0.0 };
        let layout = &self.hello.layout;
        let encoders = self.hello.encoders.iter().enumerate().map(|(index, encoder)| {
            let per_count = TAU / (f64::from(encoder.counts_per_turn) * encoder.gear);
            let counts = sample.encoders[index];
            let first = self.first.as_ref().map_or(counts, |first| first.encoders[index]);
            let zero = self.hello.zero.as_ref().and_then(|zero| zero.get(index).copied()).unwrap_or(first);
            let before = since.counts.get(index).copied().unwrap_or(counts);
            EncoderNow {
                joint: encoder.joint + 1,
                side: if encoder.side == Side::Motor { "motor" } else { "link" },
                counts,
                angle_rad: f64::from(counts.wrapping_sub(zero)) * per_count,
                speed_rad_s: per_s(f64::from(counts.wrapping_sub(before)) * per_count),
            }
        });
        let gyros = self.hello.gyros.iter().zip(&sample.gyros).map(|(gyro, words)| GyroNow {
            body: gyro.body + 1,
            words: *words,
            rate_rad_s: words.map(|word| f64::from(word) * gyro.rad_s_per_lsb),
        });
        let flags = Flags::from_bits_truncate(since.flags | sample.flags.bits());
        Some(Picture {
            t_s: *t_us as f64 * 1e-6,
            state: words(self.state),
            stop_pressed: sample.flags.contains(Flags::STOP_PRESSED),
            zeroed: self.hello.zero.is_some(),
            encoders: encoders.collect(),
            gyros: gyros.collect(),
            duty: sample.duty.iter().take(layout.joints()).map(|duty| f64::from(duty.fraction())).collect(),
            flags: flags.iter_names().map(|(name, _)| name.to_lowercase()).collect(),
            rate_hz: per_s(since.samples as f64),
            jitter_max_us: since.jitter_max_us,
            execution_mean_us: since.execution_sum_us as f64 / since.samples.max(1) as f64,
            execution_max_us: since.execution_max_us,
            balance,
        })
    }
}

fn words(state: State) -> String {
    match state {
        State::Idle => "idle".to_owned(),
        State::Waiting { .. } => "waiting for its start".to_owned(),
        State::Running { .. } => "in motion".to_owned(),
        State::Jogging { joint } => format!("jogging joint {}", joint + 1),
        State::Fault(Fault::EmergencyStop) => "fault: the emergency stop was pressed".to_owned(),
        State::Fault(fault) => format!("fault: {fault}"),
    }
}

#[cfg(test)]
mod tests {
    use protocol::{EncoderInfo, GyroInfo, Identity, Layout, MotionId, ResetReason};

    use super::*;

    fn hello() -> Hello {
        Hello {
            identity: Identity::ours("0.1.0", "arm"),
            layout: Layout::new(1, 1, 1).unwrap(),
            tick_us: 1000,
            encoders: [EncoderInfo { joint: 0, side: Side::Motor, counts_per_turn: -100, gear: 10.0, offset_us: 0 }]
                .into_iter()
                .collect(),
            gyros: [GyroInfo {
                body: 0,
                rad_s_per_lsb: 0.001,
                saturated_at: 32_700,
                offset_us: 0,
                filter_delay_us: None,
                output_rate_hz: None,
            }]
            .into_iter()
            .collect(),
            zero: None,
            reset: ResetReason::PowerOn,
            panic: None,
            description: Default::default(),
            code_crc: None,
        }
    }

    fn status() -> Status {
        let motion = MotionId::NONE;
        Status { state: State::Idle, streaming: true, first_seq: 0, end_seq: 0, dropped: 0, motion, last_end: None }
    }

    fn sample(k: u64, counts: i32, flags: Flags) -> Arrival {
        let mut sample = Sample { seq: k as u32, t_us: 1000 * k as u32, flags, execution: 10, ..Sample::default() };
        sample.encoders[0] = counts;
        sample.gyros[0] = [0, -100, 7];
        sample.jitter_us = if k == 3 { -9 } else { 1 };
        Arrival::Sample { seq: k, t_us: 1000 * k, sample: Box::new(sample) }
    }

    #[test]
    fn a_picture_shows_the_last_sample_and_what_happened_since_the_one_before() {
        let mut watch = Watch::new(&hello(), &status());
        assert_eq!(watch.picture(LossBalance::default()), None);
        (0..=100).for_each(|k| watch.take(&sample(k, 50 - k as i32, Flags::empty())));
        let picture = watch.picture(LossBalance::default()).unwrap();
        // 100 counts a turn backwards, gear 10: −100 counts are 0.1 turn of the joint, in 0.1 s.
        assert!((picture.encoders[0].angle_rad - 0.1 * TAU).abs() < 1e-12, "{picture:?}");
        assert!((picture.encoders[0].speed_rad_s - TAU).abs() < 1e-9, "{picture:?}");
        assert_eq!(picture.gyros[0].rate_rad_s, [0.0, -0.1, 0.007]);
        assert_eq!((picture.jitter_max_us, picture.execution_max_us, picture.execution_mean_us), (9, 40, 40.0));
        assert!(!picture.stop_pressed && !picture.zeroed);

        (101..=200).for_each(|k| watch.take(&sample(k, -50, Flags::STOP_PRESSED | Flags::FAULT)));
        watch.take(&Arrival::Event { seq: 101, t_us: 101_000, kind: EventKind::FaultRaised(Fault::EmergencyStop) });
        let picture = watch.picture(LossBalance::default()).unwrap();
        assert_eq!(picture.flags, ["fault", "stop_pressed"]);
        assert!(picture.stop_pressed && picture.state.contains("emergency stop"), "{picture:?}");
        assert!((picture.rate_hz - 1000.0).abs() < 1e-9, "{picture:?}");
        assert_eq!((picture.encoders[0].speed_rad_s, picture.jitter_max_us), (0.0, 1));
    }
}
