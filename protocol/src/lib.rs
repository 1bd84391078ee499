//! What firmware and host agree on: messages, framing, schema key, link budget.
#![cfg_attr(not(test), no_std)]
