//! IMU 2 on I²C1 at 400 kHz: the state machine of [`firmware::wiring::i2c`] on the peripheral's registers, polled for the
//! set-up and driven by interrupts in the burst of a tick.
//!
//! ```text
//!   burst:     begin ─▶ Busy ─ interrupts ─▶ Done ─▶ collect: reading
//!                                   ╰─ not over, or the bus was lost ─▶ collect: bus error
//!   recovery:  begin: an edge, collect: an edge, … ─▶ after at most 12 ticks the bus is free ─▶ begin
//! ```

use core::convert::Infallible;

use embedded_hal::delay::DelayNs;
use embedded_hal::i2c::{Error, ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use firmware::GyroInput;
use firmware::driver::BMI323_BURST;
use firmware::wiring::i2c::{Events, Lines, MAX_RECOVERY_STEPS, Port, Recovery, State, Transfer};
use stm32f4xx_hal::gpio::{Alternate, OpenDrain, PB8, PB9};
use stm32f4xx_hal::pac::{GPIOB, I2C1};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::Imu2;
use super::clock::CycleDelay;

/// Clock of APB1, MHz.
const APB1_MHZ: u8 = 42;
/// 42 MHz / (3 · 35) = 400 kHz, low twice as long as high.
const FAST_DIVIDER: u16 = 35;
/// Longest rise of the lines, 300 ns, in clocks of APB1, plus one.
const RISE: u8 = 13;
const _: () = {
    assert!(APB1_MHZ as u32 * 1_000_000 / (3 * FAST_DIVIDER as u32) == firmware::wiring::budget::I2C_HZ);
    assert!(RISE as u32 == 300 * APB1_MHZ as u32 / 1000 + 1);
};

/// Longest transfer of the set-up, polls of a few hundred nanoseconds each: some milliseconds.
const PATIENCE: u32 = 20_000;
/// Between two edges of a recovery in the set-up, µs.
const EDGE_US: u32 = 5;
/// From one transfer of the set-up to the next, µs: until the stop condition is made, the control register must not be
/// written.
const PAUSE_US: u32 = 20;

/// The peripheral and its two pins.
pub struct Bus {
    registers: I2C1,
    _pins: (PB8<Alternate<4, OpenDrain>>, PB9<Alternate<4, OpenDrain>>),
}

impl Bus {
    /// Pins and peripheral. Pull-ups of 2.2 kΩ are on the board.
    pub fn new(registers: I2C1, clock: PB8, data: PB9, rcc: &mut Rcc) -> Self {
        let pins = (clock.into_alternate_open_drain::<4>(), data.into_alternate_open_drain::<4>());
        I2C1::enable(rcc);
        I2C1::reset(rcc);
        let mut bus = Bus { registers, _pins: pins };
        bus.set_up();
        bus
    }

    /// From whatever state to idle.
    fn set_up(&mut self) {
        let i2c = &self.registers;
        i2c.cr1().write(|w| w.swrst().set_bit());
        i2c.cr1().reset();
        // SAFETY: a frequency in MHz of 2 to 42, and a divider of at least 1, as RM0090 27.6.2 and 27.6.8 want them.
        unsafe {
            i2c.cr2().write(|w| w.freq().bits(APB1_MHZ));
            i2c.ccr().write(|w| w.f_s().fast().duty().duty2_1().ccr().bits(FAST_DIVIDER));
        }
        i2c.trise().write(|w| w.trise().set(RISE));
        i2c.cr1().write(|w| w.pe().enabled());
    }

    /// Whether a part holds the data line while the peripheral leaves it alone.
    fn is_held(&self) -> bool {
        self.data_is_low()
    }
}

impl Port for Bus {
    fn events(&mut self) -> Events {
        let sr1 = self.registers.sr1().read();
        let events = Events {
            start: sr1.sb().bit_is_set(),
            address: sr1.addr().bit_is_set(),
            byte_finished: sr1.btf().bit_is_set(),
            no_acknowledge: sr1.af().bit_is_set(),
            arbitration_lost: sr1.arlo().bit_is_set(),
        };
        if sr1.bits() & ERRORS != 0 {
            // SAFETY: zeros clear the errors, ones leave a flag alone, the rest is read-only.
            self.registers.sr1().write(|w| unsafe { w.bits(!ERRORS & 0xDF00) });
        }
        events
    }

    fn start(&mut self, acknowledge: bool) {
        self.registers.cr1().modify(|_, w| w.start().start().ack().bit(acknowledge));
    }

    fn pass_address(&mut self) {
        let _ = self.registers.sr2().read();
    }

    fn write(&mut self, byte: u8) {
        self.registers.dr().write(|w| w.dr().set(byte));
    }

    fn read(&mut self) -> u8 {
        self.registers.dr().read().dr().bits()
    }

    fn refuse_next(&mut self) {
        self.registers.cr1().modify(|_, w| w.ack().nak());
    }

    fn stop(&mut self) {
        self.registers.cr1().modify(|_, w| w.stop().stop());
    }

    fn listen(&mut self, on: bool) {
        self.registers.cr2().modify(|_, w| w.itevten().bit(on).iterren().bit(on));
    }
}

/// The peripheral polled: its interrupts stay off.
struct Polled<'a>(&'a mut Bus);

