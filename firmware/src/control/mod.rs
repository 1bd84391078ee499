//! The control loop: one tick a millisecond, from sensor readings to duties.

mod description;
mod request;
mod sensors;
mod stream;

use protocol::request::{HEARTBEAT_TIMEOUT_US, Memory, State};
use protocol::sample::{Flags, NO_PHASE};
use protocol::{
    Descriptions, Duty, Event, EventKind, Fault, GyroAge, MAX_ENCODERS, MAX_GYROS, MAX_JOINTS, MotionEnd, MotionId,
    ResetReason, Sample, ToDevice,
};

use crate::config::{Config, Joint};
use crate::constants::{ARMED_TICKS, TICK_US};
use crate::motion::{Player, Step};
use crate::queues::{Reply, TickEnds};
use crate::safety::{Deadline, GyroInput, Heartbeat, OnTime};
use description::Storing;
use request::Upload;
pub use sensors::Nearness;
use sensors::Sensors;
use stream::Stream;

/// What a tick reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// Encoders in the sample's order: counts, extended past the hardware counter, or `None` without a reading.
    pub encoders: [Option<i32>; MAX_ENCODERS],
    /// Gyros in the sample's order.
    pub gyros: [GyroInput; MAX_GYROS],
    /// How old each gyro's words are.
    pub gyro_ages: [GyroAge; MAX_GYROS],
    /// The emergency stop is pressed (or its wire is broken).
    pub emergency_stop: bool,
    /// The supply is too low.
    pub brown_out: bool,
    /// The clock is not the crystal's.
    pub wrong_clock: bool,
    /// The duty that was preloaded for this period did not become active: the period began too late.
    pub dropped: bool,
    /// How long the tick before this one ran, µs.
    pub last_execution_us: u32,
}

/// What a tick decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Duties to preload: they become active at the next tick.
    pub duty: [Duty; MAX_JOINTS],
    /// Zero duty at once, do not wait for the next tick. `duty` is zero as well.
    pub stop: bool,
    /// The drivers are to be enabled: from the start of a motion until the robot has come to rest after it.
    pub armed: bool,
    /// A description is to be stored: the caller calls [`ControlLoop::store`] before the next tick. The drivers are off.
    pub store: bool,
}

/// What the loop is doing.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "no allocator to put the large one behind")]
enum Activity {
    Idle,
    Waiting { at_seq: u32 },
    Running(Player),
    Jogging(Jog),
}

/// One joint driven for a moment.
#[derive(Clone, Copy, Debug)]
struct Jog {
    joint: u8,
    duty: Duty,
    /// Ticks in which the duty is still asked for.
    ticks: u32,
}

/// The control loop of a robot.
#[derive(Debug)]
pub struct ControlLoop {
    joints: heapless::Vec<Joint, MAX_JOINTS>,
    sensors: Sensors,
    deadline: Deadline,
    heartbeat: Heartbeat,
    stream: Stream,
    memory: Memory,
    upload: Upload,
    motion_id: MotionId,
    activity: Activity,
    fault: Option<Fault>,
    last_end: Option<(MotionId, MotionEnd)>,
    started: Option<ResetReason>,
    seq: u32,
    preloaded: [Duty; MAX_JOINTS],
    /// Ticks for which the drivers stay enabled.
    armed_ticks: u16,
    /// The emergency stop was seen pressed, or need not be.
    stop_tested: bool,
    descriptions: Descriptions,
    /// A description is uploaded and is to be stored.
    storing: Option<Storing>,
}

/// Time and number of the present tick, for what is reported from it.
#[derive(Clone, Copy)]
struct Now {
    seq: u32,
    t_us: u32,
}

impl ControlLoop {
    /// Idle, with no motion and no zero positions.
    pub fn new(config: &Config) -> Self {
        ControlLoop {
            joints: config.joints.clone(),
            sensors: Sensors::new(config),
            deadline: Deadline::new(TICK_US),
            heartbeat: Heartbeat::new(HEARTBEAT_TIMEOUT_US),
            stream: Stream::default(),
            memory: Memory::new(),
            upload: Upload::None,
            motion_id: MotionId::NONE,
            activity: Activity::Idle,
            fault: None,
            last_end: None,
            started: Some(config.hello.reset),
            seq: 0,
            preloaded: [Duty::ZERO; MAX_JOINTS],
            armed_ticks: 0,
            stop_tested: !config.stop_test,
            descriptions: config.hello.description,
            storing: None,
        }
    }

