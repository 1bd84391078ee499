//! Setting a gyro up at the start, with what goes wrong in the log.

use firmware::driver::GyroError;

/// Attempts before a gyro is left alone. The loop then runs without it, and refuses to move.
const ATTEMPTS: u8 = 3;

/// Tries to set gyro `number` (from 1) up; `address` gives a register's. Whether it is there.
pub fn set_up<R, E, T>(
    number: u8,
    mut attempt: impl FnMut() -> Result<T, GyroError<R, E>>,
    address: impl Fn(R) -> u8,
) -> bool {
    for _ in 0..ATTEMPTS {
        match attempt() {
            Ok(_) => {
                defmt::info!("gyro {=u8}: set up", number);
                return true;
            }
            Err(GyroError::Bus { register, .. }) => {
                defmt::error!("gyro {=u8}: no answer at register {=u8:#04x}", number, address(register));
            }
            Err(GyroError::WrongId { register, expected, got }) => defmt::error!(
                "gyro {=u8}: another part, register {=u8:#04x} is {=u16:#06x} instead of {=u16:#06x}",
                number,
                address(register),
                got,
                expected
            ),
            Err(GyroError::Unexpected { register, mask, expected, got }) => defmt::error!(
                "gyro {=u8}: register {=u8:#04x} is {=u16:#06x} instead of {=u16:#06x} under {=u16:#06x}",
                number,
                address(register),
                got,
                expected,
                mask
            ),
        }
    }
    defmt::error!("gyro {=u8}: left alone; nothing will move", number);
    false
}
