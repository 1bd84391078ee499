//! The loss balance: every tick of a stream has a number, so what is missing is counted and not guessed.
//!
//! ```text
//!   ticks of the stream                      end − first, the device's own numbers
//!   ├─ received                              handed on to whoever records
//!   └─ missing
//!      ├─ device_dropped                     the device's own count
//!      ├─ host_dropped                       this program's queue was full
//!      └─ line_lost                          the rest: lost or damaged on the way
//!   damaged_frames                           counted beside it, since the port was opened; most of them were samples
//! ```

use protocol::clock::{Backwards, Unwrapped};
use protocol::{Loss, Status};

use crate::recording::LossBalance;

/// Counts one stream.
#[derive(Debug, Clone, Default)]
pub(super) struct Ledger {
    seq: Unwrapped,
    time: Unwrapped,
    first: Option<u64>,
    arrived: u64,
    host_dropped: u64,
    device_dropped: u32,
    closed: Option<u64>,
}

impl Ledger {
    /// A sample arrived: its number and time, unwrapped. A repeated number is a step back as well.
    pub(super) fn sample(&mut self, seq: u32, t_us: u32) -> Result<(u64, u64), Backwards> {
        if self.seq.last().is_some_and(|last| last as u32 == seq) {
            return Err(Backwards { by: 0, to: seq });
        }
        // Both or neither: a counter that goes back means a restart, whichever of them shows it.
        let mut time = self.time;
        let t_us = time.advance(t_us)?;
        let seq = self.seq.advance(seq)?;
        self.time = time;
        self.first.get_or_insert(seq);
        self.arrived += 1;
        Ok((seq, t_us))
    }

    /// The sample that was just counted found no room in the queue.
    pub(super) fn host_dropped(&mut self) {
        self.host_dropped += 1;
    }

    /// The device tells of samples that it dropped.
    pub(super) fn loss(&mut self, loss: &Loss) {
        self.device_dropped = self.device_dropped.max(loss.total);
    }

    /// The device's closing account of this stream; not believed if samples lie outside of it, since then it is that of
    /// another life of the device.
    pub(super) fn close(&mut self, status: &Status) {
        let ticks = status.end_seq.wrapping_sub(status.first_seq);
        let inside = |seq: &u64| (*seq as u32).wrapping_sub(status.first_seq) < ticks;
        if self.first.iter().chain(&self.seq.last()).all(inside) {
            self.device_dropped = status.dropped;
            self.closed = Some(u64::from(ticks));
        }
    }

    /// Whether nothing more can come: every tick arrived or was dropped by the device.
    pub(super) fn is_whole(&self) -> bool {
        self.closed.is_some_and(|ticks| self.arrived + u64::from(self.device_dropped) >= ticks)
    }

    /// Samples that arrived so far, whether or not the queue had room.
    pub(super) fn arrived(&self) -> u64 {
        self.arrived
    }

    /// Time and number, unwrapped, of something that happened near the last sample.
    pub(super) fn near(&self, seq: u32, t_us: u32) -> (u64, u64) {
        (self.seq.near(seq), self.time.near(t_us))
    }

