//! The records of an MCAP file, walked without belief: a length, a checksum or a string that is wrong ends in a value,
//! never in a panic or in an allocation of the size that a damaged byte asks for.
//!
//! ```text
//!   record = opcode u8 │ length u64 │ body
//! ```

use std::io::Read;

use mcap::records::op;

/// Largest chunk that is unpacked. Ours are 64 KiB; a tool that rewrote the file may have made them larger.
const MAX_CHUNK_BYTES: usize = 1 << 28;

/// A record and where it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::recording) struct Record<'a> {
    pub at: usize,
    pub opcode: u8,
    pub body: &'a [u8],
}

/// Whole records, one after the other; the end of the bytes or of sense ends them.
#[derive(Debug)]
pub(in crate::recording) struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Records<'a> {
    pub(in crate::recording) fn from(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// Where the next record would begin: the end of the bytes, if all was well.
    pub(in crate::recording) fn at(&self) -> usize {
        self.at
    }

    /// Where a second file begins behind a whole one: several were put one behind the other.
    pub(in crate::recording) fn next_file(&self) -> Option<usize> {
        // The magic closes a file and begins the next.
        let behind = self.bytes.get(self.at..)?.strip_prefix(mcap::MAGIC)?;
        behind.starts_with(mcap::MAGIC).then_some(self.at + mcap::MAGIC.len())
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut cursor = Cursor(self.bytes.get(self.at..)?);
        let opcode = cursor.u8().filter(|&opcode| opcode != 0)?; // 0 is none: what a disk holds that was never written
        let body = cursor.u64().and_then(|length| cursor.take(usize::try_from(length).ok()?))?;
        let record = Record { at: self.at, opcode, body };
        self.at = self.bytes.len() - cursor.0.len();
        Some(record)
    }
}

/// The records of a chunk, unpacked and checked; the error says what is wrong with it.
pub(in crate::recording) fn unpack_chunk(body: &[u8]) -> Result<Vec<u8>, String> {
    let mut cursor = Cursor(body);
    let header = (|| {
        let _times = (cursor.u64()?, cursor.u64()?);
        Some((cursor.u64()?, cursor.u32()?, cursor.text()?, cursor.u64()?))
    })();
    let (size, crc, compression, packed_size) = header.ok_or("its header is damaged")?;
    let packed =
        usize::try_from(packed_size).ok().and_then(|size| cursor.take(size)).ok_or("it is shorter than it says")?;
    let size = usize::try_from(size).ok().filter(|&size| size <= MAX_CHUNK_BYTES).ok_or("its size is damaged")?;
    let unpacked = match compression {
        "" => packed.to_vec(),
        "zstd" => zstd::bulk::decompress(packed, size).map_err(|error| format!("it does not unpack ({error})"))?,
        "lz4" => unpack_lz4(packed, size).map_err(|error| format!("it does not unpack ({error})"))?,
        other => {
            return Err(format!(
                "its compression `{other}` is not known (zstd, lz4 and none are): mcap compress FILE -o OUT.mcap --compression zstd"
            ));
        }
    };
    if unpacked.len() != size || (crc != 0 && crc != crc32fast::hash(&unpacked)) {
        return Err("its checksum does not fit".to_owned());
    }
    Ok(unpacked)
}

/// At most one byte more than `size`, which the caller tells from a chunk that has what it says.
fn unpack_lz4(packed: &[u8], size: usize) -> std::io::Result<Vec<u8>> {
    let mut unpacked = Vec::with_capacity(size);
    lz4::Decoder::new(packed)?.take(size as u64 + 1).read_to_end(&mut unpacked)?;
    Ok(unpacked)
}

/// Name and content of an attachment whose checksum fits.
pub(in crate::recording) fn attachment(body: &[u8]) -> Option<(&str, &[u8])> {
    let (checked, crc) = body.split_last_chunk::<4>()?;
    if u32::from_le_bytes(*crc) != crc32fast::hash(checked) {
        return None;
    }
    let mut cursor = Cursor(checked);
    let _times = (cursor.u64()?, cursor.u64()?);
    let (name, _media_type) = (cursor.text()?, cursor.text()?);
    let length = usize::try_from(cursor.u64()?).ok()?;
    Some((name, cursor.take(length)?))
}

/// The profile that the file's header names.
pub(in crate::recording) fn profile(header: &[u8]) -> Option<&str> {
    Cursor(header).text()
}

/// Id, name and content of a schema.
pub(in crate::recording) fn schema(body: &[u8]) -> Option<(u16, &str, &[u8])> {
    let mut cursor = Cursor(body);
    let (id, name, _encoding) = (cursor.u16()?, cursor.text()?, cursor.text()?);
    let length = usize::try_from(cursor.u32()?).ok()?;
    Some((id, name, cursor.take(length)?))
}

/// A channel.
#[derive(Debug, Clone, Copy)]
pub(in crate::recording) struct Channel<'a> {
    pub id: u16,
    /// Id of its schema.
    pub schema: u16,
    pub topic: &'a str,
    /// How its messages are encoded.
    pub encoding: &'a str,
}

pub(in crate::recording) fn channel(body: &[u8]) -> Option<Channel<'_>> {
    let mut cursor = Cursor(body);
    Some(Channel { id: cursor.u16()?, schema: cursor.u16()?, topic: cursor.text()?, encoding: cursor.text()? })
}

/// A message.
#[derive(Debug, Clone, Copy)]
pub(in crate::recording) struct Message<'a> {
    /// Id of its channel.
    pub channel: u16,
    /// When it was written, ns of the clock of the file.
    pub log_ns: u64,
    pub content: &'a [u8],
}

pub(in crate::recording) fn message(body: &[u8]) -> Option<Message<'_>> {
    let mut cursor = Cursor(body);
    let channel = cursor.u16()?;
    let (_sequence, log_ns, _publish_ns) = (cursor.u32()?, cursor.u64()?, cursor.u64()?);
    Some(Message { channel, log_ns, content: cursor.0 })
}

/// What a record is called in a message to the user.
pub(in crate::recording) fn name(opcode: u8) -> &'static str {
    match opcode {
        op::ATTACHMENT => "attachment",
        op::CHUNK => "chunk",
        op::MESSAGE => "message",
        op::CHANNEL => "channel",
        op::SCHEMA => "schema",
        _ => "record",
    }
}

struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*taken)
    }

    fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = usize::try_from(self.u32()?).ok()?;
        std::str::from_utf8(self.take(length)?).ok()
    }
}
