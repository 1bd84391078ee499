//! Long work: in a thread of its own, the interpreter free meanwhile, its steps told to a callback, ended by Ctrl-C.
//!
//! ```text
//! calling thread   ── spawn ──▶ wait 50 ms ─▶ signals? callback ─▶ wait … ─▶ result, or the exception of a signal or callback
//! working thread        └─────▶ work ── step ─▶ (stopped? unwind) ── step ─▶ …
//! ```
//! The callback runs in the thread that called, so that it may do whatever Python allows there. An interrupted call returns at once; searches of
//! the thread that worked end before their next step, and the thread when it tells the next one.

use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use host::failure::Failure;
use pyo3::prelude::*;
use solve::levenberg::Settings;

use crate::errors::{OrRaise, raise};

/// How long a signal waits for an answer.
const PATIENCE: Duration = Duration::from_millis(50);
/// Room for a call chain as deep as the main thread's.
const STACK_BYTES: usize = 8 << 20;

/// What the work tells, and where it learns that nobody waits for it any more.
pub struct Steps {
    tell: Sender<String>,
    stop: Arc<AtomicBool>,
}

/// The payload that unwinds a thread whose work nobody waits for.
struct Stopped;

impl Steps {
    /// What ends the searches of a work that was interrupted.
    pub fn settings(&self) -> Settings {
        Settings { stop: Some(Arc::clone(&self.stop)), ..Settings::default() }
    }

    /// Tells what begins; does not return where the work was interrupted.
    pub fn tell(&self, step: impl Into<String>) {
        if self.stop.load(Relaxed) {
            // No fault: the hook that prints panics is passed by.
            panic::resume_unwind(Box::new(Stopped));
        }
        // A caller that went away has set the flag.
        let _ = self.tell.send(step.into());
    }
}

/// Whoever waits has gone, by whichever way.
struct Gone(Arc<AtomicBool>);

impl Drop for Gone {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

/// Does the work and gives its result.
///
/// # Errors
/// The work's failure; what a signal's handler (`KeyboardInterrupt`) or the callback raises.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Steps) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    let (tell, mut heard) = mpsc::channel();
    let gone = Gone(Arc::default());
    let steps = Steps { tell, stop: Arc::clone(&gone.0) };
    let worker = thread::Builder::new()
        .name("flexcal".to_owned())
        .stack_size(STACK_BYTES)
        .spawn(move || work(&steps))
        .map_err(Failure::device)
        .or_raise(py)?;
    loop {
        let news;
        (heard, news) = py.detach(move || {
            let news = heard.recv_timeout(PATIENCE);
            (heard, news)
        });
        py.check_signals()?;
        match news {
            Ok(step) => {
                if let Some(progress) = progress {
                    progress.call1((step,))?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            // The work is over.
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    match py.detach(|| worker.join()) {
        Ok(result) => result.or_raise(py),
        Err(_) => Err(raise(py, &Failure::fault("the program met a state that should be impossible (see stderr)"))),
    }
}
