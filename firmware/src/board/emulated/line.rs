//! The line: bytes from the host come with the exchange, bytes for the host leave through the emulated USART.

use core::hint::spin_loop;
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use cortex_m::singleton;
use firmware::wiring;
use heapless::spsc::{Consumer, Producer, Queue};
use protocol::budget::{BAUD, BITS_PER_BYTE};
use protocol::message::MAX_TO_HOST_FRAME;
use stm32f4xx_hal::pac::USART1;

use super::clock;

/// Bytes that wait for the commands task: two periods of the line, and one place more, as such queues need.
const RECEIVED: usize = 193;

/// Ordeals that were announced.
static PANIC: AtomicBool = AtomicBool::new(false);
static HANG: AtomicBool = AtomicBool::new(false);
static OVERFLOW: AtomicBool = AtomicBool::new(false);

/// The transmitter.
pub struct LineOut {
    usart: USART1,
    buffer: [u8; MAX_TO_HOST_FRAME],
    /// Device time, µs, from which the line is free again.
    free_us: u32,
}

/// Where the exchange puts received bytes.
pub struct Arrived(Producer<'static, u8>);
/// The receiver.
pub struct LineIn(Consumer<'static, u8>);

/// Both ends of what is received. To be called once.
pub fn received() -> (Arrived, LineIn) {
    let queue = singleton!(: Queue<u8, RECEIVED> = Queue::new());
    // `start` runs once.
    let (put, take) = queue.expect("the first call").split();
    (Arrived(put), LineIn(take))
}

/// The commands task will panic.
pub fn panic_in_commands() {
    PANIC.store(true, Relaxed);
}

/// The commands task will call itself until no stack is left.
pub fn overflow_in_commands() {
    OVERFLOW.store(true, Relaxed);
}

/// Calls itself; the answer depends on every call, so that none can be left out.
#[inline(never)]
fn descend(depth: u32) -> u32 {
    let room = core::hint::black_box([depth; 16]);
    if OVERFLOW.load(Relaxed) { descend(depth + 1).wrapping_add(room[depth as usize % 16]) } else { room[0] }
}

/// The telemetry task will hang.
pub fn hang_in_telemetry() {
    HANG.store(true, Relaxed);
}

impl Arrived {
    /// Takes bytes; what finds no room is lost, as on a line that nobody reads.
    pub fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let _ = self.0.enqueue(*byte);
        }
    }
}

impl LineOut {
    /// Switches the transmitter on. Its rate does not matter: the emulated USART sends a byte as it is written.
    pub fn new(usart: USART1) -> Self {
        usart.cr1().write(|w| w.ue().set_bit().te().set_bit());
        LineOut { usart, buffer: [0; MAX_TO_HOST_FRAME], free_us: 0 }
    }
}

impl wiring::LineOut for LineOut {
    fn room(&mut self) -> Option<&mut [u8]> {
        let is_free = clock::period_us().wrapping_sub(self.free_us) as i32 >= 0;
        is_free.then_some(&mut self.buffer)
    }

    fn send(&mut self, len: usize) {
        while HANG.load(Relaxed) {
            spin_loop();
        }
        for byte in &self.buffer[..len] {
            self.usart.dr().write(|w| w.dr().set(u16::from(*byte)));
        }
        // At most MAX_TO_HOST_FRAME bytes: the product fits 32 bits.
        let us = (len as u32 * BITS_PER_BYTE * 1000).div_ceil(BAUD / 1000);
        self.free_us = clock::period_us().wrapping_add(us);
    }
}

impl wiring::LineIn for LineIn {
    fn read(&mut self, out: &mut [u8]) -> usize {
        if OVERFLOW.load(Relaxed) {
            core::hint::black_box(descend(0));
        }
        assert!(!PANIC.load(Relaxed), "the world asked for a panic");
        let mut n = 0;
        while n < out.len()
            && let Some(byte) = self.0.dequeue()
        {
            out[n] = byte;
            n += 1;
        }
        n
    }
}
