//! Requests of the host: what is done, what is refused and why.
//!
//! ```text
//!            SetZero        Upload…End       Start           start tick
//!   Idle ──▶ (zero known) ──▶ (motion there) ──▶ Waiting ──────▶ Running ──▶ Idle     finished or stopped
//!     ▲                                            ╰──── fault ────┤
//!     ╰──────────────── ClearFault ─────────────── Fault ◀─────────╯
//!
//!   Idle ── Jog ──▶ Jogging ──▶ Idle     after its time, or stopped; a fault as from a motion. No zero is needed.
//! ```

use protocol::motion::{Header, Limits, Motion, Segment};
use protocol::request::{Command, MAX_JOG_DUTY, MAX_JOG_MS, Status};
use protocol::{Duty, EventKind, Fault, MAX_JOINTS, MotionEnd, MotionError, MotionId, Refusal};

use super::description::Storing;
use super::{Activity, ControlLoop, Inputs, Jog, Now, reply};
use crate::constants::TICK_US;
use crate::queues::{Reply, TickEnds};

/// A motion or a description on its way here. Every part is checked as it comes, so the end has little to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Upload {
    #[default]
    None,
    Under {
        motion: MotionId,
        segments: u8,
        checksum: u32,
    },
    /// A description, of which so many pieces are there.
    Description {
        pieces: u8,
        taken: u8,
    },
}

/// Answers a request.
pub(super) fn acknowledge(id: u8, answer: Result<(), Refusal>, ends: &mut TickEnds<'_>) {
    let answer = match answer {
        Ok(()) => Reply::Accepted { id },
        Err(refusal) => Reply::Refused { id, refusal },
    };
    reply(answer, ends);
}

impl ControlLoop {
    /// Carries a request out, a repeated one once, and answers it.
    pub(super) fn answer(&mut self, now: Now, id: u8, command: &Command, inputs: &Inputs, ends: &mut TickEnds<'_>) {
        if *command == Command::Status {
            reply(Reply::Status(self.status(now)), ends);
        }
        let answer = match self.memory.recall(id, command) {
            Some(answer) => answer,
            None => {
                let answer = self.act(now, command, inputs, ends);
                if let (Ok(()), Command::DescriptionEnd { checksum }) = (answer, command) {
                    // Answered once it is stored.
                    self.storing = Some(Storing { id, checksum: *checksum });
                    return;
                }
                self.memory.keep(id, command, answer);
                answer
            }
        };
        acknowledge(id, answer, ends);
    }

    fn act(&mut self, now: Now, command: &Command, inputs: &Inputs, ends: &mut TickEnds<'_>) -> Result<(), Refusal> {
        match *command {
            Command::Stream { on } => {
                self.stream.switch(on, now.seq);
                Ok(())
            }
            Command::Status => Ok(()),
            Command::SetZero => self.set_zero(now, ends),
            Command::UploadBegin { motion, ref header, segments } => {
                self.begin_upload(motion, header, segments, ends.motion)
            }
            Command::UploadSegment { index, ref segment } => self.take_segment(index, segment, ends.motion),
            Command::UploadEnd { checksum } => self.end_upload(checksum, ends.motion),
            Command::Start { motion, at_seq } => self.start(now, motion, at_seq, inputs),
            Command::Jog { joint, duty, duration_ms } => self.jog(now, joint, duty, duration_ms, inputs),
            Command::Stop => {
                self.end_motion(now, MotionEnd::Stopped, ends);
                Ok(())
            }
            Command::ClearFault => self.clear_fault(now, inputs, ends),
            Command::DescriptionBegin { pieces } => self.begin_description(pieces, inputs, ends.description),
            Command::DescriptionPiece { index, ref bytes } => self.take_piece(index, bytes, ends.description),
            Command::DescriptionEnd { .. } => self.end_description(inputs),
        }
    }

    fn status(&self, now: Now) -> Status {
        let stream = &self.stream;
        Status {
            state: self.state(),
            streaming: stream.on,
            first_seq: stream.first_seq,
            end_seq: if stream.on { now.seq } else { stream.end_seq },
            dropped: stream.dropped,
            motion: self.motion_id,
            last_end: self.last_end,
        }
    }

    fn set_zero(&mut self, now: Now, ends: &mut TickEnds<'_>) -> Result<(), Refusal> {
        self.not_busy()?;
        if !self.sensors.quiet(&self.joints) {
            return Err(Refusal::NotQuiet);
        }
        self.sensors.set_zero();
        self.tell(now, EventKind::ZeroSet, ends);
        Ok(())
    }

    fn begin_upload(&mut self, id: MotionId, header: &Header, segments: u8, there: &mut Motion) -> Result<(), Refusal> {
        self.not_busy()?;
        self.motion_id = MotionId::NONE;
        self.upload = Upload::None;
        // In place, here and on the way here: neither motion nor header is passed over the stack.
        there.segments.clear();
        let checksum = header.checksum();
        there.name.clear();
        there.stages.clear();
        there.gain.clear();
        // The same capacities on both sides: everything fits.
        let _ = there.name.push_str(&header.name);
        let _ = there.stages.extend_from_slice(&header.stages);
        let _ = there.gain.extend_from_slice(&header.gain);
        let (limits, joints) = self.limits();
        // Without segments everything else must be right.
        match there.validate(&limits[..joints]) {
            Ok(()) | Err(MotionError::Empty) => {}
            Err(error) => return Err(Refusal::Motion(error)),
        }
        self.upload = Upload::Under { motion: id, segments, checksum };
        Ok(())
    }