    /// One tick: readings and time in, duties out.
    ///
    /// ```text
    ///   t_k                                                              t_{k+1}
    ///   │ sensors │ tick(now, inputs)                │                    │
    ///   │  read   │ watch · messages · play · lower  │ preload            │ preloaded duty becomes active
    ///   ├───────── duty in force: computed in tick k−1 ──────────────────┤├─ computed in tick k ─
    ///                          ╰ stop: zero from here on, at once
    /// ```
    ///
    /// # Contract
    /// * **Period**: [`TICK_US`], called once per period from a hardware timer; `now_us` is the device time at which the
    ///   period began, wrapping. The caller reads the sensors first, then calls, then preloads `Outputs::duty` so that
    ///   it becomes active at the next period; if `Outputs::stop` is set it writes zero to the pins before it returns.
    /// * **Budget**: 100 µs (a tenth of the period) at the highest priority of all tasks that share the core; nothing
    ///   the tick touches is locked by another task. No allocation, no blocking, no loop longer than the numbers of
    ///   joints, encoders and gyros; one message.
    /// * **Overrun**: a tick half a period late, one whose duty was dropped, or one whose predecessor ran longer than the
    ///   period, raises [`Fault::Overrun`] if a motion is under way: zero duty at once, latched.
    /// * **Drivers**: enabled from the start of a motion until [`ARMED_TICKS`] after its end, whatever ended it: a motor
    ///   at zero duty is shorted and brakes, then its driver is switched off.
    /// * **Numbers**: the sequence number is this loop's own and counts every call, from 0, whether its sample is sent
    ///   or not.
    /// * **Sample** `k` carries the readings of tick k and the duty in force from t_k to t_{k+1}: what tick k−1
    ///   computed, or zero, flagged [`Flags::STOPPED`], if this tick stopped it.
    /// * **Age of gyros**: counted from t_k, as the caller measured it; unknown in a tick without new words.
    /// * **Same inputs, same outputs**: integer arithmetic in every tick, bit for bit the same on every machine.
    pub fn tick(&mut self, now_us: u32, inputs: &Inputs, ends: &mut TickEnds<'_>) -> Outputs {
        let now = Now { seq: self.seq, t_us: now_us };
        self.seq = self.seq.wrapping_add(1);
        if let Some(reset) = self.started.take() {
            self.tell(now, EventKind::Started(reset), ends);
        }

        let timing = self.deadline.check(now_us, inputs.last_execution_us);
        let in_force = if inputs.dropped { [Duty::ZERO; MAX_JOINTS] } else { self.preloaded };
        self.stop_tested |= inputs.emergency_stop;
        let was_busy = self.busy();
        let mut flags = self.sensors.read(inputs, &self.joints, &in_force, was_busy);

        self.take_message(now, inputs, ends);
        if let Some(fault) = self.find_fault(now_us, inputs, timing) {
            self.raise(now, fault, ends);
        }
        // Whatever ended the motion, the duty preloaded for this tick must not stay in force.
        let stopped = was_busy && !self.busy();

        let (phase, asked) = self.play(now, ends);
        let (duty, limits) = self.lower(asked);
        self.preloaded = duty;

        flags.set(Flags::STOPPED, stopped);
        flags.set(Flags::OVERRUN, timing.overrun || inputs.dropped);
        flags.set(Flags::ZEROED, self.sensors.zero.is_some());
        flags.set(Flags::FAULT, self.fault.is_some());
        flags.set(Flags::STOP_PRESSED, inputs.emergency_stop);
        flags.set(Flags::RUNNING, phase.is_some());
        let sample = Sample {
            seq: now.seq,
            t_us: now_us,
            encoders: self.sensors.counts,
            gyros: self.sensors.words,
            gyro_ages: self.sensors.ages,
            duty: if stopped { [Duty::ZERO; MAX_JOINTS] } else { in_force },
            motion: if phase.is_some() { self.motion_id } else { MotionId::NONE },
            phase: phase.unwrap_or(NO_PHASE),
            flags: flags | limits,
            execution: Sample::execution_of(inputs.last_execution_us),
            jitter_us: timing.jitter_us.clamp(i8::MIN.into(), i8::MAX.into()) as i8,
        };
        self.stream.offer(sample, ends);
        self.armed_ticks = if self.busy() { ARMED_TICKS } else { self.armed_ticks.saturating_sub(1) };
        Outputs {
            duty,
            stop: stopped || self.fault.is_some(),
            armed: self.armed_ticks > 0,
            store: self.storing.is_some(),
        }
    }

