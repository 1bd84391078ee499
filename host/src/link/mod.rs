//! A serial device: open, handshake, frames, clock, loss balance.
