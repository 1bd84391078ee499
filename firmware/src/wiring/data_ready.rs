//! How old a gyro's words are, by the edges of its "data ready".
//!
//! ```text
//!   conversions  ──┴──────┴──────┴──────┴──────┴──────┴──   every period of the part's own clock
//!                      edge  ◀ age ▶ t_k  ▷ read_us: the part hands its words out
//! ```
//!
//! A capture channel keeps the time of the last edge, read at t_k. Where the part is read later, the conversion after that edge may
//! be over by then: its time is one period later. The part's clock is off its nominal rate by a per cent or so, so the period
//! is followed. A read close to a conversion's end may have found the words of either: such an age is unknown.

use protocol::GyroAge;

/// Distance from the end of a conversion within which a read may have found the words before it, µs: what starts of transfers
/// and interrupts scatter by, and the captures' step. Of 500 µs it costs one age in 31; twice of it costs one in 16, and half of it is
/// less than the first bytes of a transfer take.
const GUARD_US: i32 = 8;
/// How far a part's clock may be off its nominal rate, as a part of it.
const MOST_OFF: i32 = 32;
/// Fraction bits of the period that is followed, and by which part of a difference.
const FRACTION: u32 = 8;
const FOLLOW: i32 = 16;

/// What tells the age of one gyro's words.
#[derive(Clone, Copy, Debug)]
pub struct DataReady {
    nominal_us: i32,
    /// When the part hands its words out, µs after t_k.
    read_us: i32,
    /// As followed, µs / 2^FRACTION.
    period: i32,
    last_edge_us: Option<u32>,
}

impl DataReady {
    /// Of a part that converts so often, at least once a tick, and is read so many µs after t_k.
    pub const fn new(output_rate_hz: u32, read_us: i32) -> Self {
        let nominal_us = (1_000_000 / output_rate_hz) as i32;
        DataReady { nominal_us, read_us, period: nominal_us << FRACTION, last_edge_us: None }
    }

    /// The age of the words of tick t_k, whose last edge came at `edge_us` of the device's time; none if there was no edge since
    /// the last call.
    pub fn age(&mut self, t_us: u32, edge_us: Option<u32>) -> GyroAge {
        let Some(edge_us) = edge_us else {
            self.last_edge_us = None;
            return GyroAge::UNKNOWN;
        };
        if let Some(last_us) = self.last_edge_us.replace(edge_us) {
            self.follow(edge_us.wrapping_sub(last_us) as i32);
        }
        let since_us = t_us.wrapping_sub(edge_us) as i32;
        let period_us = self.period >> FRACTION;
        // How long the conversion after the edge is over when the part is read.
        let over_us = since_us.saturating_add(self.read_us).saturating_sub(period_us);
        if since_us < -GUARD_US || since_us > period_us + GUARD_US || over_us.abs() < GUARD_US {
            return GyroAge::UNKNOWN;
        }
        GyroAge::from_us(if over_us > 0 { since_us - period_us } else { since_us })
    }

    /// Two edges lie so far apart, some periods.
    fn follow(&mut self, apart_us: i32) {
        let periods = (apart_us + self.nominal_us / 2) / self.nominal_us;
        let off = apart_us - periods * self.nominal_us;
        // An edge between them may be one of noise.
        if !(1..=4).contains(&periods) || off.abs() > periods * self.nominal_us / MOST_OFF {
            return;
        }
        self.period += ((apart_us << FRACTION) / periods - self.period) / FOLLOW;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ages of 20,000 ticks of a part with this rate, read so late, whose truth is asked: (ticks without an age, largest error, µs).
    fn run(nominal_hz: u32, rate_hz: f64, read_us: i32) -> (usize, f64) {
        let mut ready = DataReady::new(nominal_hz, read_us);
        let period_us = 1e6 / rate_hz;
        let (mut unknown, mut worst) = (0, 0.0_f64);
        for k in 0..20_000_u32 {
            let t_us = 1000.0 * f64::from(k) + 123.0;
            let edge_us = (t_us / period_us).floor() * period_us;
            // The device's time wraps within the run.
            let start = u32::MAX - 5_000_000;
            let age = ready.age(start.wrapping_add(t_us as u32), Some(start.wrapping_add(edge_us as u32)));
            let read = t_us + f64::from(read_us);
            let truth = t_us - (read / period_us).floor() * period_us;
            match age.us() {
                // The first ticks follow the period.
                Some(_) if k < 100 => {}
                Some(us) => worst = worst.max((f64::from(us) - truth).abs()),
                None => unknown += 1,
            }
        }
        (unknown, worst)
    }

    #[test]
    fn ages_are_right_or_unknown() {
        for (nominal, rate, read) in [(2000, 2003.1, 6), (2000, 1981.0, 6), (1600, 1597.3, 120), (1600, 1615.0, 120)] {
            let (unknown, worst) = run(nominal, rate, read);
            // Truncation of both times, and of the period where the conversion after the edge counts.
            assert!(worst <= 2.0, "{rate} Hz: {worst} µs");
            // 16 µs of a period of 500 or 625 µs are within the guard.
            assert!((300..900).contains(&unknown), "{rate} Hz: {unknown} of 20,000");
        }
    }

    #[test]
    fn without_edges_nothing_is_told() {
        let mut ready = DataReady::new(2000, 6);
        assert_eq!(ready.age(1000, None), GyroAge::UNKNOWN);
        assert_eq!(ready.age(2000, Some(1700)), GyroAge::from_us(300));
        assert_eq!(ready.age(3000, None), GyroAge::UNKNOWN);
        // An edge of long ago, as a wire that broke leaves it, and one of the future.
        assert_eq!(ready.age(4000, Some(1700)), GyroAge::UNKNOWN);
        assert_eq!(ready.age(4000, Some(4100)), GyroAge::UNKNOWN);
    }

    proptest::proptest! {
        #[test]
        fn any_edges_are_survived(times: Vec<(u32, Option<u32>)>) {
            let mut ready = DataReady::new(2000, 6);
            for (t_us, edge_us) in times {
                let _ = ready.age(t_us, edge_us);
            }
        }
    }
}