impl Port for Polled<'_> {
    fn events(&mut self) -> Events {
        self.0.events()
    }

    fn start(&mut self, acknowledge: bool) {
        self.0.start(acknowledge);
    }

    fn pass_address(&mut self) {
        self.0.pass_address();
    }

    fn write(&mut self, byte: u8) {
        Port::write(self.0, byte);
    }

    fn read(&mut self) -> u8 {
        Port::read(self.0)
    }

    fn refuse_next(&mut self) {
        self.0.refuse_next();
    }

    fn stop(&mut self) {
        self.0.stop();
    }

    fn listen(&mut self, _on: bool) {}
}

/// SR1: bus error, arbitration lost, no acknowledge, overrun.
const ERRORS: u16 = 0x0F00;

/// Pin numbers on port B.
const CLOCK: u8 = 8;
const DATA: u8 = 9;

/// Port B's registers, for the two pins of the bus.
fn port() -> &'static stm32f4xx_hal::pac::gpiob::RegisterBlock {
    // SAFETY: the mode register of the port is changed here only, once the start is over; set and reset are single
    // writes to the bus's own pins.
    unsafe { &*GPIOB::ptr() }
}

impl Lines for Bus {
    fn take(&mut self) {
        self.registers.cr1().reset();
        self.clock(true);
        self.data(true);
        port().moder().modify(|_, w| w.moder8().output().moder9().output());
    }

    fn give(&mut self) {
        port().moder().modify(|_, w| w.moder8().alternate().moder9().alternate());
        self.set_up();
    }

    fn clock(&mut self, high: bool) {
        port().bsrr().write(|w| if high { w.bs(CLOCK).set_bit() } else { w.br(CLOCK).set_bit() });
    }

    fn data(&mut self, high: bool) {
        port().bsrr().write(|w| if high { w.bs(DATA).set_bit() } else { w.br(DATA).set_bit() });
    }

    fn data_is_low(&self) -> bool {
        port().idr().read().idr(DATA).is_low()
    }
}

/// Why a transfer of the set-up failed.
#[derive(Clone, Copy, Debug)]
pub enum Failure {
    /// Nobody acknowledged.
    NotAcknowledged,
    /// The bus was lost, or nothing happened any more; it was clocked free.
    Hung,
    /// No transfer of this peripheral.
    Unsuited,
}

impl Error for Failure {
    fn kind(&self) -> ErrorKind {
        match self {
            Failure::NotAcknowledged => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Unknown),
            Failure::Hung => ErrorKind::Bus,
            Failure::Unsuited => ErrorKind::Other,
        }
    }
}

/// The bus polled, for the set-up.
pub struct Blocking<'a> {
    bus: &'a mut Bus,
    delay: CycleDelay,
}

impl<'a> Blocking<'a> {
    /// Frees a bus that a part held through the reset.
    pub fn new(bus: &'a mut Bus, delay: CycleDelay) -> Self {
        let mut blocking = Blocking { bus, delay };
        if blocking.bus.is_held() {
            defmt::warn!("I2C: a part holds the bus");
            blocking.free();
        }
        blocking
    }

