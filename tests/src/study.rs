//! Studies of many cases that take hours: a line of JSON an outcome, appended to a file as it comes. What the file holds already is not made
//! again, so that a study may be stopped and started at any time.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use serde::Serialize;
use serde::de::DeserializeOwned;

/// What every study asks for on the command line.
#[derive(Debug)]
pub struct Arguments {
    /// The first seed: `--first`.
    pub first: u64,
    /// Cases at once: `--workers`.
    pub workers: usize,
    /// The file: `--out`.
    pub out: PathBuf,
}

impl Arguments {
    /// Reads the command line. `out` is the file unless it is given; `take` gets every `--name value` of the study's own, and says
    /// whether it understands it.
    ///
    /// None of one that is not understood; the user is told what is wrong, with `usage`.
    pub fn read(usage: &str, out: &str, mut take: impl FnMut(&str, &str) -> bool) -> Option<Self> {
        let mut read = Self { first: 1, workers: 2, out: PathBuf::from(out) };
        let mut arguments = std::env::args().skip(1);
        while let Some(name) = arguments.next() {
            let value = arguments.next().unwrap_or_default();
            if !read.take(&name, &value) && !take(&name, &value) {
                eprintln!("`{name} {value}` is not understood\nusage: {usage}");
                return None;
            }
        }
        Some(read)
    }

    fn take(&mut self, name: &str, value: &str) -> bool {
        match name {
            "--first" => value.parse().map(|n| self.first = n).is_ok(),
            "--workers" => value.parse().map(|n| self.workers = n).is_ok(),
            "--out" if !value.is_empty() => {
                self.out = PathBuf::from(value);
                true
            }
            _ => false,
        }
    }
}

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
