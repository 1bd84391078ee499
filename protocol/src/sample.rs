//! The sample: what one tick read, and the duty in force, in a fixed number of bytes.
//!
//! Doggy's frame (3 joints, 3 encoders, 2 gyros), little-endian; 49 bytes, 55 on the line:
//!
//! ```text
//!  0    1        5        9            21            33         37         43     44    45    47   48    49
//!  │0x53│ seq u32│ t_us   │ counts i32 │ words i16   │ ages i16 │ duty i16 │motion│phase│flags│exec│jitter│
//!  │tag │        │ u32    │ 3×         │ 2 gyros × 3 │ 2 gyros  │ 3×       │ u8   │ u8  │ u16 │ u8 │ i8   │
//! ```
//!
//! Time of a tick:
//!
//! ```text
//!   t_k           t_k + offsets                                t_{k+1}
//!   │ sensors read │ compute │ duty for tick k+1 preloaded      │ it becomes active
//!   ├──────────── duty in Sample k is in force ────────────────┤
//! ```

use postcard_schema::{
    Schema,
    schema::{DataModelType, NamedType},
};
use serde::{Deserialize, Serialize};

use crate::{
    MAX_ENCODERS, MAX_GYROS, MAX_JOINTS,
    units::{Duty, MotionId},
};

/// First byte of a sample's payload.
pub const TAG: u8 = 0x53;
/// [`Sample::phase`] outside of a motion.
pub const NO_PHASE: u8 = 0xff;
/// Step of [`Sample::execution`], µs.
pub const EXECUTION_STEP_US: u32 = 4;
/// Longest payload of a sample.
pub const MAX_SAMPLE_PAYLOAD: usize = Layout::WIDEST.payload_len();

/// How many of each a sample carries. Fixed for a device, told in its handshake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(try_from = "LayoutFields")]
pub struct Layout {
    joints: u8,
    encoders: u8,
    gyros: u8,
}

/// A layout as received, not yet looked at.
#[derive(Deserialize)]
struct LayoutFields {
    joints: u8,
    encoders: u8,
    gyros: u8,
}

impl TryFrom<LayoutFields> for Layout {
    type Error = LayoutError;
    fn try_from(f: LayoutFields) -> Result<Self, LayoutError> {
        Self::new(f.joints, f.encoders, f.gyros)
    }
}

/// A layout that no sample can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
#[error(
    "{joints} joints, {encoders} encoders, {gyros} gyros: possible are 1–{MAX_JOINTS} joints, \
     1–{MAX_ENCODERS} encoders, 0–{MAX_GYROS} gyros"
)]
pub struct LayoutError {
    joints: u8,
    encoders: u8,
    gyros: u8,
}

impl Layout {
    /// Three joints with motor encoders, two gyros.
    pub const DOGGY: Self = Self { joints: 3, encoders: 3, gyros: 2 };
    /// As many of each as there can be.
    pub const WIDEST: Self = Self { joints: MAX_JOINTS as u8, encoders: MAX_ENCODERS as u8, gyros: MAX_GYROS as u8 };

    /// A layout of so many joints (each has a duty), encoders and gyros.
    ///
    /// # Errors
    /// [`LayoutError`] outside of the bounds of this protocol.
    pub const fn new(joints: u8, encoders: u8, gyros: u8) -> Result<Self, LayoutError> {
        if joints == 0
            || encoders == 0
            || joints > Self::WIDEST.joints
            || encoders > Self::WIDEST.encoders
            || gyros > Self::WIDEST.gyros
        {
            return Err(LayoutError { joints, encoders, gyros });
        }
        Ok(Self { joints, encoders, gyros })
    }

    /// Joints, each with a duty.
    pub const fn joints(&self) -> usize {
        self.joints as usize
    }

    /// Encoders: motor side of the joints in order, then link side of those that have one.
    pub const fn encoders(&self) -> usize {
        self.encoders as usize
    }

