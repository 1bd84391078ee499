//! A part that has given nothing for so long that it must be set up again: it lost its supply, or was never there.

/// Ticks without a reading after which a part is set up again: a motion was stopped after three, and its robot has come to
/// rest. With half of it a robot may still coast; twice makes the user wait a second more.
const ABSENT_TICKS: u16 = 1000;

/// Counts the ticks without a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Absence {
    ticks: u16,
}

impl Absence {
    /// A tick with a reading or without one. Whether the part is absent; if so, counts anew.
    pub fn lasts(&mut self, has_reading: bool) -> bool {
        self.ticks = if has_reading { 0 } else { self.ticks + 1 };
        let lasts = self.ticks >= ABSENT_TICKS;
        if lasts {
            self.ticks = 0;
        }
        lasts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_absent_after_a_second_without_a_reading_and_not_before() {
        let mut absence = Absence::default();
        for round in 0..2 {
            assert_eq!((1..=1000).find(|_| absence.lasts(false)), Some(1000), "round {round}");
        }
        assert!(!(0..999).any(|_| absence.lasts(false)));
        assert!(!absence.lasts(true), "a reading begins anew");
        assert!(!(0..999).any(|_| absence.lasts(false)));
    }
}
