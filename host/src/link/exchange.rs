//! One question to the device and its answer.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use protocol::hello::Greeting;
use protocol::{Hello, ToDevice};

use super::LinkError;
use super::outgoing::{Outgoing, Unsent};
use super::reader::{Answer, Shared};

/// How long one attempt of a request waits for its answer. An adapter may hold bytes for 16 ms each way.
pub(super) const ATTEMPT: Duration = Duration::from_millis(200);

/// Greets until the device answers, in our version.
pub(super) fn shake_hands(
    shared: &Shared,
    outgoing: &Outgoing,
    answers: &Receiver<Answer>,
    attempts: u32,
) -> Result<Hello, LinkError> {
    for _ in 0..attempts {
        send(shared, outgoing, "shake hands", &ToDevice::Hello(Greeting::OURS))?;
        let answer = wait(shared, answers, |answer| match answer {
            Answer::Hello(hello) => Some(Ok(*hello)),
            Answer::Stranger(theirs) => Some(Err(LinkError::Version { theirs, ours: Greeting::OURS })),
            _ => None,
        })?;
        if let Some(hello) = answer {
            return hello;
        }
    }
    Err(LinkError::NoAnswer {
        port: shared.port.clone(),
        waited: attempts * ATTEMPT,
        bytes: shared.bytes.load(Relaxed),
        frames: shared.frames.load(Relaxed),
        damaged: shared.damaged.load(Relaxed),
    })
}

pub(super) fn send(
    shared: &Shared,
    outgoing: &Outgoing,
    what: &'static str,
    message: &ToDevice,
) -> Result<(), LinkError> {
    match outgoing.send(message) {
        Ok(()) => Ok(()),
        Err(Unsent::Stopping) => Err(LinkError::Stopping { what }),
        // No room for a moment: as if lost on the line.
        Err(Unsent::Io(error)) if error.kind() == std::io::ErrorKind::TimedOut => Ok(()),
        Err(Unsent::Io(source)) => Err(LinkError::Gone { port: shared.port.clone(), source }),
    }
}

/// Waits one attempt's time for a wanted answer; others are thrown away.
pub(super) fn wait<T>(
    shared: &Shared,
    answers: &Receiver<Answer>,
    mut wanted: impl FnMut(Answer) -> Option<T>,
) -> Result<Option<T>, LinkError> {
    let until = Instant::now() + ATTEMPT;
    loop {
        match answers.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(answer) => {
                if let Some(found) = wanted(answer) {
                    return Ok(Some(found));
                }
            }
            Err(RecvTimeoutError::Timeout) => return Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(LinkError::Gone {
                    port: shared.port.clone(),
                    source: std::io::ErrorKind::BrokenPipe.into(),
                });
            }
        }
    }
}