    /// Gyros, three words and an age each.
    pub const fn gyros(&self) -> usize {
        self.gyros as usize
    }

    /// Bytes of the payload, tag included.
    pub const fn payload_len(&self) -> usize {
        const TAG_SEQ_TIME: usize = 1 + 4 + 4;
        const MOTION_PHASE_FLAGS_EXECUTION_JITTER: usize = 1 + 1 + 2 + 1 + 1;
        TAG_SEQ_TIME + 4 * self.encoders() + 8 * self.gyros() + 2 * self.joints() + MOTION_PHASE_FLAGS_EXECUTION_JITTER
    }
}

bitflags::bitflags! {
    /// What a tick has to say about itself.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Flags: u16 {
        /// The zero positions are known.
        const ZEROED = 1 << 0;
        /// A motion is being played.
        const RUNNING = 1 << 1;
        /// A fault is latched: duty is zero until it is cleared.
        const FAULT = 1 << 2;
        /// A stop took effect inside this tick: the duty fell to zero after the sensors were read.
        const STOPPED = 1 << 3;
        /// The duty was limited because a joint comes near its end.
        const POSITION_LIMITED = 1 << 4;
        /// The duty was limited to its ceiling.
        const DUTY_LIMITED = 1 << 5;
        /// The change of the duty was limited.
        const SLEW_LIMITED = 1 << 6;
        /// The tick before this one overran its period.
        const OVERRUN = 1 << 7;
        /// An encoder gave no new reading in this tick.
        const ENCODER_STALE = 1 << 8;
        /// Gyro 1 gave no new reading in this tick.
        const GYRO1_STALE = 1 << 9;
        /// Gyro 2 gave no new reading in this tick.
        const GYRO2_STALE = 1 << 10;
        /// Gyro 1 is at the end of its range on some axis.
        const GYRO1_SATURATED = 1 << 11;
        /// Gyro 2 is at the end of its range on some axis.
        const GYRO2_SATURATED = 1 << 12;
        /// The emergency stop is pressed in this tick, or its wire is broken.
        const STOP_PRESSED = 1 << 13;
    }
}

impl Flags {
    /// The flag of a stale gyro, by index from 0.
    pub const fn gyro_stale(gyro: usize) -> Self {
        Self::from_bits_truncate(Self::GYRO1_STALE.bits() << if gyro == 0 { 0 } else { 1 })
    }

    /// The flag of a saturated gyro, by index from 0.
    pub const fn gyro_saturated(gyro: usize) -> Self {
        Self::from_bits_truncate(Self::GYRO1_SATURATED.bits() << if gyro == 0 { 0 } else { 1 })
    }
}

/// How long before the tick's time a gyro converted the words that a tick read.
///
/// A gyro converts by its own clock. The end of a conversion is where its "data ready" begins; what the part's filter delays
/// comes on top and stands in the handshake ([`crate::GyroInfo::filter_delay_us`]).
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct GyroAge(i16);

impl GyroAge {
    /// Nobody measured it.
    pub const UNKNOWN: Self = Self(i16::MIN);
    /// Longest age that can be told, µs.
    pub const MAX_US: i32 = i16::MAX as i32;

    /// An age of so many µs, negative where the conversion ended after the tick's time; unknown beyond what can be told.
    pub const fn from_us(us: i32) -> Self {
        if us < -Self::MAX_US || us > Self::MAX_US { Self::UNKNOWN } else { Self(us as i16) }
    }

    /// µs, if it is known.
    pub const fn us(self) -> Option<i32> {
        if self.0 == i16::MIN { None } else { Some(self.0 as i32) }
    }
}

impl Default for GyroAge {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

impl core::fmt::Debug for GyroAge {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.us() {
            Some(us) => write!(f, "{us} µs"),
            None => f.write_str("unknown"),
        }
    }
}