    /// Where the missing samples went, so far; `damaged_frames` is the line's count.
    pub(super) fn balance(&self, damaged_frames: u64) -> LossBalance {
        let so_far = match (self.first, self.seq.last()) {
            (Some(first), Some(last)) => last - first + 1,
            _ => 0,
        };
        let received = self.arrived - self.host_dropped;
        // Before the device's account the ticks behind the last sample are not known.
        let ticks = self.closed.unwrap_or(so_far);
        let missing = ticks.saturating_sub(received);
        let device_dropped = u64::from(self.device_dropped).min(missing);
        LossBalance {
            ticks,
            received,
            missing,
            device_dropped,
            host_dropped: self.host_dropped,
            line_lost: missing.saturating_sub(device_dropped + self.host_dropped),
            damaged_frames,
            closed: self.closed.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use protocol::{LossCause, MotionId, State};

    /// What becomes of a tick.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Fate {
        Arrives,
        DeviceDrops,
        HostDrops,
        Lost,
        Damaged,
    }

    fn status(first_seq: u32, end_seq: u32, dropped: u32) -> Status {
        Status {
            state: State::Idle,
            streaming: false,
            first_seq,
            end_seq,
            dropped,
            motion: MotionId::NONE,
            last_end: None,
        }
    }

    proptest! {
        #[test]
        fn every_tick_is_accounted_for(
            first: u32,
            fates in prop::collection::vec(prop::sample::select(vec![
                Fate::Arrives, Fate::Arrives, Fate::Arrives, Fate::DeviceDrops, Fate::HostDrops, Fate::Lost, Fate::Damaged,
            ]), 0..300),
        ) {
            let mut ledger = Ledger::default();
            let count = |fate| fates.iter().filter(|f| **f == fate).count() as u64;
            for (k, fate) in (0u32..).zip(&fates) {
                let seq = first.wrapping_add(k);
                match fate {
                    Fate::Arrives => { ledger.sample(seq, k * 1000).unwrap(); }
                    Fate::HostDrops => { ledger.sample(seq, k * 1000).unwrap(); ledger.host_dropped(); }
                    Fate::Damaged | Fate::DeviceDrops | Fate::Lost => {}
                }
            }
            let dropped = count(Fate::DeviceDrops);
            ledger.close(&status(first, first.wrapping_add(fates.len() as u32), dropped as u32));
            let expected = LossBalance {
                ticks: fates.len() as u64,
                received: count(Fate::Arrives),
                missing: fates.len() as u64 - count(Fate::Arrives),
                device_dropped: dropped,
                host_dropped: count(Fate::HostDrops),
                line_lost: count(Fate::Lost) + count(Fate::Damaged),
                damaged_frames: count(Fate::Damaged),
                closed: true,
            };
            prop_assert_eq!(ledger.balance(count(Fate::Damaged)), expected);
            prop_assert_eq!(ledger.is_whole(), expected.line_lost == 0);
        }
    }

    #[test]
    fn before_the_account_the_balance_is_what_is_known() {
        let mut ledger = Ledger::default();
        assert_eq!(ledger.balance(0), LossBalance::default());
        for seq in [u32::MAX - 1, u32::MAX, 3] {
            ledger.sample(seq, seq).unwrap();
        }
        ledger.loss(&Loss { cause: LossCause::QueueFull, count: 2, first_seq: 0, total: 2 });
        let balance = ledger.balance(0);
        assert_eq!((balance.ticks, balance.missing, balance.device_dropped, balance.line_lost), (6, 3, 2, 1));
        assert!(!balance.closed);
    }

    #[test]
    fn the_account_of_another_life_is_not_believed() {
        let mut ledger = Ledger::default();
        ledger.sample(5000, 5_000_000).unwrap();
        ledger.sample(5002, 5_002_000).unwrap();
        for (first, end) in [(0, 0), (0, 40), (5001, 5003), (5000, 5002)] {
            ledger.close(&status(first, end, 7));
            assert_eq!((ledger.balance(0).closed, ledger.balance(0).device_dropped), (false, 0), "{first} {end}");
        }
        ledger.close(&status(4999, 5003, 1));
        let balance = ledger.balance(0);
        assert_eq!((balance.closed, balance.ticks, balance.device_dropped, balance.line_lost), (true, 4, 1, 1));
    }

    #[test]
    fn a_step_back_of_number_or_time_is_no_sample() {
        let mut ledger = Ledger::default();
        ledger.sample(100, 100_000).unwrap();
        assert!(ledger.sample(100, 101_000).is_err());
        assert!(ledger.sample(5, 101_000).is_err());
        assert!(ledger.sample(101, 99_000).is_err());
        assert_eq!(ledger.sample(101, 101_000), Ok((101, 101_000)));
        assert_eq!(ledger.arrived(), 2);
    }
}
