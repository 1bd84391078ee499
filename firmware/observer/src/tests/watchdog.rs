//! Events of the watchdog: none of a true model, one within its stated time of a wrong one.

use super::Normal;
use crate::{Innovation, Watchdog};

const READINGS: u16 = 9;

/// The NIS of innovations `ratio` times as large as they should be.
fn tick(normal: &mut Normal, ratio: f64) -> Innovation<f32> {
    let square: f64 = (0..READINGS).map(|_| normal.next().powi(2)).sum();
    Innovation { nis: (ratio * square) as f32, taken: READINGS, left_out: 0 }
}

#[test]
fn a_true_model_raises_no_event() {
    let (mut normal, mut watchdog) = (Normal::of(1), Watchdog::default());
    let mut highest: f32 = 0.0;
    for _ in 0..300_000 {
        assert!(!watchdog.look(tick(&mut normal, 1.0)));
        highest = highest.max(watchdog.level());
    }
    // Nor do innovations that are a fifth too large.
    for _ in 0..300_000 {
        assert!(!watchdog.look(tick(&mut normal, 1.2)));
    }
    assert!(highest < 0.5, "{highest}");
}

#[test]
fn a_wrong_model_raises_one_event_in_time() {
    // Ticks by the formula: threshold over the growth a tick, or the least.
    for (ratio, ticks) in [(1.6, 104), (2.0, 36), (100.0, 10)] {
        let (mut normal, mut watchdog) = (Normal::of(2), Watchdog::default());
        (0..1000).for_each(|_| assert!(!watchdog.look(tick(&mut normal, 1.0))));
        let at = (1..2000).find(|_| watchdog.look(tick(&mut normal, ratio)));
        let at = at.expect("an event");
        assert!((ticks / 2..=2 * ticks).contains(&at), "{ratio}: {at}");
        assert!(watchdog.has_tripped() && watchdog.level() == 1.0);
        assert!(!watchdog.look(tick(&mut normal, ratio)), "one event only");
        watchdog.clear();
        assert!(!watchdog.has_tripped() && watchdog.level() == 0.0);
    }
}

#[test]
fn a_filter_that_ran_away_raises_an_event_and_a_single_reading_none() {
    let wrong = Innovation { nis: f32::NAN, taken: READINGS, left_out: 0 };
    let mut watchdog = Watchdog::default();
    assert!((0..60).any(|_| watchdog.look(wrong)));
    let (mut normal, mut watchdog) = (Normal::of(3), Watchdog::default());
    for k in 0..10_000 {
        let nis = if k % 100 == 0 { 1e9 } else { tick(&mut normal, 1.0).nis };
        assert!(!watchdog.look(Innovation { nis, taken: READINGS, left_out: 0 }));
    }
}