/// What one tick read. Places beyond the [`Layout`] are zero, ages unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// Number of the tick, owned by the control loop: one more every tick, sent or not; from 0 at reset; wraps.
    pub seq: u32,
    /// Device time of the tick, µs; wraps ([`crate::clock`]).
    pub t_us: u32,
    /// Raw encoder counts, extended past the hardware counter; they wrap.
    pub encoders: [i32; MAX_ENCODERS],
    /// Raw gyro words x, y, z.
    pub gyros: [[i16; 3]; MAX_GYROS],
    /// Age of each gyro's words.
    pub gyro_ages: [GyroAge; MAX_GYROS],
    /// Duty in force from this tick to the next.
    pub duty: [Duty; MAX_JOINTS],
    /// The motion being played.
    pub motion: MotionId,
    /// Index into the segments of the motion, or [`NO_PHASE`].
    pub phase: u8,
    /// What this tick has to say about itself.
    pub flags: Flags,
    /// Time that the last tick took, in steps of [`EXECUTION_STEP_US`], 255 for that long or longer.
    pub execution: u8,
    /// How much later than one period after the last tick this one began, µs, at the ends of the range for that much
    /// or more.
    pub jitter_us: i8,
}

/// Why bytes are no sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleError {
    /// Another length than the layout gives.
    #[error("a sample of {got} bytes where {expected} were announced")]
    Length {
        /// By the layout.
        expected: usize,
        /// Received.
        got: usize,
    },
    /// Another first byte.
    #[error("first byte {0:#04x} is not that of a sample")]
    Tag(u8),
    /// Flags that this version does not know.
    #[error("unknown flags in {0:#06x}")]
    Flags(u16),
}

impl Sample {
    /// Writes the payload; returns its length, or `None` if `out` is too small.
    pub fn write(&self, layout: &Layout, out: &mut [u8]) -> Option<usize> {
        let len = layout.payload_len();
        let mut w = Writer(out.get_mut(..len)?);
        w.put([TAG])?;
        w.put(self.seq.to_le_bytes())?;
        w.put(self.t_us.to_le_bytes())?;
        for counts in self.encoders.iter().take(layout.encoders()) {
            w.put(counts.to_le_bytes())?;
        }
        for word in self.gyros.iter().take(layout.gyros()).flatten() {
            w.put(word.to_le_bytes())?;
        }
        for age in self.gyro_ages.iter().take(layout.gyros()) {
            w.put(age.0.to_le_bytes())?;
        }
        for duty in self.duty.iter().take(layout.joints()) {
            w.put(duty.0.to_le_bytes())?;
        }
        w.put([self.motion.0, self.phase])?;
        w.put(self.flags.bits().to_le_bytes())?;
        w.put([self.execution])?;
        w.put(self.jitter_us.to_le_bytes())?;
        Some(len)
    }

    /// Reads a payload of this layout.
    ///
    /// # Errors
    /// [`SampleError`] if length, tag or flags are not those of a sample.
    pub fn read(layout: &Layout, payload: &[u8]) -> Result<Self, SampleError> {
        let wrong_length = SampleError::Length { expected: layout.payload_len(), got: payload.len() };
        if payload.len() != layout.payload_len() {
            return Err(wrong_length);
        }
        Self::fields(layout, Reader(payload)).unwrap_or(Err(wrong_length))
    }

