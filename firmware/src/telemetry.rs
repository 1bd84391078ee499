//! Samples and answers become bytes for the host.

use protocol::budget;
use protocol::frame::DELIMITER;
use protocol::message::{LOG_PIECE, MAX_TO_HOST_FRAME, WriteError, write_own_report, write_sample};
use protocol::{Hello, Report};

use crate::config::Config;
use crate::constants::TICK_US;
use crate::queues::{Reply, TelemetryEnds};

/// Frames what the tick offers. Runs below the tick: however long the line takes, the tick never waits.
#[derive(Clone, Debug)]
pub struct Telemetry {
    hello: Hello,
    /// Bytes of the log that were sent.
    log_bytes: u32,
    /// Whether the last of them ended a frame.
    log_whole: bool,
    /// Samples sent since the last piece of the log.
    samples: u32,
}

/// Samples between two pieces of the log, which keeps it within its share of the line.
const SAMPLES_PER_PIECE: u32 = 1_000_000 / TICK_US / budget::LOG.per_s;

impl Telemetry {
    /// For a robot.
    #[inline(never)]
    pub fn new(config: &Config) -> Self {
        Telemetry { hello: config.hello.clone(), log_bytes: 0, log_whole: true, samples: 0 }
    }

    /// Writes as many whole frames as there are and fit, answers before samples; returns the bytes written. With
    /// [`protocol::message::MAX_TO_HOST_FRAME`] bytes of room every frame fits.
    pub fn transmit(&mut self, out: &mut [u8], ends: &mut TelemetryEnds<'_>) -> usize {
        let mut used = 0;
        while let Some(reply) = ends.replies.peek() {
            let Ok(n) = write_reply(reply, &mut self.hello, &mut out[used..]) else {
                return used;
            };
            used += n;
            ends.replies.dequeue();
        }
        while let Some(sample) = ends.samples.peek() {
            let Ok(n) = write_sample(sample, &self.hello.layout, &mut out[used..]) else {
                return used;
            };
            used += n;
            ends.samples.dequeue();
            self.samples = self.samples.saturating_add(1);
        }
        used
    }

    /// Writes a piece of the log if one is due; returns the bytes written. `take` gives the log's next bytes and how
    /// many. To be called when [`Telemetry::transmit`] has nothing more.
    ///
    /// One piece goes out every 20 samples, so only while the stream is on: what a start has to say waits in the log's
    /// ring until somebody records. A piece at the beginning of a frame opens with the delimiter, so that a host which
    /// did not hear the piece before knows where it stands.
    pub fn transmit_log(&mut self, out: &mut [u8], take: impl FnOnce(&mut [u8]) -> usize) -> usize {
        if self.samples < SAMPLES_PER_PIECE || out.len() < MAX_TO_HOST_FRAME {
            return 0;
        }
        let mut bytes = [0; LOG_PIECE];
        let opening = usize::from(self.log_whole);
        let taken = take(&mut bytes[opening..]).min(LOG_PIECE - opening);
        if taken == 0 {
            return 0;
        }
        let n = opening + taken;
        let at = self.log_bytes;
        self.log_bytes = at.wrapping_add(n as u32);
        self.log_whole = bytes[n - 1] == DELIMITER;
        self.samples = 0;
        let bytes = bytes[..n].iter().copied().collect();
        // There is room for any frame.
        write_own_report(&Report::Defmt { at, bytes }, out).unwrap_or(0)
    }
}

fn write_reply(reply: &Reply, hello: &mut Hello, out: &mut [u8]) -> Result<usize, WriteError> {
    let report = match reply {
        Reply::Hello { zero, stored } => {
            hello.description.stored = *stored;
            hello.zero = zero.map(|zero| zero.into_iter().take(hello.layout.encoders()).collect());
            Report::Hello(&*hello)
        }
        Reply::Accepted { id } => Report::Accepted { id: *id },
        Reply::Refused { id, refusal } => Report::Refused { id: *id, refusal: *refusal },
        Reply::HeartbeatSeen { count, t_us } => Report::HeartbeatSeen { count: *count, t_us: *t_us },
        Reply::Status(status) => Report::Status(*status),
        Reply::Loss(loss) => Report::Loss(*loss),
        Reply::Event(event) => Report::Event(*event),
    };
    write_own_report(&report, out)
}