    /// What the loop is doing.
    pub fn state(&self) -> State {
        match (&self.activity, self.fault) {
            (_, Some(fault)) => State::Fault(fault),
            (Activity::Idle, None) => State::Idle,
            (Activity::Waiting { at_seq }, None) => State::Waiting { at_seq: *at_seq },
            (Activity::Running(player), None) => State::Running { phase: player.phase() },
            (Activity::Jogging(jog), None) => State::Jogging { joint: jog.joint },
        }
    }

    /// How near the watches of the sensors are to their bounds.
    pub fn nearness(&self) -> Nearness {
        self.sensors.nearness()
    }

    /// Number of the next tick.
    pub fn next_seq(&self) -> u32 {
        self.seq
    }

    /// Whether a motion is being played or its start awaited, or a joint jogged.
    fn busy(&self) -> bool {
        !matches!(self.activity, Activity::Idle)
    }

    /// Takes a message from the host, if there is one. One a tick, so that the worst tick is known: the host sends far
    /// fewer.
    fn take_message(&mut self, now: Now, inputs: &Inputs, ends: &mut TickEnds<'_>) {
        match ends.commands.dequeue() {
            None => {}
            Some(ToDevice::Hello(_)) => {
                self.memory.forget();
                reply(Reply::Hello { zero: self.sensors.zero, stored: self.descriptions.stored }, ends);
            }
            Some(ToDevice::Heartbeat(heartbeat)) => {
                self.heartbeat.heard(now.t_us);
                reply(Reply::HeartbeatSeen { count: heartbeat.count, t_us: now.t_us }, ends);
            }
            Some(ToDevice::Request { id, command }) => self.answer(now, id, &command, inputs, ends),
        }
    }

    /// What speaks against moving in this tick, the gravest first.
    fn find_fault(&mut self, now_us: u32, inputs: &Inputs, timing: OnTime) -> Option<Fault> {
        let silent = self.heartbeat.silent(now_us);
        let always = self.standing_fault(inputs).or(self.sensors.jumped());
        if always.is_some() || !self.busy() {
            return always;
        }
        let overrun = (timing.overrun || inputs.dropped).then_some(Fault::Overrun);
        let silent = silent.then_some(Fault::HeartbeatLost);
        overrun.or(self.sensors.fault()).or_else(|| self.limit_fault()).or(silent)
    }

    /// Faults that stand whether a motion is under way or not.
    fn standing_fault(&self, inputs: &Inputs) -> Option<Fault> {
        let stop = inputs.emergency_stop.then_some(Fault::EmergencyStop);
        stop.or(inputs.brown_out.then_some(Fault::BrownOut)).or(inputs.wrong_clock.then_some(Fault::Clock))
    }

    /// A joint beyond its limit by more than it may be, if it is known where the joints are.
    fn limit_fault(&self) -> Option<Fault> {
        self.sensors.zero?;
        let mut joints = (0u8..).zip(self.joints.iter().zip(&self.sensors.positions));
        joints
            .find(|(_, (joint, position))| joint.envelope.beyond(**position) > joint.envelope.overtravel_counts)
            .map(|(joint, _)| Fault::JointLimit { joint })
    }

    /// Latches a fault and ends the motion. The first fault stays until it is cleared.
    fn raise(&mut self, now: Now, fault: Fault, ends: &mut TickEnds<'_>) {
        if matches!(fault, Fault::EncoderJump { .. }) {
            self.sensors.forget_zero();
        }
        if self.fault.is_none() {
            self.fault = Some(fault);
            self.tell(now, EventKind::FaultRaised(fault), ends);
            self.end_motion(now, MotionEnd::Fault(fault), ends);
        }
    }