    /// The fields one after the other; `None` if the bytes end early.
    fn fields(layout: &Layout, mut r: Reader<'_>) -> Option<Result<Self, SampleError>> {
        let [tag] = r.take()?;
        if tag != TAG {
            return Some(Err(SampleError::Tag(tag)));
        }
        let mut sample =
            Self { seq: u32::from_le_bytes(r.take()?), t_us: u32::from_le_bytes(r.take()?), ..Self::default() };
        for counts in sample.encoders.iter_mut().take(layout.encoders()) {
            *counts = i32::from_le_bytes(r.take()?);
        }
        for word in sample.gyros.iter_mut().take(layout.gyros()).flatten() {
            *word = i16::from_le_bytes(r.take()?);
        }
        for age in sample.gyro_ages.iter_mut().take(layout.gyros()) {
            *age = GyroAge(i16::from_le_bytes(r.take()?));
        }
        for duty in sample.duty.iter_mut().take(layout.joints()) {
            duty.0 = i16::from_le_bytes(r.take()?);
        }
        let [motion, phase] = r.take()?;
        (sample.motion, sample.phase) = (MotionId(motion), phase);
        let bits = u16::from_le_bytes(r.take()?);
        let Some(flags) = Flags::from_bits(bits) else {
            return Some(Err(SampleError::Flags(bits)));
        };
        sample.flags = flags;
        [sample.execution] = r.take()?;
        sample.jitter_us = i8::from_le_bytes(r.take()?);
        Some(Ok(sample))
    }

    /// [`Sample::execution`] of so many microseconds.
    pub const fn execution_of(us: u32) -> u8 {
        let steps = us / EXECUTION_STEP_US;
        if steps > 255 { 255 } else { steps as u8 }
    }

    /// Time that the last tick took, µs; 1020 stands for that long or longer.
    pub const fn execution_us(&self) -> u32 {
        self.execution as u32 * EXECUTION_STEP_US
    }
}

/// Fills a slice from the front.
struct Writer<'a>(&'a mut [u8]);

impl Writer<'_> {
    fn put<const N: usize>(&mut self, bytes: [u8; N]) -> Option<()> {
        let (head, rest) = core::mem::take(&mut self.0).split_first_chunk_mut::<N>()?;
        *head = bytes;
        self.0 = rest;
        Some(())
    }
}

/// Empties a slice from the front.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*head)
    }
}

/// What the schema key says about the sample, whose bytes are written by hand: change it with them.
impl Schema for Sample {
    const SCHEMA: &'static NamedType = &NamedType {
        name: "Sample: tag seq t_us counts words ages duty motion phase flags:0x3fff execution/4us jitter_us, fixed, LE, 1",
        ty: &DataModelType::ByteArray,
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_doggy_sample_has_its_bytes_where_the_diagram_says() {
        let mut sample = Sample {
            seq: 0x0403_0201,
            t_us: 0x0807_0605,
            motion: MotionId(0x29),
            phase: 0x2a,
            flags: Flags::RUNNING | Flags::GYRO2_SATURATED,
            execution: 0x2d,
            jitter_us: -1,
            ..Sample::default()
        };
        for (i, counts) in sample.encoders[..3].iter_mut().enumerate() {
            *counts = 0x0c0b_0a09 + 0x0404_0404 * i as i32;
        }
        sample.gyros = [[0x1615, 0x1817, 0x1a19], [0x1c1b, 0x1e1d, 0x201f]];
        sample.gyro_ages = [GyroAge::from_us(0x2221), GyroAge::from_us(0x2423)];
        sample.duty[..3].copy_from_slice(&[Duty(0x2625), Duty(0x2827), Duty(0x2a29)]);
        let mut out = [0; 49];
        assert_eq!(sample.write(&Layout::DOGGY, &mut out), Some(49));
        let mut expected: Vec<u8> = (0..43).collect();
        expected[0] = TAG;
        expected.extend([0x29, 0x2a, 0x02, 0x10, 0x2d, 0xff]);
        assert_eq!(out[..], expected);
        assert_eq!(sample.write(&Layout::DOGGY, &mut [0; 48]), None);
    }

