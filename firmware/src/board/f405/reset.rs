//! Why the processor started.

use firmware::wiring::reset;
use protocol::ResetReason;
use protocol::hello::PanicPlace;
use stm32f4xx_hal::rcc::Rcc;

/// The reason of the reset, and where the firmware panicked if that was it. Clears the flags for the next reset.
pub fn reason(rcc: &Rcc) -> (ResetReason, Option<PanicPlace>) {
    let panic = crate::board::panic::take();
    let reason = reset::reason(rcc.csr().read().bits(), panic.is_some());
    rcc.csr().modify(|_, w| w.rmvf().clear());
    (reason, panic)
}
