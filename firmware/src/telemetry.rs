//! Samples and answers become bytes for the host.

use protocol::message::{WriteError, write_report, write_sample};
use protocol::{Hello, Report};

use crate::config::Config;
use crate::queues::{Reply, TelemetryEnds};

/// Frames what the tick offers. Runs below the tick: however long the line takes, the tick never waits.
#[derive(Clone, Debug)]
pub struct Telemetry {
    hello: Hello,
}

impl Telemetry {
    /// For a robot.
    pub fn new(config: &Config) -> Self {
        Telemetry { hello: config.hello.clone() }
    }

    /// Writes as many whole frames as there are and fit, answers before samples; returns the bytes written. With
    /// [`protocol::message::MAX_TO_HOST_FRAME`] bytes of room every frame fits.
    pub fn transmit(&self, out: &mut [u8], ends: &mut TelemetryEnds<'_>) -> usize {
        let mut used = 0;
        while let Some(reply) = ends.replies.peek() {
            let Ok(n) = self.write_reply(reply, &mut out[used..]) else {
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
        }
        used
    }

    fn write_reply(&self, reply: &Reply, out: &mut [u8]) -> Result<usize, WriteError> {
        let report = match reply.clone() {
            Reply::Hello { zero } => {
                let mut hello = self.hello.clone();
                hello.zero = zero.map(|zero| zero.into_iter().take(hello.layout.encoders()).collect());
                Report::Hello(hello)
            }
            Reply::Accepted { id } => Report::Accepted { id },
            Reply::Refused { id, refusal } => Report::Refused { id, refusal },
            Reply::HeartbeatSeen { count, t_us } => Report::HeartbeatSeen { count, t_us },
            Reply::Status(status) => Report::Status(status),
            Reply::Loss(loss) => Report::Loss(loss),
            Reply::Event(event) => Report::Event(event),
        };
        write_report(&report, out)
    }
}
