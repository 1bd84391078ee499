//! Ctrl-C, or a polite end by the system: heard in one place, and no half-made file stays behind.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard};

/// What a process answers that ended because it was asked to, as shells have it.
pub const INTERRUPTED: u8 = 130;

type Action = Box<dyn Fn() + Send>;

/// What is done instead of leaving at once.
static ACTION: Mutex<Option<Action>> = Mutex::new(None);
/// Temporary files that are being made.
static PARTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Listens from now on. To be called once, before anything is made.
pub(in crate::command) fn listen() {
    let heard = ctrlc::set_handler(|| match &*lock(&ACTION) {
        Some(action) => action(),
        None => leave(INTERRUPTED),
    });
    if let Err(error) = heard {
        tracing::warn!("Ctrl-C will end the program without a word: {error}");
    }
}

/// From now on an interrupt does this, in a thread of its own, and the program goes on.
pub(in crate::command) fn instead(action: impl Fn() + Send + 'static) {
    *lock(&ACTION) = Some(Box::new(action));
}

/// Ends the process without leaving temporary files behind.
pub(in crate::command) fn leave(code: u8) -> ! {
    // Held to the end: no file is begun or named any more.
    let parts = lock(&PARTS);
    for part in parts.iter() {
        // It may have been named or removed in this moment.
        let _ = std::fs::remove_file(part);
    }
    std::process::exit(i32::from(code));
}

/// A temporary file that [`leave`] removes, until this is dropped.
#[derive(Debug)]
pub(in crate::command) struct Registered(PathBuf);

impl Registered {
    /// Makes a temporary file and registers it, in one step for whoever interrupts.
    pub(in crate::command) fn make<T, E>(
        make: impl FnOnce() -> Result<T, E>,
        path: impl FnOnce(&T) -> PathBuf,
    ) -> Result<(T, Self), E> {
        let mut parts = lock(&PARTS);
        let made = make()?;
        let path = path(&made);
        parts.push(path.clone());
        Ok((made, Self(path)))
    }
}

impl Drop for Registered {
    fn drop(&mut self) {
        lock(&PARTS).retain(|part| *part != self.0);
    }
}

/// No step leaves what is behind these locks half done, so a panic elsewhere spoils nothing.
fn lock<T>(mutex: &'static Mutex<T>) -> MutexGuard<'static, T> {
    mutex.lock().unwrap_or_else(|e| e.into_inner())
}
