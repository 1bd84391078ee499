//! DMA2: which stream serves whom, and memory that both a stream and the program touch.
//!
//! | stream | channel | serves | RM0090 table 43 |
//! |---|---|---|---|
//! | 0 | 3 | SPI1_RX | |
//! | 3 | 3 | SPI1_TX | |
//! | 5 | 4 | USART1_RX | |
//! | 7 | 4 | USART1_TX | |

use core::cell::UnsafeCell;

use stm32f4xx_hal::pac::DMA2;
use stm32f4xx_hal::pac::dma2::ST;
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// SPI1 in.
pub const SPI_IN: usize = 0;
/// SPI1 out.
pub const SPI_OUT: usize = 3;
/// USART1 in.
pub const LINE_IN: usize = 5;
/// USART1 out.
pub const LINE_OUT: usize = 7;

/// Switches the controller on.
pub fn enable(_dma: &DMA2, rcc: &mut Rcc) {
    DMA2::enable(rcc);
    DMA2::reset(rcc);
}

/// The registers of a stream; each is touched by its owner only, so that streams need no lock.
pub fn stream(n: usize) -> &'static ST {
    // SAFETY: the address is that of the peripheral, and `n` is one of the constants above, each of which one owner
    // uses. Flags, which streams share, are cleared by writing ones to the stream's own.
    unsafe { &*DMA2::ptr() }.st(n)
}

/// Flags of a stream.
#[derive(Clone, Copy)]
pub struct Flags {
    /// All bytes were moved.
    pub complete: bool,
    /// An address could not be reached.
    pub error: bool,
}

/// The flags of stream `n`.
pub fn flags(n: usize) -> Flags {
    // SAFETY: reads only.
    let dma = unsafe { &*DMA2::ptr() };
    let word = if n < 4 { dma.lisr().read().bits() } else { dma.hisr().read().bits() } >> FLAG_SHIFT[n % 4];
    Flags { complete: word & 1 << 5 != 0, error: word & (1 << 3 | 1 << 2) != 0 }
}

/// Clears the flags of stream `n`.
pub fn clear(n: usize) {
    let word = 0x3D << FLAG_SHIFT[n % 4];
    // SAFETY: ones clear the flags of this stream, zeros leave the others alone.
    unsafe {
        let dma = &*DMA2::ptr();
        if n < 4 {
            dma.lifcr().write(|w| w.bits(word))
        } else {
            dma.hifcr().write(|w| w.bits(word))
        };
    }
}

/// The interrupt of stream `n`, which has come to its end, does not come again; its flags stay.
pub fn silence(n: usize) {
    stream(n).cr().modify(|_, w| w.tcie().disabled());
}

/// Where the six bits of a stream begin in its register of flags (RM0090 10.5.1).
const FLAG_SHIFT: [u32; 4] = [0, 6, 16, 22];

/// Switches a stream off and waits until the byte under way is done: at most a byte's time.
pub fn halt(n: usize) {
    stream(n).cr().modify(|_, w| w.en().disabled());
    // A stream ends within the access under way, some tens of cycles; the bound is for a part that is broken.
    for _ in 0..1000 {
        if stream(n).cr().read().en().is_disabled() {
            break;
        }
    }
    clear(n);
}

/// Memory for a stream.
pub struct Memory<const N: usize>(UnsafeCell<[u8; N]>);

// SAFETY: every use is by the one owner of the stream that the memory serves.
unsafe impl<const N: usize> Sync for Memory<N> {}

impl<const N: usize> Memory<N> {
    /// Zeros.
    pub const fn new() -> Self {
        Memory(UnsafeCell::new([0; N]))
    }

    /// For the stream's address register.
    pub fn address(&self) -> u32 {
        self.0.get() as u32
    }

    /// What byte `i` (modulo the length) is now.
    pub fn get(&self, i: usize) -> u8 {
        // SAFETY: within the memory; volatile because a stream may write it. Any byte is valid.
        unsafe { self.0.get().cast::<u8>().add(i % N).read_volatile() }
    }

    /// The bytes, to be written.
    ///
    /// # Safety
    /// Only by the stream's owner while the stream does not run, and not twice at a time.
    #[allow(clippy::mut_from_ref, reason = "the caller promises to be the only one")]
    pub unsafe fn bytes(&self) -> &mut [u8; N] {
        // SAFETY: the caller's promise.
        unsafe { &mut *self.0.get() }
    }
}
