//! Bytes one after the other, within bounds.

use super::{MAX_MESSAGE, MAX_TRANSFER, Malformed, Transfer};

/// Writes a message behind the place of its length.
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    used: usize,
}

impl<'a> Writer<'a> {
    pub fn after_length(out: &'a mut [u8]) -> Self {
        Self { out, used: 1 }
    }

    pub fn head(&mut self, kind: u8, t_us: u32) -> Result<(), Malformed> {
        self.put([kind])?;
        self.put(t_us.to_le_bytes())
    }

    pub fn put<const N: usize>(&mut self, bytes: [u8; N]) -> Result<(), Malformed> {
        self.slice(&bytes)
    }

    pub fn slice(&mut self, bytes: &[u8]) -> Result<(), Malformed> {
        let place = self.out.get_mut(self.used..self.used + bytes.len()).ok_or(Malformed)?;
        place.copy_from_slice(bytes);
        self.used += bytes.len();
        Ok(())
    }

    /// A flag, and the bytes, or as many zeros.
    pub fn optional<const N: usize>(&mut self, bytes: Option<[u8; N]>) -> Result<(), Malformed> {
        self.put([u8::from(bytes.is_some())])?;
        self.put(bytes.unwrap_or([0; N]))
    }

    /// Puts the length in its place; returns that of the whole.
    pub fn finish(self) -> Result<usize, Malformed> {
        const { assert!(MAX_MESSAGE <= u8::MAX as usize) };
        let first = self.out.first_mut().ok_or(Malformed)?;
        *first = u8::try_from(self.used - 1).map_err(|_| Malformed)?;
        Ok(self.used)
    }
}

/// What is left to read.
pub(super) struct Reader<'a>(pub &'a [u8]);

impl Reader<'_> {
    pub fn take<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(Malformed)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub fn flag(&mut self) -> Result<bool, Malformed> {
        match self.take()? {
            [0] => Ok(false),
            [1] => Ok(true),
            _ => Err(Malformed),
        }
    }

    /// What [`Writer::optional`] wrote.
    pub fn optional<const N: usize>(&mut self) -> Result<Option<[u8; N]>, Malformed> {
        let (there, bytes) = (self.flag()?, self.take()?);
        Ok(there.then_some(bytes))
    }

    pub fn u32(&mut self) -> Result<u32, Malformed> {
        self.take().map(u32::from_le_bytes)
    }

    pub fn rest(&mut self) -> Result<Transfer, Malformed> {
        const { assert!(MAX_TRANSFER <= u8::MAX as usize) };
        let rest = core::mem::take(&mut self.0);
        Transfer::from_slice(rest).map_err(|_| Malformed)
    }

    pub fn end(&self) -> Result<(), Malformed> {
        if self.0.is_empty() { Ok(()) } else { Err(Malformed) }
    }
}
