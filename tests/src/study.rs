//! Studies of many cases that take hours: a line of JSON an outcome, appended to a file as it comes. What the file holds already is not made
//! again, so that a study may be stopped and started at any time.

use std::io::Write;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Makes the outcomes of those `cases` of which `file` holds none, as many at once as there are workers, and gives those of all cases.
/// A line that was cut off is left as it is and made again. `progress` is told how many are done.
///
/// # Errors
/// If the file cannot be read or written.
pub fn resume<C: Sync, O: Serialize + DeserializeOwned + Send>(
    file: &Path,
    cases: &[C],
    is_of: impl Fn(&C, &O) -> bool,
    workers: usize,
    make: impl Fn(&C) -> O + Sync,
    progress: impl Fn(u64) + Sync,
) -> std::io::Result<Vec<O>> {
    let text = match std::fs::read_to_string(file) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
        text => text?,
    };
    let mut outcomes: Vec<O> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    outcomes.retain(|outcome| cases.iter().any(|case| is_of(case, outcome)));
    let missing: Vec<&C> = cases.iter().filter(|case| !outcomes.iter().any(|outcome| is_of(case, outcome))).collect();
    let mut out = std::fs::OpenOptions::new().create(true).append(true).open(file)?;
    if !text.is_empty() && !text.ends_with('\n') {
        out.write_all(b"\n")?;
    }
    let next = AtomicUsize::new(0);
    let shared = Mutex::new((out, outcomes, Ok(())));
    std::thread::scope(|scope| {
        for _ in 0..workers.max(1) {
            scope.spawn(|| {
                while let Some(case) = missing.get(next.fetch_add(1, Relaxed)) {
                    let outcome = make(case);
                    let line = serde_json::to_string(&outcome).expect("numbers and names are JSON") + "\n";
                    let mut shared = shared.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                    let (out, outcomes, written) = &mut *shared;
                    if written.is_ok() {
                        *written = out.write_all(line.as_bytes());
                    }
                    outcomes.push(outcome);
                    progress(outcomes.len() as u64);
                }
            });
        }
    });
    let (_, outcomes, written) = shared.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    written?;
    Ok(outcomes)
}
