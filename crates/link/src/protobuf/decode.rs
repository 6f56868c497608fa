//! Decodes a record from arbitrary bytes, without panics and without allocation except for strings
//! and words.

use super::{Fields, Nested, Value, Visit, wire_type};

/// Field numbers below this are read, others skipped.
const MAX_FIELDS: usize = 32;

/// Decodes a record; `None` for an incomplete message or a field of another type. Missing fields
/// keep their default and unknown ones are skipped, so that files of earlier and later versions
/// stay readable.
pub(crate) fn decode<T: Fields>(bytes: &[u8]) -> Option<T> {
    let mut record = T::default();
    read_message(bytes, &mut |visit| record.visit(visit))?;
    Some(record)
}

fn read_message(bytes: &[u8], fields: Nested<'_>) -> Option<()> {
    let mut decoder = Decoder { values: parse(bytes)?, sound: true };
    fields(&mut decoder);
    decoder.sound.then_some(())
}

#[derive(Clone, Copy)]
enum Raw<'a> {
    Missing,
    Varint(u64),
    Fixed64(u64),
    Fixed32(u32),
    Bytes(&'a [u8]),
}

fn parse(mut bytes: &[u8]) -> Option<[Raw<'_>; MAX_FIELDS]> {
    let mut values = [Raw::Missing; MAX_FIELDS];
    while !bytes.is_empty() {
        let key = take_varint(&mut bytes)?;
        let value = match (key & 7) as u32 {
            wire_type::VARINT => Raw::Varint(take_varint(&mut bytes)?),
            wire_type::FIXED64 => Raw::Fixed64(u64::from_le_bytes(take(&mut bytes, 8)?.try_into().ok()?)),
            wire_type::FIXED32 => Raw::Fixed32(u32::from_le_bytes(take(&mut bytes, 4)?.try_into().ok()?)),
            wire_type::BYTES => {
                let length = usize::try_from(take_varint(&mut bytes)?).ok()?;
                Raw::Bytes(take(&mut bytes, length)?)
            }
            _ => return None,
        };
        if let Some(slot) = usize::try_from(key >> 3).ok().and_then(|number| values.get_mut(number)) {
            *slot = value;
        }
    }
    Some(values)
}

fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (head, tail) = bytes.split_at_checked(count)?;
    *bytes = tail;
    Some(head)
}

fn take_varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let byte = *take(bytes, 1)?.first()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

struct Decoder<'a> {
    values: [Raw<'a>; MAX_FIELDS],
    sound: bool,
}

impl Visit for Decoder<'_> {
    fn field(&mut self, number: u32, _: &'static str, value: Value<'_>) {
        self.sound &= read(self.values[number as usize], value).is_some();
    }
}

/// Sets a field; `None` for another type.
fn read(raw: Raw<'_>, field: Value<'_>) -> Option<()> {
    match (raw, field) {
        (Raw::Missing, _) => {}
        (Raw::Varint(value), Value::Uint32(field)) => *field = value.try_into().ok()?,
        (Raw::Varint(value), Value::Uint64(field)) => *field = value,
        (Raw::Fixed32(bits), Value::Float(field)) => *field = f32::from_bits(bits),
        (Raw::Fixed64(bits), Value::Double(field)) => *field = f64::from_bits(bits),
        (Raw::Bytes(bytes), Value::String(field)) => str::from_utf8(bytes).ok()?.clone_into(field),
        (Raw::Bytes(bytes), Value::Words(field)) => {
            let (words, []) = bytes.as_chunks() else { return None };
            *field = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
        }
        (Raw::Bytes(bytes), Value::Message(_, fields)) => read_message(bytes, fields)?,
        _ => return None,
    }
    Some(())
}
