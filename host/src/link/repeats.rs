//! Warnings that a device can cause again and again: each is said once, and how often it came at the end.

/// Different warnings that are told apart; what is more is counted together.
const KINDS: usize = 16;

/// Warnings said, with how often each came.
#[derive(Debug, Default)]
pub(super) struct Repeats {
    said: Vec<(String, u64)>,
    others: u64,
}

impl Repeats {
    /// Says a warning if it is new, and counts it.
    pub(super) fn warn(&mut self, text: &str) {
        if let Some((_, count)) = self.said.iter_mut().find(|(said, _)| said == text) {
            *count += 1;
        } else if self.said.len() < KINDS {
            tracing::warn!("{text}");
            self.said.push((text.to_owned(), 1));
        } else {
            self.others += 1;
        }
    }

    /// What came more than once, and what was not said at all.
    fn summary(&self) -> Vec<String> {
        let again = self.said.iter().filter(|(_, count)| *count > 1);
        let mut lines: Vec<String> = again.map(|(text, count)| format!("{count} times: {text}")).collect();
        if self.others > 0 {
            lines.push(format!("{} warnings more of other kinds", self.others));
        }
        lines
    }
}

impl Drop for Repeats {
    fn drop(&mut self) {
        self.summary().iter().for_each(|line| tracing::warn!("{line}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_counted_and_said_once() {
        let mut repeats = Repeats::default();
        (0..5000).for_each(|_| repeats.warn("the clock stands"));
        repeats.warn("a move timed out");
        assert_eq!(repeats.said.len(), 2);
        assert_eq!(repeats.summary(), ["5000 times: the clock stands"]);
    }

    #[test]
    fn a_flood_of_different_warnings_is_bounded() {
        let mut repeats = Repeats::default();
        (0..1000).for_each(|n| repeats.warn(&format!("warning {n}")));
        assert_eq!(repeats.said.len(), KINDS);
        assert_eq!(repeats.summary(), ["984 warnings more of other kinds"]);
    }
}
