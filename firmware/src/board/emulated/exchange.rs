//! Requests and replies over two FIFOs, by semihosting: the emulator's clock stands still meanwhile.

use core::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use cortex_m_semihosting::debug::{EXIT_FAILURE, exit};
use cortex_m_semihosting::{nr, syscall};
use firmware::lockstep::{FROM_WORLD, Kind, MAX_MESSAGE, Malformed, Request, TO_WORLD};

use super::clock;

/// Handles of the FIFOs, from [`open`] on.
static OUT: AtomicUsize = AtomicUsize::new(0);
static IN: AtomicUsize = AtomicUsize::new(0);

/// Opens both. Waits until the world has.
pub fn open() {
    OUT.store(open_one(TO_WORLD, nr::open::W_TRUNC_BINARY), Relaxed);
    IN.store(open_one(FROM_WORLD, nr::open::R_BINARY), Relaxed);
}

/// A request of this moment.
pub fn request(kind: Kind) -> Request {
    Request { t_us: clock::period_us(), kind }
}

/// Says something that is not answered.
pub fn tell(request: &Request) {
    let mut message = [0; MAX_MESSAGE];
    let Ok(len) = request.write(&mut message) else { end() };
    let arguments = [OUT.load(Relaxed), message.as_ptr() as usize, len];
    // SAFETY: WRITE reads `len` bytes from the buffer, which outlives the call.
    let left = unsafe { syscall(nr::WRITE, &arguments) };
    if left != 0 {
        end();
    }
}

/// Says something and reads the answer, with interrupts off: `idle` asks too, and answers must not cross. A world that is
/// gone, or speaks another version, ends everything.
pub fn ask<T>(request: &Request, read: impl FnOnce(&[u8]) -> Result<T, Malformed>) -> T {
    critical_section::with(|_| ask_alone(request, read))
}

fn ask_alone<T>(request: &Request, read: impl FnOnce(&[u8]) -> Result<T, Malformed>) -> T {
    tell(request);
    let mut message = [0u8; MAX_MESSAGE];
    let arguments = [IN.load(Relaxed), message.as_mut_ptr() as usize, message.len()];
    // SAFETY: READ writes at most as many bytes as the buffer has, and the buffer outlives the call. The world writes
    // a reply in one piece and then waits for the next request, so one read gets it whole.
    let left = unsafe { syscall(nr::READ, &arguments) };
    let got = MAX_MESSAGE.saturating_sub(left);
    match message[..got].split_first() {
        Some((len, body)) if usize::from(*len) == body.len() => read(body).unwrap_or_else(|_| end()),
        _ => end(),
    }
}

/// Ends the emulator: the world is gone or speaks another version.
fn end() -> ! {
    loop {
        exit(EXIT_FAILURE);
    }
}

fn open_one(name: &str, mode: usize) -> usize {
    // OPEN wants a zero behind the name.
    let mut path = [0; 16];
    path[..name.len()].copy_from_slice(name.as_bytes());
    let arguments = [path.as_ptr() as usize, mode, name.len()];
    // SAFETY: OPEN reads the name and its zero from the buffer, which outlives the call.
    let handle = unsafe { syscall(nr::OPEN, &arguments) };
    if handle == usize::MAX { end() } else { handle }
}
