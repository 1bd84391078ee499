//! The independent watchdog, on its own oscillator of 32 kHz (17 to 47 kHz by the data sheet).
//!
//! | | prescaler | reload | nominal | bounds |
//! |---|---|---|---|---|
//! | during the start, and while a description is stored | 64 | 1000 | 2.0 s | 1.4 to 3.8 s |
//! | from the first tick on | 4 | 127 | 16 ms | 11 to 30 ms |

use firmware::wiring;
use stm32f4xx_hal::pac::{DBGMCU, IWDG};

/// Never to be stopped once it runs.
pub struct Watchdog {
    registers: IWDG,
    /// The time of a start is in force.
    starting: bool,
}

impl Watchdog {
    /// Starts it with the time that a start may take. It stands still while a debugger halts the core.
    pub fn start(registers: IWDG, debug: &DBGMCU) -> Self {
        debug.apb1_fz().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        registers.kr().write(|w| w.key().start());
        let mut watchdog = Watchdog { registers, starting: true };
        watchdog.set_long();
        watchdog
    }

    /// The time of a start, from here on.
    fn set_long(&mut self) {
        self.starting = true;
        self.registers.kr().write(|w| w.key().unlock());
        self.registers.pr().write(|w| w.pr().divide_by64());
        self.registers.rlr().write(|w| w.rl().set(1000));
        self.settle();
    }

    /// The time of a tick, from here on.
    fn shorten(&mut self) {
        self.starting = false;
        self.registers.kr().write(|w| w.key().unlock());
        self.registers.pr().write(|w| w.pr().divide_by4());
        self.registers.rlr().write(|w| w.rl().set(127));
    }

    /// Waits until the settings of the start count, five cycles of the slow oscillator, then starts the time anew. The
    /// bound is for an oscillator that does not run.
    fn settle(&self) {
        for _ in 0..100_000 {
            let status = self.registers.sr().read();
            if status.pvu().bit_is_clear() && status.rvu().bit_is_clear() {
                break;
            }
        }
        self.registers.kr().write(|w| w.key().feed());
    }
}

impl wiring::Watchdog for Watchdog {
    /// The first one ends the time of the start: by then everything has run once, the checksum over the code included. What
    /// is set counts from the next feed on at the latest; nobody waits for it here.
    fn feed(&mut self) {
        if self.starting {
            self.shorten();
        }
        self.registers.kr().write(|w| w.key().feed());
    }

    /// An erase takes 0.8 s at most, and the shortest time of a start is 1.4 s.
    fn lengthen(&mut self) {
        self.set_long();
    }
}
