//! IMU 1 on SPI1: byte by byte for its set-up, by DMA for the burst of a tick.
//!
//! 84 MHz / 8 = 10.5 MHz (the part takes 24), mode 0. Chip select falls at the start of the burst and rises when its last
//! byte is in, by the interrupt of the receiving stream: the part fills its registers while its interface is idle.

use core::convert::Infallible;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Error, ErrorKind, ErrorType, Operation, SpiDevice};
use firmware::GyroInput;
use firmware::driver::ICM42688P_BURST;
use stm32f4xx_hal::gpio::{Alternate, Output, PA4, PA5, PA6, PA7, PinState, Speed};
use stm32f4xx_hal::pac::SPI1;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::Imu1;
use super::clock::CycleDelay;
use super::dma::{self, Memory};

static OUT_MEMORY: Memory<ICM42688P_BURST> = Memory::new();
static IN_MEMORY: Memory<ICM42688P_BURST> = Memory::new();

/// Looks at a flag before it is given up; a byte takes 0.8 µs, this is some 30 µs.
const PATIENCE: u32 = 1000;

/// The peripheral did not move a byte: it is not clocked, or broken. A part that is missing reads as ones.
#[derive(Clone, Copy, Debug)]
pub struct Stuck;

impl Error for Stuck {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// The bus with its one part.
pub struct Spi {
    registers: SPI1,
    select: PA4<Output>,
    /// Clock and data out, data in.
    _pins: ((PA5<Alternate<5>>, PA7<Alternate<5>>), PA6<Alternate<5>>),
}

impl Spi {
    /// Chip select high, clock and data in low.
    pub fn new(registers: SPI1, (select, clock, miso, mosi): (PA4, PA5, PA6, PA7), rcc: &mut Rcc) -> Self {
        let select = select.into_push_pull_output_in_state(PinState::High);
        // At the reset's speed an edge takes up to 100 ns, half a period of the clock is 48. High, not very high: the
        // faster edge rings on a cable.
        let outputs = (clock.into_alternate::<5>().speed(Speed::High), mosi.into_alternate::<5>().speed(Speed::High));
        let pins = (outputs, miso.into_alternate::<5>());
        SPI1::enable(rcc);
        SPI1::reset(rcc);
        registers
            .cr1()
            .write(|w| w.mstr().master().ssm().enabled().ssi().slave_not_selected().br().div8().spe().enabled());
        Spi { registers, select, _pins: pins }
    }

    fn exchange(&mut self, byte: u8) -> Result<u8, Stuck> {
        self.wait(|spi| spi.sr().read().txe().is_empty())?;
        self.registers.dr().write(|w| w.dr().set(byte.into()));
        self.wait(|spi| spi.sr().read().rxne().is_not_empty())?;
        Ok(self.registers.dr().read().bits() as u8)
    }

    fn wait(&self, mut ready: impl FnMut(&SPI1) -> bool) -> Result<(), Stuck> {
        (0..PATIENCE).any(|_| ready(&self.registers)).then_some(()).ok_or(Stuck)
    }

