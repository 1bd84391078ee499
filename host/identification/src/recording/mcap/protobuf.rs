//! The little of protobuf that recordings need: flat messages whose fields are known at run time.
//!
//! A robot's channels decide which columns a sample has, so the message types cannot be Rust types. What is written is
//! ordinary proto3; the schema is a `FileDescriptorSet`, as MCAP wants it, so that any viewer shows `/sample.theta1`.
//!
//! ```text
//!   field = key varint (number << 3 | wire type) + value
//!           wire type 0: varint │ 1: 8 bytes little-endian │ 2: length varint + bytes │ 5: 4 bytes
//! ```

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// `uint64`
    Unsigned,
    /// `double`
    Double,
    /// `string`
    Text,
}

impl Kind {
    fn descriptor_type(self) -> Type {
        match self {
            Self::Unsigned => Type::Uint64,
            Self::Double => Type::Double,
            Self::Text => Type::String,
        }
    }

    fn of(descriptor: &FieldDescriptorProto) -> Option<Self> {
        if descriptor.label() == Label::Repeated {
            return None;
        }
        match descriptor.r#type() {
            Type::Uint64 | Type::Uint32 => Some(Self::Unsigned),
            Type::Double => Some(Self::Double),
            Type::String => Some(Self::Text),
            _ => None,
        }
    }
}

/// One field of a message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub name: String,
    pub number: u32,
    pub kind: Kind,
}

/// A flat message type: what is written, or what a file says it contains.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MessageType {
    /// Full name with its package, `recording.Sample`.
    pub name: String,
    pub fields: Vec<Field>,
}

impl MessageType {
    /// A type whose fields are numbered from 1 in the order given.
    pub(super) fn new<'a>(name: &str, fields: impl IntoIterator<Item = (&'a str, Kind)>) -> Self {
        let fields = fields
            .into_iter()
            .zip(1..)
            .map(|((name, kind), number)| Field { name: name.to_owned(), number, kind })
            .collect();
        Self { name: name.to_owned(), fields }
    }

    /// The serialised `FileDescriptorSet` that goes into the file.
    pub(super) fn descriptor(&self) -> Vec<u8> {
        let (package, name) = self.name.rsplit_once('.').unwrap_or(("", &self.name));
        let field = |field: &Field| FieldDescriptorProto {
            name: Some(field.name.clone()),
            number: Some(field.number as i32),
            label: Some(Label::Optional as i32),
            r#type: Some(field.kind.descriptor_type() as i32),
            ..Default::default()
        };
        let message = DescriptorProto {
            name: Some(name.to_owned()),
            field: self.fields.iter().map(field).collect(),
            ..Default::default()
        };
        let file = FileDescriptorProto {
            name: Some(format!("{}.proto", name.to_lowercase())),
            package: (!package.is_empty()).then(|| package.to_owned()),
            message_type: vec![message],
            syntax: Some("proto3".to_owned()),
            ..Default::default()
        };
        FileDescriptorSet { file: vec![file] }.encode_to_vec()
    }

    /// Reads the type `name` from a file's schema. Fields of kinds that are not known here are left out: a later
    /// version may have added them. `None` if the bytes are no schema or do not hold that type.
    pub(super) fn from_descriptor(name: &str, bytes: &[u8]) -> Option<Self> {
        let (package, short) = name.rsplit_once('.').unwrap_or(("", name));
        let set = FileDescriptorSet::decode(bytes).ok()?;
        let file = set.file.iter().find(|file| file.package() == package)?;
        let message = file.message_type.iter().find(|message| message.name() == short)?;
        let fields = message
            .field
            .iter()
            .filter_map(|field| {
                let number = u32::try_from(field.number()).ok()?;
                Some(Field { name: field.name().to_owned(), number, kind: Kind::of(field)? })
            })
            .collect();
        Some(Self { name: name.to_owned(), fields })
    }
}

