//! An observer's numbers as bytes, as a device stores them. Integers and floats are little-endian; `host/doc/observer.md` has the layout.

use observer::{Instruction, Operation, Output, Start};

use super::table::OwnedTape;
use super::{Numbers, ObserveError};

/// First bytes of a file.
const MAGIC: [u8; 4] = *b"OBSV";

/// Version of the layout.
const VERSION: u16 = 1;

/// In place of a reading, where a component starts from its value.
const NO_READING: u16 = u16::MAX;

/// Bytes of the checksum.
const CHECKSUM: usize = 4;

/// Every operation, in the order of their codes.
const OPERATIONS: [Operation; 13] = [
    Operation::Add,
    Operation::Sub,
    Operation::Mul,
    Operation::Div,
    Operation::Neg,
    Operation::Sin,
    Operation::Cos,
    Operation::Exp,
    Operation::Ln,
    Operation::Tanh,
    Operation::Sqrt,
    Operation::Abs,
    Operation::WherePositive,
];

/// Why bytes are no observer's numbers.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BytesError {
    /// Another file.
    #[error("the file begins with {found:02x?} and not with `OBSV`: give one that `host export --observer` wrote")]
    Magic {
        /// What it begins with.
        found: Vec<u8>,
    },
    /// Another layout.
    #[error(
        "the file has layout {found}, this program reads layout {VERSION}: write it anew with `host export --observer`"
    )]
    Version {
        /// Of the file.
        found: u16,
    },
    /// Damage.
    #[error("the file's checksum is {stored:08x}, its bytes give {computed:08x}: copy it anew")]
    Checksum {
        /// In the file.
        stored: u32,
        /// Of its bytes.
        computed: u32,
    },
    /// Too few or too many bytes.
    #[error("the file ends at byte {length}, its counts ask for another length: copy it anew")]
    Length {
        /// Of the file.
        length: usize,
    },
    /// An operation that is none.
    #[error(
        "instruction {number} has the code {code}, codes are 0 to 12: write the file anew with `host export --observer`"
    )]
    Operation {
        /// Which instruction of its tape.
        number: usize,
        /// Its code.
        code: u8,
    },
}

impl Numbers {
    /// The bytes that a device stores.
    ///
    /// # Errors
    /// [`ObserveError::Large`] if a count does not fit into 16 bits.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ObserveError> {
        let short = |count: usize| u16::try_from(count).map_err(|_| ObserveError::Large);
        let mut bytes = MAGIC.to_vec();
        for value in [VERSION, short(self.moving)?, short(self.states)?, short(self.inputs)?, short(self.readings)?, 0]
        {
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend(self.period_s.to_le_bytes());
        for (sigma, is_gyro) in self.sigma.iter().zip(&self.is_gyro) {
            bytes.extend(sigma.to_le_bytes());
            bytes.extend(u32::from(*is_gyro).to_le_bytes());
        }
        for (process, start) in self.process.iter().zip(&self.start) {
            bytes.extend(process.to_le_bytes());
            bytes.extend(start.value.to_le_bytes());
            bytes.extend(start.sigma.to_le_bytes());
            bytes.extend(start.reading.unwrap_or(NO_READING).to_le_bytes());
            bytes.extend([0; 2]);
        }
        for tape in [&self.rates, &self.rates_slopes, &self.readings_slopes] {
            for count in [tape.constants.len(), tape.instructions.len(), tape.outputs.len()] {
                bytes.extend(short(count)?.to_le_bytes());
            }
            bytes.extend([0; 2]);
            tape.constants.iter().for_each(|constant| bytes.extend(constant.to_le_bytes()));
            for instruction in &tape.instructions {
                bytes.extend([instruction.operation as u8, 0]);
                instruction.operands.iter().for_each(|operand| bytes.extend(operand.to_le_bytes()));
            }
            for output in &tape.outputs {
                bytes.extend(output.place.to_le_bytes());
                bytes.extend(output.value.to_le_bytes());
            }
        }
        let checksum = crc32fast::hash(&bytes);
        bytes.extend(checksum.to_le_bytes());
        Ok(bytes)
    }

    /// The numbers that these bytes hold.
    ///
    /// # Errors
    /// [`BytesError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BytesError> {
        let length = bytes.len();
        if !bytes.starts_with(&MAGIC) {
            return Err(BytesError::Magic { found: bytes[..length.min(MAGIC.len())].to_vec() });
        }
        let (content, stored) = bytes.split_last_chunk::<CHECKSUM>().ok_or(BytesError::Length { length })?;
        let mut from = Reader { rest: content.get(MAGIC.len()..).ok_or(BytesError::Length { length })?, length };
        let found = from.short()?;
        if found != VERSION {
            return Err(BytesError::Version { found });
        }
        let (stored, computed) = (u32::from_le_bytes(*stored), crc32fast::hash(content));
        if stored != computed {
            return Err(BytesError::Checksum { stored, computed });
        }
        let [moving, states, inputs, readings, _] = from.counts()?;
        let period_s = from.float()?;
        let (mut sigma, mut is_gyro) = (Vec::new(), Vec::new());
        for _ in 0..readings {
            sigma.push(from.float()?);
            is_gyro.push(from.take::<4>()? != [0; 4]);
        }
        let (mut process, mut start) = (Vec::new(), Vec::new());
        for _ in 0..states {
            process.push(from.float()?);
            let (value, sigma) = (from.float()?, from.float()?);
            let reading = Some(from.short()?).filter(|reading| *reading != NO_READING);
            from.short()?;
            start.push(Start { reading, value, sigma });
        }
        let (rates, rates_slopes, readings_slopes) = (from.tape()?, from.tape()?, from.tape()?);
        if !from.rest.is_empty() {
            return Err(BytesError::Length { length });
        }
        Ok(Numbers {
            moving,
            states,
            inputs,
            readings,
            rates,
            rates_slopes,
            readings_slopes,
            period_s,
            sigma,
            is_gyro,
            process,
            start,
        })
    }
}

