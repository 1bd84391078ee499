//! The heartbeat: a thread of its own, so that no disk and no screen can delay it.
//!
//! A heartbeat every 20 ms of host time. When samples come faster than in real time (a simulated robot), one for every
//! 20 ms of *device* time that were worked off, so that the simulation may run as fast as this side keeps up.

use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use protocol::ToDevice;
use protocol::request::{HEARTBEAT_PERIOD_MS, Heartbeat};

use super::outgoing::Outgoing;

/// Sends heartbeats until dropped.
pub(super) struct Pulse {
    shared: Arc<(Mutex<Beat>, Condvar)>,
    thread: Option<JoinHandle<()>>,
    ticks_per_beat: u32,
}

#[derive(Debug, Default)]
struct Beat {
    seen_seq: u32,
    told_seq: u32,
    due: bool,
    over: bool,
}

impl Pulse {
    /// Begins at once: the first heartbeat is on the line when this returns.
    pub(super) fn start(outgoing: Arc<Outgoing>, tick_us: u16) -> std::io::Result<Self> {
        beat(&outgoing, 0, 0);
        let shared = Arc::new((Mutex::new(Beat::default()), Condvar::new()));
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("heartbeat".to_owned()).spawn(move || run(&theirs, &outgoing))?;
        let ticks_per_beat = (HEARTBEAT_PERIOD_MS as u32 * 1000 / u32::from(tick_us.max(1))).max(1);
        Ok(Self { shared, thread: Some(thread), ticks_per_beat })
    }

    /// The tick of this number was worked off.
    pub(super) fn seen(&self, seq: u32) {
        let (beat, changed) = &*self.shared;
        let mut beat = beat.lock().unwrap_or_else(|e| e.into_inner());
        beat.seen_seq = seq;
        if seq.wrapping_sub(beat.told_seq) >= self.ticks_per_beat && !beat.due {
            beat.due = true;
            changed.notify_one();
        }
    }
}

impl Drop for Pulse {
    fn drop(&mut self) {
        let (beat, changed) = &*self.shared;
        beat.lock().unwrap_or_else(|e| e.into_inner()).over = true;
        changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // It ends within one write; a panic in it was printed already.
            let _ = thread.join();
        }
    }
}

fn run(shared: &(Mutex<Beat>, Condvar), outgoing: &Outgoing) {
    let (state, _) = shared;
    for count in (0..=u16::MAX).cycle().skip(1) {
        if !wait(shared) {
            return;
        }
        let mut state = state.lock().unwrap_or_else(|e| e.into_inner());
        (state.due, state.told_seq) = (false, state.seen_seq);
        let seen_seq = state.seen_seq;
        drop(state);
        beat(outgoing, count, seen_seq);
    }
}

fn beat(outgoing: &Outgoing, count: u16, seen_seq: u32) {
    // A line that does not take it is noticed by the reader, or by the device, which then stops the motion.
    if let Err(error) = outgoing.send(&ToDevice::Heartbeat(Heartbeat { count, seen_seq })) {
        tracing::debug!("heartbeat not sent: {error:?}");
    }
}

/// Waits until the next heartbeat is due; `false` when there is to be none.
fn wait((beat, changed): &(Mutex<Beat>, Condvar)) -> bool {
    let beat = beat.lock().unwrap_or_else(|e| e.into_inner());
    let period = Duration::from_millis(HEARTBEAT_PERIOD_MS);
    let waited = changed.wait_timeout_while(beat, period, |beat| !beat.due && !beat.over);
    !waited.unwrap_or_else(|e| e.into_inner()).0.over
}