/// Writes the fields of one message into a buffer that is used again and again.
#[derive(Debug, Default)]
pub(super) struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    pub(super) fn clear(&mut self) -> &mut Self {
        self.bytes.clear();
        self
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    pub(super) fn unsigned(&mut self, number: u32, value: u64) -> &mut Self {
        self.varint(u64::from(number) << 3);
        self.varint(value);
        self
    }

    pub(super) fn double(&mut self, number: u32, value: f64) -> &mut Self {
        self.varint(u64::from(number) << 3 | 1);
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self
    }

    pub(super) fn text(&mut self, number: u32, value: &str) -> &mut Self {
        self.varint(u64::from(number) << 3 | 2);
        self.varint(value.len() as u64);
        self.bytes.extend_from_slice(value.as_bytes());
        self
    }

    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }
}

/// A field as it stands in the bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Value<'a> {
    Unsigned(u64),
    Double(f64),
    Bytes(&'a [u8]),
    /// Four bytes: no kind of ours.
    Fixed32,
}

/// The fields of a message in the order of its bytes; ends with an error if the bytes are no message.
pub(super) struct Fields<'a> {
    bytes: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.bytes.split_first()?;
            self.bytes = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(taken)
    }

    fn field(&mut self) -> Option<(u32, Value<'a>)> {
        let key = self.varint()?;
        let number = u32::try_from(key >> 3).ok().filter(|&number| number > 0)?;
        let value = match key & 7 {
            0 => Value::Unsigned(self.varint()?),
            1 => Value::Double(f64::from_le_bytes(self.take(8)?.try_into().ok()?)),
            2 => {
                let length = usize::try_from(self.varint()?).ok()?;
                Value::Bytes(self.take(length)?)
            }
            5 => {
                self.take(4)?;
                Value::Fixed32
            }
            _ => return None,
        };
        Some((number, value))
    }
}

/// The bytes are no protobuf message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NoMessage;

impl<'a> Iterator for Fields<'a> {
    type Item = Result<(u32, Value<'a>), NoMessage>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.bytes.is_empty() {
            return None;
        }
        let field = self.field().ok_or(NoMessage);
        if field.is_err() {
            self.bytes = &[];
        }
        Some(field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_are_those_of_the_protobuf_manual() {
        // "Test1 { a: 150 }" and "Test2 { b: "testing" }" of the encoding guide.
        let mut encoder = Encoder::default();
        assert_eq!(encoder.unsigned(1, 150).bytes(), [0x08, 0x96, 0x01]);
        let expected = [0x12, 0x07, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67];
        assert_eq!(encoder.clear().text(2, "testing").bytes(), expected);
    }

    #[test]
    fn a_schema_tells_its_fields() {
        let written = MessageType::new("recording.Sample", [("t_us", Kind::Unsigned), ("theta1", Kind::Double)]);
        let read = MessageType::from_descriptor("recording.Sample", &written.descriptor());
        assert_eq!(read.as_ref(), Some(&written));
        assert_eq!(MessageType::from_descriptor("recording.Event", &written.descriptor()), None);
    }

    proptest! {
        #[test]
        fn fields_come_back(a: u64, b: f64, c: String, numbers in prop::array::uniform3(1u32..5000)) {
            let mut encoder = Encoder::default();
            encoder.unsigned(numbers[0], a).double(numbers[1], b).text(numbers[2], &c);
            let fields: Vec<_> = Fields::of(encoder.bytes()).map(Result::unwrap).collect();
            prop_assert_eq!(fields[0], (numbers[0], Value::Unsigned(a)));
            let Value::Double(read) = fields[1].1 else { panic!("{:?}", fields[1]) };
            prop_assert_eq!((fields[1].0, read.to_bits()), (numbers[1], b.to_bits()));
            prop_assert_eq!(fields[2], (numbers[2], Value::Bytes(c.as_bytes())));
            prop_assert_eq!(fields.len(), 3);
        }

        #[test]
        fn any_bytes_end(bytes: Vec<u8>) {
            prop_assert!(Fields::of(&bytes).count() <= bytes.len());
            let _ = MessageType::from_descriptor("recording.Sample", &bytes);
        }
    }
}
