//! The line to the host: USART1 at 921,600 baud, both directions by DMA.
//!
//! ```text
//!   out:  room() ─▶ frames into the buffer ─▶ send() ─ DMA2 stream 7 ─▶ USART1 ─▶ transfer complete: telemetry runs
//!   in:   USART1 ─ DMA2 stream 5, circular, 256 bytes ─▶ read(), every tick
//! ```
//!
//! 256 bytes last 2.8 ms at full rate; the commands task reads every tick. Should it ever stay away longer, the frames
//! overwritten fail their checksum and the host repeats them.

use firmware::wiring;
use protocol::budget::BAUD;
use protocol::message::MAX_TO_HOST_FRAME;
use stm32f4xx_hal::gpio::{PA9, PA10};
use stm32f4xx_hal::pac::USART1;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::dma::{self, Memory};

const APB2_HZ: u32 = 84_000_000;
/// Sixteenths of the divider are its fraction; with 16 samples a bit the register is clock / baud.
const DIVIDER: u32 = (APB2_HZ + BAUD / 2) / BAUD;
const _: () = {
    // Off by 0.16 %; a frame of ten bits bears 2 % or more.
    let error_ppm = (APB2_HZ / DIVIDER).abs_diff(BAUD) as u64 * 1_000_000 / BAUD as u64;
    assert!(error_ppm < 2_000);
};
const IN: usize = 256;

static OUT_MEMORY: Memory<MAX_TO_HOST_FRAME> = Memory::new();
static IN_MEMORY: Memory<IN> = Memory::new();

/// The transmitter.
pub struct LineOut(());

/// The receiver.
pub struct LineIn {
    taken: usize,
}

/// Starts both.
pub fn start(usart: USART1, tx: PA9, rx: PA10, rcc: &mut Rcc) -> (LineOut, LineIn) {
    // Pulled up: an open line is an idle line.
    let _ = (tx.into_alternate::<7>(), rx.into_alternate::<7>().internal_pull_up(true));
    USART1::enable(rcc);
    USART1::reset(rcc);
    // SAFETY: mantissa and fraction as RM0090 30.6.3 has them.
    usart.brr().write(|w| unsafe { w.bits(DIVIDER as u16) });
    usart.cr3().write(|w| w.dmat().enabled().dmar().enabled());
    usart.cr1().write(|w| w.ue().enabled().te().enabled().re().enabled());
    let data = usart.dr().as_ptr() as u32;
    let stream = dma::stream(dma::LINE_IN);
    // SAFETY: the data register, and memory that nobody else writes; as long as the program runs.
    unsafe {
        stream.par().write(|w| w.bits(data));
        stream.m0ar().write(|w| w.bits(IN_MEMORY.address()));
    }
    stream.ndtr().write(|w| w.ndt().set(IN as u16));
    stream
        .cr()
        .write(|w| w.chsel().set(4).dir().peripheral_to_memory().minc().incremented().circ().enabled().pl().medium());
    stream.cr().modify(|_, w| w.en().enabled());
    let stream = dma::stream(dma::LINE_OUT);
    // SAFETY: as above; the memory is written by `room`'s caller while the stream stands.
    unsafe {
        stream.par().write(|w| w.bits(data));
        stream.m0ar().write(|w| w.bits(OUT_MEMORY.address()));
    }
    (LineOut(()), LineIn { taken: 0 })
}

/// Clears an overrun or a framing error of the receiver, which a break or a line that is plugged in leaves: with an overrun
/// standing no byte reaches the stream any more. Reading the status, then the data register, clears; only while nothing
/// comes in, for a byte that waits there would be lost.
fn clear_errors() {
    // SAFETY: reads only, and the data register by the receiver's owner.
    let usart = unsafe { &*USART1::ptr() };
    let status = usart.sr().read();
    if status.ore().bit_is_set() || status.fe().bit_is_set() || status.nf().bit_is_set() {
        let _ = usart.dr().read();
    }
}

impl wiring::LineOut for LineOut {
    fn room(&mut self) -> Option<&mut [u8]> {
        // A stream switches itself off at its end, and at an error, after which the frames are lost on the line.
        if dma::stream(dma::LINE_OUT).cr().read().en().is_enabled() {
            return None;
        }
        dma::clear(dma::LINE_OUT);
        // SAFETY: the stream stands, and `&mut self` is the only way here.
        Some(unsafe { OUT_MEMORY.bytes() })
    }

    fn send(&mut self, len: usize) {
        let stream = dma::stream(dma::LINE_OUT);
        if len == 0 || stream.cr().read().en().is_enabled() {
            return;
        }
        // The memory holds fewer than 2¹⁶ bytes.
        stream.ndtr().write(|w| w.ndt().set(len.min(MAX_TO_HOST_FRAME) as u16));
        stream.cr().write(|w| {
            w.chsel().set(4).dir().memory_to_peripheral().minc().incremented().tcie().enabled().teie().enabled()
        });
        // What was written to the memory must be there before the stream reads it.
        cortex_m::asm::dmb();
        stream.cr().modify(|_, w| w.en().enabled());
    }
}

impl wiring::LineIn for LineIn {
    fn read(&mut self, out: &mut [u8]) -> usize {
        let left = usize::from(dma::stream(dma::LINE_IN).ndtr().read().ndt().bits());
        // The stream counts down from IN to 1 and starts again.
        let written = (IN - left.min(IN)) % IN;
        let n = ((written + IN - self.taken) % IN).min(out.len());
        if n == 0 {
            clear_errors();
        }
        for byte in &mut out[..n] {
            *byte = IN_MEMORY.get(self.taken);
            self.taken = (self.taken + 1) % IN;
        }
        n
    }
}
