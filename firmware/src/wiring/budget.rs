//! How much of a tick each bus takes, checked at compile time. No bus may take more than 60 %.
//!
//! | bus | what goes over it in a tick of 1000 µs | clock | µs | share |
//! |---|---|---|---|---|
//! | SPI1 | ICM-42688-P: 10 bytes of 8 bits | 10.5 MHz | 7.6 | 0.8 % |
//! | I²C1 | BMI323: 19 bytes of 9 bits, 2 starts, 1 stop | 400 kHz | 435 | 43.5 % |
//! | | and the clock held until the interrupt: 22 events of 2 µs | | 44 | 4.4 % |
//! | USART1 out | a sample: 55 bytes of 10 bits | 921,600 baud | 597 | 59.7 % |
//! | USART1 in | heartbeats, 50 a second: 15 bytes of 10 bits | 921,600 baud | 8 | 0.8 % |
//!
//! Everything else that the device sends is in [`protocol::budget`], which lets all together take 80 % of the line.
//! An I²C transfer that is not over after [`BUS_BOUND_US`] is aborted.

use protocol::Layout;
use protocol::budget::{BAUD, BITS_PER_BYTE};
use protocol::frame::wire_len;

use super::BUS_BOUND_US;
use crate::constants::TICK_US;

/// Clock of the SPI bus, Hz: 84 MHz / 8; the part takes 24 MHz.
pub const SPI_HZ: u32 = 10_500_000;
/// Bytes of a burst on SPI.
pub const SPI_BYTES: u32 = 10;
/// Clock of the I²C bus, Hz.
pub const I2C_HZ: u32 = 400_000;
/// Bytes of a burst on I²C: address, register, address, two dummies, fourteen of the registers.
pub const I2C_BYTES: u32 = 1 + 1 + 1 + 16;
/// Events at which the clock is held until the interrupt has run: two starts, two addresses, one byte out, sixteen in,
/// and one in hand.
pub const I2C_EVENTS: u32 = 22;
/// Longest time from the event to the end of its interrupt, ns: 336 clocks at 168 MHz.
pub const I2C_EVENT_NS: u32 = 2_000;

/// Time of a burst on SPI, ns.
pub const SPI_NS: u32 = SPI_BYTES * 8 * 1_000_000 / (SPI_HZ / 1000);
/// Time of a burst on I²C, ns: nine bits a byte, a clock for each start and stop, and the clock held.
pub const I2C_NS: u32 = (I2C_BYTES * 9 + 3) * 1_000_000 / (I2C_HZ / 1000) + I2C_EVENTS * I2C_EVENT_NS;
/// Time of a sample on the line, ns.
pub const SAMPLE_NS: u32 = wire_len(Layout::DOGGY.payload_len()) as u32 * BITS_PER_BYTE * 1_000_000 / (BAUD / 1000);

/// Most of the tick that a bus may take, ns.
pub const MOST_NS: u32 = TICK_US * 600;

const _: () = {
    assert!(SPI_NS <= MOST_NS && I2C_NS <= MOST_NS && SAMPLE_NS <= MOST_NS);
    assert!(BUS_BOUND_US * 1000 <= MOST_NS && I2C_NS < BUS_BOUND_US * 1000 && SPI_NS < BUS_BOUND_US * 1000);
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_says_what_the_numbers_do() {
        assert_eq!((SPI_NS + 50) / 100, 76);
        assert_eq!(I2C_NS / 1000, 435 + 44);
        assert_eq!(SAMPLE_NS / 1000, 597);
        assert_eq!(SPI_BYTES as usize, crate::driver::ICM42688P_BURST);
        assert_eq!(I2C_BYTES as usize, 3 + crate::driver::BMI323_BURST);
    }
}
