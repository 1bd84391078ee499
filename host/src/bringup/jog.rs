//! One jog and what the sensors make of it.
//!
//! ```text
//!   rest ──▶ gyros' zeros        jog ──▶ Σ words · Δt, counts ──▶ beyond the guard: stop    settle ──▶ means of the tail
//! ```
//!
//! From rest to rest a link moves as far as its motor, whatever its belt does between.

use std::f64::consts::TAU;
use std::time::Duration;

use protocol::{Duty, EventKind, Fault, Flags, Hello, Sample};

use crate::link::{Arrival, Device, LinkError};

/// Samples from which the gyros' zeros are taken first.
const FIRST_REST: usize = 500;
/// A tail of so many samples in which nothing moves is rest: longer than a belt's swing, which it then averages.
const TAIL: usize = 300;
/// Where a link swings on for long, the mean of so many samples stands for its rest.
const LONG_TAIL: usize = 500;
/// Longest time until rest, samples.
const LONGEST_SETTLING: usize = 2500;
/// A body that turns to and fro by less in a tail is at rest, rad: noise of a gyro adds up to a tenth of it.
const REST_RAD: f64 = 4e-4;
/// A jog that has moved a joint by so much is ended, rad.
const GUARD_RAD: f64 = 0.04;
/// How long no sample may come: a busy machine may stand still for a while, and the firmware ends a jog by itself.
const PATIENCE: Duration = Duration::from_secs(5);

/// What the sensors make of a jog.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Response {
    /// By encoder: how far its joint went by the device's scales, rad or m.
    pub moved: Vec<f64>,
    /// By encoder: lowest and highest count on the way, from that at the start, and how often it changed.
    pub counted: Vec<Counted>,
    /// By gyro: the angle that it turned by, as a vector in its axes, rad.
    pub turned: Vec<[f64; 3]>,
    /// What ended the jog early.
    pub fault: Option<Fault>,
}

/// Counts of an encoder during a jog.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counted {
    /// Lowest, from the start.
    pub lowest: i32,
    /// Highest, from the start.
    pub highest: i32,
    /// Samples with another count than the one before.
    pub changes: u32,
}

/// A device whose joints are jogged.
pub(super) struct Jogger<'a> {
    device: &'a mut Device,
    /// By encoder, rad or m a count.
    per_count: Vec<f64>,
    /// By gyro, rad/s a word.
    per_word: Vec<f64>,
    /// By gyro: its words at rest.
    zero: Vec<[f64; 3]>,
    last: Option<(u64, Sample)>,
}

/// A sample after a jog, and what the gyros have turned by until then.
struct Settling {
    sample: Sample,
    turned: Vec<[f64; 3]>,
}

/// Sums along the way of a jog.
struct Way {
    start: Sample,
    last_us: u64,
    last: Sample,
    turned: Vec<[f64; 3]>,
    counted: Vec<Counted>,
}

impl<'a> Jogger<'a> {
    /// Starts the stream and takes the gyros' zeros. Nothing may move the robot meanwhile.
    pub fn new(device: &'a mut Device) -> Result<Self, LinkError> {
        device.stream()?;
        let hello = device.hello();
        let mut jogger = Self {
            per_count: hello.encoders.iter().map(|e| TAU / (f64::from(e.counts_per_turn) * e.gear)).collect(),
            per_word: hello.gyros.iter().map(|gyro| gyro.rad_s_per_lsb).collect(),
            zero: vec![[0.0; 3]; hello.gyros.len()],
            last: None,
            device,
        };
        let mut rest = Vec::with_capacity(FIRST_REST);
        while rest.len() < FIRST_REST {
            if let (Some(sample), _) = jogger.next()? {
                rest.push(sample.1);
            }
        }
        jogger.zero = jogger.words(&rest);
        Ok(jogger)
    }

    /// The device's handshake.
    pub fn hello(&self) -> &Hello {
        self.device.hello()
    }

    /// Words of the gyros at rest, rad/s.
    pub fn biases_rad_s(&self) -> Vec<[f64; 3]> {
        self.zero.iter().zip(&self.per_word).map(|(zero, scale)| zero.map(|word| word * scale)).collect()
    }

    /// Jogs a joint (from 0) by a duty (−1 … 1) for so long, and waits until the robot rests. A fault is cleared.
    pub fn jog(&mut self, joint: usize, duty: f64, duration_ms: u8) -> Result<Response, LinkError> {
        let Some((start_us, start)) = self.last else { return Err(LinkError::Silent { waited: PATIENCE }) };
        self.device.jog(joint as u8, Duty::from_fraction(duty as f32), duration_ms)?;
        let mut way = Way {
            start,
            last_us: start_us,
            last: start,
            turned: vec![[0.0; 3]; self.zero.len()],
            counted: vec![Counted::default(); self.per_count.len()],
        };
        let (mut fault, mut over, mut stopped) = (None, false, false);
        let mut tail: Vec<Settling> = Vec::new();
        // The jog itself, and until its end is told; the event may be lost on the line.
        let mut left = usize::from(duration_ms) + 300;
        loop {
            let (sample, event) = self.next()?;
            match event {
                Some(EventKind::JogEnded { .. }) => over = true,
                Some(EventKind::FaultRaised(raised)) => (fault, over) = (Some(raised), true),
                _ => {}
            }
            let Some((t_us, sample)) = sample else { continue };
            self.follow(&mut way, t_us, sample);
            if !stopped && !over && self.farthest(&way) > GUARD_RAD {
                self.device.stop()?;
                stopped = true;
            }
            left = left.saturating_sub(1);
            if !over && left > 0 {
                continue;
            }
            tail.push(Settling { sample, turned: way.turned.clone() });
            if tail.len() >= LONGEST_SETTLING || self.rests(&tail) {
                break;
            }
        }
        let length = if self.rests(&tail) { TAIL } else { LONG_TAIL };
        let tail = &tail[tail.len().saturating_sub(length)..];
        let mean = |value: &dyn Fn(&Settling) -> f64| tail.iter().map(value).sum::<f64>() / tail.len() as f64;
        let moved = self.per_count.iter().enumerate().map(|(index, per_count)| {
            let from = start.encoders[index];
            mean(&|settling| f64::from(settling.sample.encoders[index].wrapping_sub(from))) * per_count
        });
        let turned =
            (0..self.zero.len()).map(|gyro| std::array::from_fn(|axis| mean(&|settling| settling.turned[gyro][axis])));
        let response = Response { moved: moved.collect(), turned: turned.collect(), counted: way.counted, fault };
        if let Some(fault) = fault {
            if fault == Fault::EmergencyStop {
                return Err(LinkError::EmergencyStop);
            }
            self.device.clear_fault()?;
        }
        if length == TAIL {
            let rest: Vec<Sample> = tail.iter().map(|settling| settling.sample).collect();
            // Zeros drift: each rest counts for a quarter of what is known.
            for (zero, now) in self.zero.iter_mut().zip(words_of(&rest, self.per_word.len())) {
                *zero = std::array::from_fn(|axis| 0.75 * zero[axis] + 0.25 * now[axis]);
            }
        }
        Ok(response)
    }