    /// Any sample of a layout.
    pub(crate) fn any_sample(layout: Layout) -> impl Strategy<Value = Sample> {
        (
            (any::<u32>(), any::<u32>(), any::<[i32; MAX_ENCODERS]>()),
            (any::<[([i16; 3], i16); MAX_GYROS]>(), any::<[i16; MAX_JOINTS]>()),
            (any::<u8>(), any::<u8>(), any::<u16>(), any::<u8>(), any::<i8>()),
        )
            .prop_map(move |((seq, t_us, mut encoders), (mut gyros, duty), rest)| {
                encoders[layout.encoders()..].fill(0);
                gyros[layout.gyros()..].fill(([0; 3], i16::MIN));
                let mut duty = duty.map(Duty);
                duty[layout.joints()..].fill(Duty::ZERO);
                let (motion, phase, flags, execution, jitter_us) = rest;
                Sample {
                    seq,
                    t_us,
                    encoders,
                    gyros: gyros.map(|(words, _)| words),
                    gyro_ages: gyros.map(|(_, age)| GyroAge(age)),
                    duty,
                    motion: MotionId(motion),
                    phase,
                    flags: Flags::from_bits_truncate(flags),
                    execution,
                    jitter_us,
                }
            })
    }

    fn any_layout() -> impl Strategy<Value = Layout> {
        (1..=7u8, 1..=14u8, 0..=2u8).prop_map(|(j, e, g)| Layout::new(j, e, g).unwrap())
    }

    proptest! {
        #[test]
        fn samples_come_back(
            (layout, sample) in any_layout().prop_flat_map(|l| (Just(l), any_sample(l))),
        ) {
            let mut out = [0; MAX_SAMPLE_PAYLOAD];
            let n = sample.write(&layout, &mut out).unwrap();
            prop_assert_eq!(n, layout.payload_len());
            prop_assert_eq!(Sample::read(&layout, &out[..n]), Ok(sample));
        }

        #[test]
        fn any_bytes_are_survived(layout in any_layout(), bytes: Vec<u8>) {
            let _ = Sample::read(&layout, &bytes);
        }
    }

    #[test]
    fn another_length_tag_or_flag_is_refused() {
        let mut bytes = [0; 49];
        let layout = Layout::DOGGY;
        Sample::default().write(&layout, &mut bytes).unwrap();
        assert_eq!(Sample::read(&layout, &bytes[..48]), Err(SampleError::Length { expected: 49, got: 48 }));
        bytes[46] = 0x80;
        assert_eq!(Sample::read(&layout, &bytes), Err(SampleError::Flags(0x8000)));
        bytes[0] = 1;
        assert_eq!(Sample::read(&layout, &bytes), Err(SampleError::Tag(1)));
    }

    #[test]
    fn layouts_outside_of_the_bounds_are_refused() {
        for (j, e, g) in [(0, 1, 0), (8, 8, 0), (1, 0, 0), (7, 15, 0), (1, 1, 3)] {
            assert!(Layout::new(j, e, g).is_err(), "{j} {e} {g}");
        }
        assert_eq!(Layout::new(3, 3, 2), Ok(Layout::DOGGY));
    }

    #[test]
    fn gyro_flags_follow_the_index() {
        assert_eq!(Flags::gyro_stale(0), Flags::GYRO1_STALE);
        assert_eq!(Flags::gyro_stale(1), Flags::GYRO2_STALE);
        assert_eq!(Flags::gyro_saturated(0), Flags::GYRO1_SATURATED);
        assert_eq!(Flags::gyro_saturated(1), Flags::GYRO2_SATURATED);
    }

    #[test]
    fn an_age_that_cannot_be_told_is_unknown() {
        let told = [-32_767, -120, 0, 480, 32_767].map(|us| GyroAge::from_us(us).us());
        assert_eq!(told, [-32_767, -120, 0, 480, 32_767].map(Some));
        assert_eq!([-32_768, 32_768, i32::MAX].map(|us| GyroAge::from_us(us).us()), [None; 3]);
        assert_eq!(GyroAge::default(), GyroAge::UNKNOWN);
    }

    #[test]
    fn execution_time_saturates() {
        assert_eq!([0, 7, 1020, 5000].map(Sample::execution_of), [0, 1, 255, 255]);
    }
}