    fn take_segment(&mut self, index: u8, segment: &Segment, there: &mut Motion) -> Result<(), Refusal> {
        let Upload::Under { checksum, .. } = &mut self.upload else {
            return Err(Refusal::NoUpload);
        };
        let due = there.segments.len();
        let repeated = usize::from(index) + 1 == due && there.segments.last() == Some(segment);
        if repeated {
            return Ok(());
        }
        let out_of_order = Refusal::UploadOrder { expected: due as u8, got: index };
        if usize::from(index) != due {
            return Err(out_of_order);
        }
        *checksum = segment.checksum(*checksum);
        let (limits, joints) = self.limits();
        segment.validate(index, there.stages.len(), &limits[..joints]).map_err(Refusal::Motion)?;
        there.segments.push(segment.clone()).map_err(|_| out_of_order)
    }

    fn end_upload(&mut self, checksum: u32, there: &Motion) -> Result<(), Refusal> {
        let Upload::Under { motion, segments, checksum: got } = self.upload else {
            return Err(Refusal::NoUpload);
        };
        let expected = there.segments.len() as u8;
        if segments != expected {
            return Err(Refusal::UploadOrder { expected, got: segments });
        }
        if got != checksum {
            return Err(Refusal::Checksum { expected: checksum, got });
        }
        there.validate_length().map_err(Refusal::Motion)?;
        self.motion_id = motion;
        self.upload = Upload::None;
        Ok(())
    }

    fn start(&mut self, now: Now, motion: MotionId, at_seq: Option<u32>, inputs: &Inputs) -> Result<(), Refusal> {
        self.may_move(now, inputs)?;
        if motion == MotionId::NONE || motion != self.motion_id {
            return Err(Refusal::NoSuchMotion { asked: motion, there: self.motion_id });
        }
        if self.sensors.zero.is_none() {
            return Err(Refusal::NotZeroed);
        }
        let at_seq = at_seq.unwrap_or(now.seq.wrapping_add(1));
        if at_seq.wrapping_sub(now.seq) as i32 <= 0 {
            return Err(Refusal::Late { asked: at_seq, now: now.seq });
        }
        self.activity = Activity::Waiting { at_seq };
        Ok(())
    }

    /// Drives one joint from the next tick on.
    fn jog(&mut self, now: Now, joint: u8, duty: Duty, duration_ms: u8, inputs: &Inputs) -> Result<(), Refusal> {
        self.may_move(now, inputs)?;
        let joints = self.joints.len() as u8;
        if joint >= joints {
            return Err(Refusal::NoSuchJoint { joint, joints });
        }
        if duty.limited_to(MAX_JOG_DUTY) != duty || !(1..=MAX_JOG_MS).contains(&duration_ms) {
            return Err(Refusal::JogBounds { duty, duration_ms });
        }
        let ticks = u32::from(duration_ms) * 1000 / TICK_US;
        self.activity = Activity::Jogging(Jog { joint, duty, ticks });
        Ok(())
    }

    /// Whether anything may be driven now.
    fn may_move(&mut self, now: Now, inputs: &Inputs) -> Result<(), Refusal> {
        self.not_busy()?;
        if let Some(fault) = self.fault.or_else(|| self.obstacle(now, inputs)) {
            return Err(Refusal::Fault(fault));
        }
        if self.stop_tested { Ok(()) } else { Err(Refusal::StopNotTested) }
    }

    fn clear_fault(&mut self, now: Now, inputs: &Inputs, ends: &mut TickEnds<'_>) -> Result<(), Refusal> {
        if self.fault.is_none() {
            return Ok(());
        }
        if let Some(lasting) = self.obstacle(now, inputs) {
            return Err(Refusal::Fault(lasting));
        }
        self.fault = None;
        self.tell(now, EventKind::FaultCleared, ends);
        Ok(())
    }

    /// What would stop a motion in its first tick. A joint beyond its limit must be brought back by hand.
    fn obstacle(&mut self, now: Now, inputs: &Inputs) -> Option<Fault> {
        let silent = self.heartbeat.silent(now.t_us).then_some(Fault::HeartbeatLost);
        self.standing_fault(inputs).or(self.sensors.fault()).or_else(|| self.limit_fault()).or(silent)
    }

    pub(super) fn not_busy(&self) -> Result<(), Refusal> {
        if self.busy() { Err(Refusal::Running) } else { Ok(()) }
    }

    /// The joints' ranges, and how many there are.
    fn limits(&self) -> ([Limits; MAX_JOINTS], usize) {
        let mut limits = [Limits { min: 0.0, max: 0.0 }; MAX_JOINTS];
        for (limits, joint) in limits.iter_mut().zip(&self.joints) {
            *limits = joint.limits;
        }
        (limits, self.joints.len())
    }
}