    /// Ends the motion or the jog, if there is one.
    fn end_motion(&mut self, now: Now, end: MotionEnd, ends: &mut TickEnds<'_>) {
        match core::mem::replace(&mut self.activity, Activity::Idle) {
            Activity::Idle => {}
            Activity::Jogging(Jog { joint, .. }) => self.tell(now, EventKind::JogEnded { joint, end }, ends),
            Activity::Waiting { .. } | Activity::Running(_) => {
                self.last_end = Some((self.motion_id, end));
                self.tell(now, EventKind::MotionEnded { motion: self.motion_id, end }, ends);
            }
        }
    }

    /// The phase of this tick, if a motion is played, and the duty asked for.
    fn play(&mut self, now: Now, ends: &mut TickEnds<'_>) -> (Option<u8>, [Duty; MAX_JOINTS]) {
        let idle = (None, [Duty::ZERO; MAX_JOINTS]);
        if let Activity::Waiting { at_seq } = self.activity {
            if at_seq != now.seq {
                return idle;
            }
            let mut scales = [1.0; MAX_JOINTS];
            for (scale, joint) in scales.iter_mut().zip(&self.joints) {
                *scale = joint.counts_per_unit;
            }
            let player = Player::new(ends.motion, scales, &self.sensors.positions, TICK_US);
            self.activity = Activity::Running(player);
            self.tell(now, EventKind::MotionStarted(self.motion_id), ends);
        }
        if let Activity::Jogging(jog) = &mut self.activity {
            let Some(left) = jog.ticks.checked_sub(1) else {
                self.end_motion(now, MotionEnd::Finished, ends);
                return idle;
            };
            jog.ticks = left;
            let mut duty = [Duty::ZERO; MAX_JOINTS];
            if let Some(asked) = duty.get_mut(usize::from(jog.joint)) {
                *asked = jog.duty;
            }
            return (None, duty);
        }
        let Activity::Running(player) = &mut self.activity else {
            return idle;
        };
        match player.step(ends.motion, &self.sensors.positions) {
            Step::Playing { phase, duty, timed_out } => {
                if timed_out {
                    self.tell(now, EventKind::MoveTimedOut { segment: phase }, ends);
                }
                (Some(phase), duty)
            }
            Step::Finished => {
                self.end_motion(now, MotionEnd::Finished, ends);
                idle
            }
        }
    }

    /// Safety's last word: the duties allowed, and which limits lowered them.
    fn lower(&self, asked: [Duty; MAX_JOINTS]) -> ([Duty; MAX_JOINTS], Flags) {
        let mut duty = [Duty::ZERO; MAX_JOINTS];
        let mut flags = Flags::empty();
        if self.fault.is_some() {
            return (duty, flags);
        }
        for (index, joint) in self.joints.iter().enumerate() {
            // Without zero positions, where only a jog drives, nobody knows how far the limits are.
            let known = self.sensors.zero.map(|_| self.sensors.positions[index]);
            let (position, speed) = (known.unwrap_or(joint.envelope.middle()), self.sensors.speeds[index]);
            let lowered = joint.envelope.lower(asked[index], self.preloaded[index], position, speed);
            duty[index] = lowered.duty;
            flags.set(Flags::DUTY_LIMITED, flags.contains(Flags::DUTY_LIMITED) || lowered.by_ceiling);
            flags.set(Flags::POSITION_LIMITED, flags.contains(Flags::POSITION_LIMITED) || lowered.by_position);
            flags.set(Flags::SLEW_LIMITED, flags.contains(Flags::SLEW_LIMITED) || lowered.by_slew);
        }
        (duty, flags)
    }

    fn tell(&self, now: Now, kind: EventKind, ends: &mut TickEnds<'_>) {
        reply(Reply::Event(Event { seq: now.seq, t_us: now.t_us, kind }), ends);
    }
}

/// Offers an answer to the line. If the queue is full it is lost like any frame on the line: the host asks again, and
/// a status tells what an event would have.
fn reply(reply: Reply, ends: &mut TickEnds<'_>) {
    let _ = ends.replies.enqueue(reply);
}
