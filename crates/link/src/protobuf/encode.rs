//! Encodes a record.

use super::{Fields, Nested, Visit, wire_type};

/// Appends `record` to `out`.
pub(crate) fn encode<T: Fields>(record: &T, out: &mut Vec<u8>) {
    record.clone().visit(&mut Encoder { out });
}

/// Appends a field of raw bytes; also used for descriptors.
pub(super) fn put_bytes(out: &mut Vec<u8>, number: u32, bytes: &[u8]) {
    put_varint(out, u64::from(number << 3 | wire_type::BYTES));
    put_varint(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

/// Appends a numeric field.
pub(super) fn put_number(out: &mut Vec<u8>, number: u32, value: u64) {
    put_varint(out, u64::from(number << 3 | wire_type::VARINT));
    put_varint(out, value);
}

fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

struct Encoder<'a> {
    out: &'a mut Vec<u8>,
}

impl Visit for Encoder<'_> {
    fn uint32(&mut self, number: u32, _: &'static str, value: &mut u32) {
        put_number(self.out, number, u64::from(*value));
    }

    fn uint64(&mut self, number: u32, _: &'static str, value: &mut u64) {
        put_number(self.out, number, *value);
    }

    fn float(&mut self, number: u32, _: &'static str, value: &mut f32) {
        put_varint(self.out, u64::from(number << 3 | wire_type::FIXED32));
        self.out.extend_from_slice(&value.to_bits().to_le_bytes());
    }

    fn double(&mut self, number: u32, _: &'static str, value: &mut f64) {
        put_varint(self.out, u64::from(number << 3 | wire_type::FIXED64));
        self.out.extend_from_slice(&value.to_bits().to_le_bytes());
    }

    fn string(&mut self, number: u32, _: &'static str, value: &mut String) {
        put_bytes(self.out, number, value.as_bytes());
    }

    fn message(&mut self, number: u32, _: &'static str, _: &'static str, fields: Nested<'_>) {
        put_varint(self.out, u64::from(number << 3 | wire_type::BYTES));
        let length_at = self.out.len();
        self.out.push(0);
        fields(self);
        let length = self.out.len() - length_at - 1;
        debug_assert!(length < 0x80, "nested messages have one length byte");
        self.out[length_at] = length as u8;
    }
}