    fn run(&mut self, operation: &mut Operation<'_, u8>) -> Result<(), Stuck> {
        match operation {
            Operation::Read(bytes) => bytes.iter_mut().try_for_each(|byte| {
                *byte = self.exchange(0)?;
                Ok(())
            }),
            Operation::Write(bytes) => bytes.iter().try_for_each(|byte| self.exchange(*byte).map(|_| ())),
            Operation::Transfer(read, write) => {
                let longer = read.len().max(write.len());
                (0..longer).try_for_each(|i| {
                    let got = self.exchange(write.get(i).copied().unwrap_or(0))?;
                    if let Some(byte) = read.get_mut(i) {
                        *byte = got;
                    }
                    Ok(())
                })
            }
            Operation::TransferInPlace(bytes) => bytes.iter_mut().try_for_each(|byte| {
                *byte = self.exchange(*byte)?;
                Ok(())
            }),
            Operation::DelayNs(ns) => {
                CycleDelay.delay_ns(*ns);
                Ok(())
            }
        }
    }
}

impl ErrorType for Spi {
    type Error = Stuck;
}

impl SpiDevice for Spi {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Stuck> {
        self.select.set_low();
        let result = operations.iter_mut().try_for_each(|operation| self.run(operation));
        // The last byte was received, so the clock stands.
        self.select.set_high();
        result
    }
}

/// The burst of a tick.
pub struct Burst {
    spi: Spi,
    failed: bool,
}

impl Burst {
    /// Hands the bus, with a part that is set up, to the streams.
    pub fn new(spi: Spi) -> Self {
        // SAFETY: the stream does not run yet.
        *unsafe { OUT_MEMORY.bytes() } = Imu1::READ_REQUEST;
        let data = spi.registers.dr().as_ptr() as u32;
        let (input, output) = (dma::stream(dma::SPI_IN), dma::stream(dma::SPI_OUT));
        for (stream, memory) in [(input, &IN_MEMORY), (output, &OUT_MEMORY)] {
            // SAFETY: the data register, and memory that only this file touches; as long as the program runs.
            unsafe {
                stream.par().write(|w| w.bits(data));
                stream.m0ar().write(|w| w.bits(memory.address()));
            }
        }
        input.cr().write(|w| {
            w.chsel().set(3).dir().peripheral_to_memory().minc().incremented().pl().very_high().tcie().enabled()
        });
        output.cr().write(|w| w.chsel().set(3).dir().memory_to_peripheral().minc().incremented().pl().high());
        spi.registers.cr2().write(|w| w.rxdmaen().enabled().txdmaen().enabled());
        Burst { spi, failed: false }
    }

    /// Takes the bus back from the streams. Between two bursts.
    pub fn release(self) -> Spi {
        self.spi.registers.cr2().reset();
        self.spi
    }

    /// Starts it.
    pub fn begin(&mut self) {
        self.spi.select.set_low();
        // The receiving stream first and with the higher priority, so that no byte finds the register full.
        for n in [dma::SPI_IN, dma::SPI_OUT] {
            dma::clear(n);
            let stream = dma::stream(n);
            stream.ndtr().write(|w| w.ndt().set(ICM42688P_BURST as u16));
            stream.cr().modify(|_, w| w.tcie().bit(n == dma::SPI_IN).en().enabled());
        }
    }

    /// The last byte is in. The flags stay for [`collect`](Self::collect); the interrupt does not come again.
    pub fn on_interrupt(&mut self) {
        self.spi.select.set_high();
        dma::silence(dma::SPI_IN);
    }

    /// Ends it: the reading, or a bus error if it is not over.
    pub fn collect(&mut self) -> GyroInput {
        let flags = dma::flags(dma::SPI_IN);
        let whole = flags.complete && !flags.error && dma::stream(dma::SPI_IN).ndtr().read().ndt().bits() == 0;
        if !whole {
            dma::halt(dma::SPI_OUT);
            dma::halt(dma::SPI_IN);
            // What the aborted burst left in the receiver is not the next one's first byte.
            let _ = self.spi.registers.dr().read();
            let _ = self.spi.registers.sr().read();
        }
        self.spi.select.set_high();
        if self.failed == whole {
            self.failed = !whole;
            if whole {
                defmt::info!("SPI: bursts complete again");
            } else {
                defmt::error!("SPI: a burst was not over in time, flags {=bool} {=bool}", flags.complete, flags.error);
            }
        }
        if !whole {
            return GyroInput::BusError;
        }
        let mut answer = [0; ICM42688P_BURST];
        for (i, byte) in answer.iter_mut().enumerate() {
            *byte = IN_MEMORY.get(i);
        }
        Ok::<_, Infallible>(Imu1::decode(&answer)).into()
    }
}
