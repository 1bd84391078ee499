//! Has the host been heard lately? Device time only; the first silence longer than the timeout is remembered.

/// Watches the host's heartbeats.
#[derive(Clone, Copy, Debug)]
pub struct Heartbeat {
    timeout_us: u32,
    last_us: u32,
    silent: bool,
}

impl Heartbeat {
    /// Nothing heard yet.
    pub const fn new(timeout_us: u32) -> Self {
        Heartbeat { timeout_us, last_us: 0, silent: true }
    }

    /// A heartbeat was heard.
    pub fn heard(&mut self, now_us: u32) {
        self.last_us = now_us;
        self.silent = false;
    }

    /// Whether the host is silent now. To be asked every tick: a silence once seen stays until
    /// [`heard`](Self::heard), so the wrap of the clock after 71 minutes cannot hide it.
    pub fn silent(&mut self, now_us: u32) -> bool {
        self.silent |= now_us.wrapping_sub(self.last_us) > self.timeout_us;
        self.silent
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silent_from_the_start_and_after_the_timeout() {
        let mut heartbeat = Heartbeat::new(100_000);
        assert!(heartbeat.silent(0));
        heartbeat.heard(u32::MAX - 50_000);
        assert!(!heartbeat.silent(49_999), "exactly 100 ms, over the wrap");
        assert!(heartbeat.silent(50_000));
    }

    #[test]
    fn a_silence_of_a_whole_wrap_is_not_forgotten() {
        let mut heartbeat = Heartbeat::new(100_000);
        heartbeat.heard(0);
        assert!(heartbeat.silent(200_000));
        assert!(heartbeat.silent(1000), "71 minutes later the clock reads 1 ms again");
        heartbeat.heard(2000);
        assert!(!heartbeat.silent(3000));
    }
}
