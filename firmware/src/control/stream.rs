//! The stream of samples: offered every tick while it is on, never waited for, and every drop counted.

use protocol::{Loss, LossCause, Sample};

use crate::queues::{Reply, TickEnds};

/// Counts of one stream; see [`protocol::request::Status`] for how they close the balance.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stream {
    pub on: bool,
    pub first_seq: u32,
    pub end_seq: u32,
    pub dropped: u32,
    run: Option<Loss>,
}

impl Stream {
    /// Switches on with counts from zero at the tick `seq`, or off, keeping the counts.
    pub fn switch(&mut self, on: bool, seq: u32) {
        if on {
            *self = Stream { on, first_seq: seq, end_seq: seq, ..Stream::default() };
        }
        self.on = on;
    }

    /// Offers the sample of this tick to the line.
    pub fn offer(&mut self, sample: Sample, ends: &mut TickEnds<'_>) {
        if self.on {
            self.end_seq = sample.seq.wrapping_add(1);
            if ends.samples.enqueue(sample).is_err() {
                self.dropped = self.dropped.saturating_add(1);
                let cause = LossCause::QueueFull;
                let run = self.run.get_or_insert(Loss { cause, count: 0, first_seq: sample.seq, total: 0 });
                run.count = run.count.saturating_add(1);
                run.total = self.dropped;
                return;
            }
        }
        // There was room, or nothing more comes: the run of losses is over and can be told.
        if let Some(run) = self.run
            && ends.replies.enqueue(Reply::Loss(run)).is_ok()
        {
            self.run = None;
        }
    }
}
