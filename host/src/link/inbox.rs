//! The bounded queue between the thread that reads the line and whoever records.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use protocol::message::Level;
use protocol::{EventKind, Loss, Sample};

use super::LinkError;

/// Something that the device sent unasked.
#[derive(Debug, Clone, PartialEq)]
pub enum Arrival {
    /// A tick.
    Sample {
        /// Its number, unwrapped.
        seq: u64,
        /// Its time, unwrapped, µs.
        t_us: u64,
        /// What it read.
        sample: Box<Sample>,
    },
    /// Something happened.
    Event {
        /// In this tick, unwrapped.
        seq: u64,
        /// At this time, unwrapped, µs.
        t_us: u64,
        /// What.
        kind: EventKind,
    },
    /// The device dropped samples.
    Loss(Loss),
    /// A line of its log.
    Log {
        /// How grave.
        level: Level,
        /// The line.
        text: String,
    },
    /// Bytes of its log, a defmt stream.
    Defmt {
        /// How many came before these, in the device's count.
        at: u32,
        /// The bytes.
        bytes: Vec<u8>,
    },
}

/// Most messages that are no samples; a device sends far fewer in the time that the samples' bound is worth.
const MAX_REPORTS: usize = 4096;

/// First in, first out; samples and reports bounded separately, so that a flood of samples drops no event.
#[derive(Debug)]
pub(super) struct Inbox {
    capacity: usize,
    queue: Mutex<Queue>,
    arrived: Condvar,
}

#[derive(Debug, Default)]
struct Queue {
    items: VecDeque<Arrival>,
    samples: usize,
    end: Option<LinkError>,
}

impl Inbox {
    /// A queue for so many samples.
    pub(super) fn new(capacity: usize) -> Self {
        Self { capacity, queue: Mutex::default(), arrived: Condvar::new() }
    }

    /// Appends; `false` if there was no room.
    pub(super) fn push(&self, item: Arrival) -> bool {
        let mut queue = self.lock();
        let is_sample = matches!(item, Arrival::Sample { .. });
        let full =
            if is_sample { queue.samples >= self.capacity } else { queue.items.len() - queue.samples >= MAX_REPORTS };
        if !full {
            queue.samples += usize::from(is_sample);
            queue.items.push_back(item);
            self.arrived.notify_one();
        }
        !full
    }

    /// Nothing will follow, for this reason; the first reason counts.
    pub(super) fn end(&self, why: LinkError) {
        self.lock().end.get_or_insert(why);
        self.arrived.notify_one();
    }

    /// The next item, or `None` if none came in time. Once the queue is empty and ended, the reason, once.
    pub(super) fn next(&self, patience: Duration) -> Result<Option<Arrival>, LinkError> {
        let until = Instant::now() + patience;
        let mut queue = self.lock();
        loop {
            if let Some(item) = queue.items.pop_front() {
                queue.samples -= usize::from(matches!(item, Arrival::Sample { .. }));
                return Ok(Some(item));
            }
            if let Some(why) = queue.end.take() {
                return Err(why);
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            queue = self.arrived.wait_timeout(queue, left).unwrap_or_else(|e| e.into_inner()).0;
        }
    }

    /// Throws away all samples there are.
    pub(super) fn forget_samples(&self) {
        let mut queue = self.lock();
        queue.items.retain(|item| !matches!(item, Arrival::Sample { .. }));
        queue.samples = 0;
    }

    /// The queue stays usable if another thread panicked with the lock in its hand: no step leaves it half done.
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(|e| e.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(seq: u64) -> Arrival {
        Arrival::Sample { seq, t_us: seq * 1000, sample: Box::default() }
    }

    fn defmt(at: u32) -> Arrival {
        Arrival::Defmt { at, bytes: vec![1] }
    }

    #[test]
    fn a_flood_of_samples_drops_no_event_and_order_is_kept() {
        let inbox = Inbox::new(2);
        assert!(inbox.push(sample(1)));
        assert!(inbox.push(defmt(1)));
        assert!(inbox.push(sample(2)));
        assert!(!inbox.push(sample(3)));
        assert!(inbox.push(defmt(2)));
        let take = || inbox.next(Duration::ZERO).unwrap();
        assert_eq!(take(), Some(sample(1)));
        assert_eq!(take(), Some(defmt(1)));
        assert!(inbox.push(sample(4)));
        assert_eq!(take(), Some(sample(2)));
        assert_eq!(take(), Some(defmt(2)));
        assert_eq!(take(), Some(sample(4)));
        assert_eq!(take(), None);
    }

    #[test]
    fn the_end_comes_after_what_was_there() {
        let inbox = Inbox::new(2);
        inbox.push(sample(1));
        inbox.end(LinkError::Restarted { reason: None });
        assert_eq!(inbox.next(Duration::ZERO).unwrap(), Some(sample(1)));
        assert!(matches!(inbox.next(Duration::ZERO), Err(LinkError::Restarted { .. })));
        inbox.push(sample(2));
        inbox.push(defmt(0));
        inbox.forget_samples();
        assert_eq!(inbox.next(Duration::ZERO).unwrap(), Some(defmt(0)));
        assert_eq!(inbox.next(Duration::ZERO).unwrap(), None);
    }
}
