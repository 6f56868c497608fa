//! Encodes a record.

use super::{Fields, Value, Visit, wire_type};

/// Appends `record` to `out`.
pub(crate) fn encode<T: Fields>(record: &T, out: &mut Vec<u8>) {
    record.clone().visit(out);
}

/// Appends a message of a tick, a time and doubles, in the order of its
/// [description](super::numbers_descriptor_set).
pub(crate) fn encode_numbers(mut tick: u64, mut time_ms: f64, values: impl Iterator<Item = f64>, out: &mut Vec<u8>) {
    out.field(1, "", Value::Uint64(&mut tick));
    out.field(2, "", Value::Double(&mut time_ms));
    values.zip(3..).for_each(|(mut value, number)| out.field(number, "", Value::Double(&mut value)));
}

impl Visit for Vec<u8> {
    fn field(&mut self, number: u32, _: &'static str, value: Value<'_>) {
        put_varint(self, u64::from(number << 3 | value.wire_type()));
        match value {
            Value::Uint32(value) => put_varint(self, u64::from(*value)),
            Value::Uint64(value) => put_varint(self, *value),
            Value::Float(value) => self.extend_from_slice(&value.to_le_bytes()),
            Value::Double(value) => self.extend_from_slice(&value.to_le_bytes()),
            Value::String(value) => {
                put_varint(self, value.len() as u64);
                self.extend_from_slice(value.as_bytes());
            }
            Value::Words(value) => {
                put_varint(self, 8 * value.len() as u64);
                value.iter().for_each(|word| self.extend_from_slice(&word.to_le_bytes()));
            }
            Value::Message(_, fields) => {
                let length_at = self.len();
                self.push(0);
                fields(self);
                let length = self.len() - length_at - 1;
                debug_assert!(length < 0x80, "nested messages have one length byte");
                self[length_at] = length as u8;
            }
        }
    }
}

impl Value<'_> {
    fn wire_type(&self) -> u32 {
        match self {
            Self::Uint32(_) | Self::Uint64(_) => wire_type::VARINT,
            Self::Float(_) => wire_type::FIXED32,
            Self::Double(_) => wire_type::FIXED64,
            Self::String(_) | Self::Words(_) | Self::Message(..) => wire_type::BYTES,
        }
    }
}

fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
