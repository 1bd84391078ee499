//! The little of CDR, the encoding of ROS 2 messages, that joint states need.
//!
//! ```text
//!   00 01 00 00 │ …            plain CDR, little-endian (00 00: big-endian); places count from behind these four bytes
//!   numbers stand at multiples of their size; string: length u32 with its closing 0, bytes; sequence: length u32, elements
//! ```

/// `sensor_msgs/msg/JointState`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JointState {
    /// Stamp of its header, ns since the epoch of its clock.
    pub stamp_ns: i128,
    pub names: Vec<String>,
    /// rad or m; as many as names, or none.
    pub position: Vec<f64>,
    /// rad/s or m/s.
    pub velocity: Vec<f64>,
    /// N m or N.
    pub effort: Vec<f64>,
}

/// The joint state in `bytes`; nothing if they are none.
pub(super) fn joint_state(bytes: &[u8]) -> Option<JointState> {
    let (head, body) = bytes.split_first_chunk::<4>()?;
    let little = match head[..2] {
        [0, 0] => false,
        [0, 1] => true,
        _ => return None,
    };
    let mut reader = Reader { body, at: 0, little };
    let (seconds, nanoseconds) = (reader.u32()? as i32, reader.u32()?);
    let _frame = reader.text()?;
    let count = reader.count(4)?;
    let names = (0..count).map(|_| reader.text()).collect::<Option<Vec<_>>>()?;
    let (position, velocity, effort) = (reader.doubles()?, reader.doubles()?, reader.doubles()?);
    let fits = |values: &[f64]| values.is_empty() || values.len() == names.len();
    if ![&position, &velocity, &effort].into_iter().all(|values| fits(values)) {
        return None;
    }
    let stamp_ns = i128::from(seconds) * 1_000_000_000 + i128::from(nanoseconds);
    Some(JointState { stamp_ns, names, position, velocity, effort })
}

struct Reader<'a> {
    body: &'a [u8],
    at: usize,
    little: bool,
}

impl Reader<'_> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        let bytes = self.body.get(from..from.checked_add(N)?)?;
        self.at = from + N;
        bytes.try_into().ok()
    }

    fn u32(&mut self) -> Option<u32> {
        let bytes = self.array()?;
        Some(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    fn f64(&mut self) -> Option<f64> {
        let bytes = self.array()?;
        Some(if self.little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) })
    }

    /// Length of a sequence whose elements have at least so many bytes: no more than the message has room for.
    fn count(&mut self, least: usize) -> Option<usize> {
        let count = usize::try_from(self.u32()?).ok()?;
        (count.checked_mul(least)? <= self.body.len() - self.at).then_some(count)
    }

    fn text(&mut self) -> Option<String> {
        let length = self.count(1)?;
        let bytes = &self.body[self.at..self.at + length];
        self.at += length;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).ok().map(str::to_owned)
    }

    fn doubles(&mut self) -> Option<Vec<f64>> {
        let count = self.count(8)?;
        (0..count).map(|_| self.f64()).collect()
    }
}
