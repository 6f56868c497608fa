//! Decodes a record from arbitrary bytes, without panics and without allocation except for strings.

use super::{Fields, Nested, Visit, wire_type};

/// Field numbers below this are read, others skipped.
const MAX_FIELDS: usize = 32;

/// Decodes a record; `None` for an incomplete message or a field of another type. Missing fields
/// keep their default and unknown ones are skipped, so that files of earlier and later versions
/// stay readable.
pub(crate) fn decode<T: Fields>(bytes: &[u8]) -> Option<T> {
    let mut record = T::default();
    let mut decoder = Decoder { values: parse(bytes)?, sound: true };
    record.visit(&mut decoder);
    decoder.sound.then_some(record)
}

#[derive(Clone, Copy)]
enum Value<'a> {
    Missing,
    Varint(u64),
    Fixed64(u64),
    Fixed32(u32),
    Bytes(&'a [u8]),
}

fn parse(mut bytes: &[u8]) -> Option<[Value<'_>; MAX_FIELDS]> {
    let mut values = [Value::Missing; MAX_FIELDS];
    while !bytes.is_empty() {
        let key = take_varint(&mut bytes)?;
        let value = match (key & 7) as u32 {
            wire_type::VARINT => Value::Varint(take_varint(&mut bytes)?),
            wire_type::FIXED64 => Value::Fixed64(u64::from_le_bytes(take(&mut bytes, 8)?.try_into().ok()?)),
            wire_type::FIXED32 => Value::Fixed32(u32::from_le_bytes(take(&mut bytes, 4)?.try_into().ok()?)),
            wire_type::BYTES => {
                let length = usize::try_from(take_varint(&mut bytes)?).ok()?;
                Value::Bytes(take(&mut bytes, length)?)
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
    values: [Value<'a>; MAX_FIELDS],
    sound: bool,
}

impl Visit for Decoder<'_> {
    fn uint32(&mut self, number: u32, _: &'static str, value: &mut u32) {
        match self.values[number as usize] {
            Value::Missing => {}
            Value::Varint(v) if u32::try_from(v).is_ok() => *value = v as u32,
            _ => self.sound = false,
        }
    }

    fn uint64(&mut self, number: u32, _: &'static str, value: &mut u64) {
        match self.values[number as usize] {
            Value::Missing => {}
            Value::Varint(v) => *value = v,
            _ => self.sound = false,
        }
    }

    fn float(&mut self, number: u32, _: &'static str, value: &mut f32) {
        match self.values[number as usize] {
            Value::Missing => {}
            Value::Fixed32(bits) => *value = f32::from_bits(bits),
            _ => self.sound = false,
        }
    }

    fn double(&mut self, number: u32, _: &'static str, value: &mut f64) {
        match self.values[number as usize] {
            Value::Missing => {}
            Value::Fixed64(bits) => *value = f64::from_bits(bits),
            _ => self.sound = false,
        }
    }

    fn string(&mut self, number: u32, _: &'static str, value: &mut String) {
        match self.values[number as usize] {
            Value::Missing => {}
            Value::Bytes(bytes) => match str::from_utf8(bytes) {
                Ok(text) => value.replace_range(.., text),
                Err(_) => self.sound = false,
            },
            _ => self.sound = false,
        }
    }

    fn message(&mut self, number: u32, _: &'static str, _: &'static str, fields: Nested<'_>) {
        match self.values[number as usize] {
            Value::Missing => {}
            Value::Bytes(bytes) => match parse(bytes) {
                Some(values) => {
                    let mut nested = Decoder { values, sound: true };
                    fields(&mut nested);
                    self.sound &= nested.sound;
                }
                None => self.sound = false,
            },
            _ => self.sound = false,
        }
    }
}