    /// The next sample or event of the device.
    #[allow(clippy::type_complexity, reason = "one of the two, seen by the loop above only")]
    fn next(&mut self) -> Result<(Option<(u64, Sample)>, Option<EventKind>), LinkError> {
        match self.device.next(PATIENCE)? {
            None => Err(LinkError::Silent { waited: PATIENCE }),
            Some(Arrival::Sample { t_us, sample, .. }) => {
                self.last = Some((t_us, *sample));
                Ok((self.last, None))
            }
            Some(Arrival::Event { kind, .. }) => Ok((None, Some(kind))),
            Some(Arrival::Loss(_) | Arrival::Log { .. } | Arrival::Defmt { .. }) => Ok((None, None)),
        }
    }

    /// Adds a sample to the sums. A stale gyro has turned by nothing.
    fn follow(&self, way: &mut Way, t_us: u64, sample: Sample) {
        let passed_s = t_us.saturating_sub(way.last_us) as f64 * 1e-6;
        for (gyro, turned) in way.turned.iter_mut().enumerate() {
            if sample.flags.contains(Flags::gyro_stale(gyro)) {
                continue;
            }
            for (axis, turned) in turned.iter_mut().enumerate() {
                *turned += self.rate_rad_s(&sample, gyro, axis) * passed_s;
            }
        }
        for (index, counted) in way.counted.iter_mut().enumerate() {
            let from_start = sample.encoders[index].wrapping_sub(way.start.encoders[index]);
            counted.lowest = counted.lowest.min(from_start);
            counted.highest = counted.highest.max(from_start);
            counted.changes += u32::from(sample.encoders[index] != way.last.encoders[index]);
        }
        (way.last_us, way.last) = (t_us, sample);
    }

    fn rate_rad_s(&self, sample: &Sample, gyro: usize, axis: usize) -> f64 {
        (f64::from(sample.gyros[gyro][axis]) - self.zero[gyro][axis]) * self.per_word[gyro]
    }

    /// How far a joint or a body is from where it was at the start, at most; rad.
    fn farthest(&self, way: &Way) -> f64 {
        let moved = |(index, per_count): (usize, &f64)| {
            f64::from(way.last.encoders[index].wrapping_sub(way.start.encoders[index])) * per_count
        };
        let moved = self.per_count.iter().enumerate().map(moved).map(f64::abs);
        moved.chain(way.turned.iter().map(|turned| length(*turned))).fold(0.0, f64::max)
    }

    /// Whether the last samples are rest: no encoder goes on, no gyro turns.
    fn rests(&self, tail: &[Settling]) -> bool {
        let Some(last) = tail.len().checked_sub(TAIL).map(|from| &tail[from..]) else { return false };
        let still = (0..self.per_count.len()).all(|index| {
            let from = last[0].sample.encoders[index];
            let counts = last.iter().map(|settling| settling.sample.encoders[index].wrapping_sub(from));
            let (low, high) = counts.fold((0, 0), |(low, high), count| (count.min(low), count.max(high)));
            high - low <= 3
        });
        let turns_no_more = |gyro: usize| {
            let part = |axis: usize| last.iter().map(move |settling| settling.turned[gyro][axis]);
            let span = |axis: usize| part(axis).fold(f64::MIN, f64::max) - part(axis).fold(f64::MAX, f64::min);
            (0..3).all(|axis| span(axis) < REST_RAD)
        };
        still && (0..self.zero.len()).all(turns_no_more)
    }

    fn words(&self, samples: &[Sample]) -> Vec<[f64; 3]> {
        words_of(samples, self.per_word.len())
    }
}

impl Drop for Jogger<'_> {
    fn drop(&mut self) {
        // Whatever ended it: the stream ends with it, if the line still answers.
        if let Err(error) = self.device.end_stream() {
            tracing::debug!("the stream could not be ended: {error}");
        }
    }
}

/// Mean words of each gyro.
fn words_of(samples: &[Sample], gyros: usize) -> Vec<[f64; 3]> {
    let mean = |gyro: usize, axis: usize| {
        samples.iter().map(|sample| f64::from(sample.gyros[gyro][axis])).sum::<f64>() / samples.len().max(1) as f64
    };
    (0..gyros).map(|gyro| std::array::from_fn(|axis| mean(gyro, axis))).collect()
}

/// Length of a vector.
pub(super) fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}