/// Bytes that are still to be read, of a file of this length.
struct Reader<'b> {
    rest: &'b [u8],
    length: usize,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], BytesError> {
        let (first, rest) = self.rest.split_first_chunk::<N>().ok_or(BytesError::Length { length: self.length })?;
        self.rest = rest;
        Ok(*first)
    }

    fn short(&mut self) -> Result<u16, BytesError> {
        self.take().map(u16::from_le_bytes)
    }

    fn float(&mut self) -> Result<f32, BytesError> {
        self.take().map(f32::from_le_bytes)
    }

    fn counts<const N: usize>(&mut self) -> Result<[usize; N], BytesError> {
        let mut counts = [0; N];
        for count in &mut counts {
            *count = usize::from(self.short()?);
        }
        Ok(counts)
    }

    fn tape(&mut self) -> Result<OwnedTape, BytesError> {
        let [constants, instructions, outputs, _] = self.counts()?;
        let constants = (0..constants).map(|_| self.float()).collect::<Result<_, _>>()?;
        let instruction = |number: usize| {
            let [code, _] = self.take()?;
            let operation = OPERATIONS.get(usize::from(code)).copied();
            let operation = operation.ok_or(BytesError::Operation { number, code })?;
            Ok(Instruction { operation, operands: [self.short()?, self.short()?, self.short()?] })
        };
        let instructions = (0..instructions).map(instruction).collect::<Result<_, _>>()?;
        let outputs = (0..outputs).map(|_| Ok(Output { place: self.short()?, value: self.short()? }));
        Ok(OwnedTape { constants, instructions, outputs: outputs.collect::<Result<_, BytesError>>()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::Exported;
    use crate::observe::tests::made_up;

    #[test]
    fn operations_have_their_codes() {
        assert!(OPERATIONS.iter().enumerate().all(|(code, operation)| *operation as usize == code));
    }

    #[test]
    fn bytes_give_the_same_numbers_and_damage_is_refused() {
        for (robot, extensions) in [("doggy", &["base_bearing"][..]), ("rigid", &[])] {
            let calibration = made_up(robot, extensions);
            let numbers = Numbers::of(&Exported::of(&calibration).unwrap()).unwrap();
            let bytes = numbers.to_bytes().unwrap();
            assert_eq!(Numbers::from_bytes(&bytes).unwrap(), numbers);
            assert_eq!(Numbers::from_bytes(&bytes).unwrap().to_bytes().unwrap(), bytes);
            println!("{robot} {extensions:?}: {} bytes", bytes.len());
            for place in (0..bytes.len()).step_by(101).chain([bytes.len() - 1]) {
                let mut damaged = bytes.clone();
                damaged[place] ^= 1;
                assert!(Numbers::from_bytes(&damaged).is_err(), "byte {place}");
            }
            for length in (0..bytes.len()).step_by(997) {
                assert!(Numbers::from_bytes(&bytes[..length]).is_err(), "{length} bytes");
            }
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_its_number() {
        let signed = |content: &[u8]| [content, &crc32fast::hash(content).to_le_bytes()].concat();
        let refused = |bytes: &[u8]| Numbers::from_bytes(bytes).unwrap_err();
        assert_eq!(refused(b"MCAP...."), BytesError::Magic { found: b"MCAP".to_vec() });
        assert_eq!(refused(b"OB"), BytesError::Magic { found: b"OB".to_vec() });
        assert_eq!(refused(b"OBSV"), BytesError::Length { length: 4 });
        assert_eq!(refused(&signed(b"OBSV\x02\x00")), BytesError::Version { found: 2 });
        assert_eq!(refused(&signed(b"OBSV\x01\x00")), BytesError::Length { length: 10 });
        // No state and no reading, the period, one instruction of code 13.
        let tape = [0_u16, 1, 0, 0].map(u16::to_le_bytes).concat();
        let content = [&b"OBSV\x01\x00"[..], &[0; 10], &[0; 4], &tape, &[13, 0, 0, 0, 0, 0, 0, 0]].concat();
        assert_eq!(refused(&signed(&content)), BytesError::Operation { number: 0, code: 13 });
    }
}
