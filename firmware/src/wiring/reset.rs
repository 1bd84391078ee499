//! Why the processor started, from the flags that the reset left behind.
//!
//! ```text
//!   RCC_CSR   31 low power │ 30 window watchdog │ 29 watchdog │ 28 software │ 27 power-on │ 26 pin │ 25 brown-out
//! ```
//!
//! Every reset sets the flag of the pin too, because it pulls the pin; power-on sets that of the brown-out too.

use protocol::ResetReason;

const WINDOW_WATCHDOG: u32 = 1 << 30;
const WATCHDOG: u32 = 1 << 29;
const SOFTWARE: u32 = 1 << 28;
const POWER_ON: u32 = 1 << 27;
const PIN: u32 = 1 << 26;
const BROWN_OUT: u32 = 1 << 25;

/// The reason by RCC_CSR of the STM32F4, whose flags have gathered since they were cleared; `panicked`: the record of
/// a panic was found, whose end is a reset by software.
pub fn reason(csr: u32, panicked: bool) -> ResetReason {
    let has = |flag| csr & flag != 0;
    if has(POWER_ON) {
        ResetReason::PowerOn
    } else if has(BROWN_OUT) {
        ResetReason::BrownOut
    } else if has(WATCHDOG | WINDOW_WATCHDOG) {
        ResetReason::Watchdog
    } else if has(SOFTWARE) {
        if panicked { ResetReason::Panic } else { ResetReason::Software }
    } else if has(PIN) {
        ResetReason::Pin
    } else {
        ResetReason::Unknown
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gravest_flag_counts() {
        let seen = |flags| reason(flags, false);
        assert_eq!(seen(POWER_ON | BROWN_OUT | PIN), ResetReason::PowerOn);
        assert_eq!(seen(BROWN_OUT | PIN), ResetReason::BrownOut);
        assert_eq!(seen(WATCHDOG | PIN), ResetReason::Watchdog);
        assert_eq!(seen(SOFTWARE | PIN), ResetReason::Software);
        assert_eq!(seen(PIN), ResetReason::Pin);
        assert_eq!(seen(0), ResetReason::Unknown);
    }

    #[test]
    fn a_panic_is_a_software_reset_with_a_record() {
        assert_eq!(reason(SOFTWARE | PIN, true), ResetReason::Panic);
        assert_eq!(reason(WATCHDOG | PIN, true), ResetReason::Watchdog, "it hung on its way to the reset");
        assert_eq!(reason(POWER_ON | BROWN_OUT | PIN, true), ResetReason::PowerOn, "nothing in RAM outlives that");
    }
}