    fn free(&mut self) {
        let mut recovery = Recovery::default();
        for _ in 0..MAX_RECOVERY_STEPS {
            if recovery.step(self.bus) {
                break;
            }
            self.delay.delay_us(EDGE_US);
        }
    }

    fn run(&mut self, address: u8, out: &[u8], answer: &mut [u8]) -> Result<(), Failure> {
        self.delay.delay_us(PAUSE_US);
        let (mut transfer, mut port) = (Transfer::default(), Polled(&mut *self.bus));
        transfer.begin(&mut port, address, out, answer.len());
        for _ in 0..PATIENCE {
            transfer.step(&mut port);
            match transfer.state() {
                State::Busy => {}
                State::NotAcknowledged => return Err(Failure::NotAcknowledged),
                State::Idle | State::Unsuited => return Err(Failure::Unsuited),
                State::ArbitrationLost => break,
                State::Done => {
                    // The lengths agree: `begin` was given that of `answer`.
                    answer.copy_from_slice(transfer.answer().unwrap_or_default());
                    return Ok(());
                }
            }
        }
        self.free();
        Err(Failure::Hung)
    }
}

impl ErrorType for Blocking<'_> {
    type Error = Failure;
}

impl I2c for Blocking<'_> {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Failure> {
        match operations {
            [Operation::Write(out)] => self.run(address, out, &mut []),
            [Operation::Write(out), Operation::Read(answer)] => self.run(address, out, answer),
            _ => Err(Failure::Unsuited),
        }
    }
}

/// The burst of a tick.
pub struct Burst {
    bus: Bus,
    transfer: Transfer,
    recovery: Option<Recovery>,
    failed: bool,
}

impl Burst {
    /// Nothing under way; the part is set up.
    pub fn new(bus: Bus) -> Self {
        Burst { bus, transfer: Transfer::default(), recovery: None, failed: false }
    }

    /// The bus, silent. Between two bursts.
    pub fn release(mut self) -> Bus {
        self.bus.listen(false);
        self.bus.set_up();
        self.bus
    }

    /// Starts it, or goes on with the recovery.
    pub fn begin(&mut self) {
        if self.recovery.is_some() {
            return self.recover();
        }
        self.transfer.begin(&mut self.bus, Imu2::ADDRESS_SDO_LOW, &Imu2::READ_REQUEST, BMI323_BURST);
    }

    /// An event or an error of the peripheral.
    pub fn on_interrupt(&mut self) {
        self.transfer.step(&mut self.bus);
    }

    /// Ends it: the reading, or a bus error.
    pub fn collect(&mut self) -> GyroInput {
        if self.recovery.is_some() {
            self.recover();
            return GyroInput::BusError;
        }
        let answer = self.transfer.answer().and_then(|answer| <&[u8; BMI323_BURST]>::try_from(answer).ok());
        if let Some(answer) = answer {
            let reading = Imu2::decode(answer);
            if core::mem::take(&mut self.failed) {
                defmt::info!("I2C: answers again");
            }
            return Ok::<_, Infallible>(reading).into();
        }
        let state = self.transfer.state();
        if !core::mem::replace(&mut self.failed, true) {
            match state {
                State::NotAcknowledged => defmt::error!("I2C: nobody acknowledges"),
                State::ArbitrationLost => defmt::error!("I2C: the bus was lost, it is clocked free"),
                _ => defmt::error!("I2C: the burst was not over in time, the bus is clocked free"),
            }
        }
        // A part that does not acknowledge leaves the bus free, unless it holds the data line.
        if state != State::NotAcknowledged || self.bus.is_held() {
            self.bus.listen(false);
            self.transfer = Transfer::default();
            self.recovery = Some(Recovery::default());
        }
        GyroInput::BusError
    }

    fn recover(&mut self) {
        if let Some(recovery) = &mut self.recovery
            && recovery.step(&mut self.bus)
        {
            self.recovery = None;
        }
    }
}
