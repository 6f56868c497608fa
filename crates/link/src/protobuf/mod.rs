//! Protobuf messages from one field list per record: encoding, decoding and schema.
//!
//! # Theory
//! One list in `records` has the fields of every message; the [`encode`], [`decode`] and [`schema`]
//! visitors use it. Every field is written, zero or not, so that -0.0 keeps its sign
//! (generated proto3 code drops it), and floats are stored as bits, so that a NaN keeps its
//! payload.
//!
//! # Practice
//! Records are flat up to one level of nesting; nested messages are shorter than 128 bytes (one
//! length byte).
//!
//! # Sources
//! Protocol Buffers encoding: <https://protobuf.dev/programming-guides/encoding/>.

mod decode;
mod encode;
mod records;
mod schema;

pub(crate) use decode::decode;
pub(crate) use encode::encode;
pub(crate) use encode::encode_numbers;
pub(crate) use schema::{file_descriptor_set, numbers_descriptor_set};

/// A message that lists its protobuf fields: a record or a part of one.
pub trait Fields: Default + Clone {
    /// Message name, with its package.
    const NAME: &'static str;

    /// Passes each field to `visit`, which reads or sets it.
    fn visit(&mut self, visit: &mut dyn Visit);
}

/// The body of a nested message.
pub type Nested<'a> = &'a mut dyn FnMut(&mut dyn Visit);

/// The value of a field, or the name and the body of a nested message.
pub enum Value<'a> {
    Uint32(&'a mut u32),
    Uint64(&'a mut u64),
    Float(&'a mut f32),
    Double(&'a mut f64),
    String(&'a mut String),
    Words(&'a mut Vec<u64>),
    Message(&'static str, Nested<'a>),
}

/// A type that a field can have.
trait Field {
    /// Passes itself to `visit` as the field of this number and name.
    fn visit_as(&mut self, number: u32, name: &'static str, visit: &mut dyn Visit);
}

/// Visits the fields of a message.
pub trait Visit {
    fn field(&mut self, number: u32, name: &'static str, value: Value<'_>);
}

/// Wire types of the encoding.
pub(crate) mod wire_type {
    pub const VARINT: u32 = 0;
    pub const FIXED64: u32 = 1;
    pub const BYTES: u32 = 2;
    pub const FIXED32: u32 = 5;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{
        CollisionRecord, EventRecord, SecondRecord, SolverRecord, StateRecord, TeacherRecord, TickRecord,
    };
    use proptest::prelude::*;

    /// Encoded bytes before and after a round trip, with fields of every bit pattern from `seed`,
    /// NaN and -0.0 included.
    fn round_trip<T: Fields>(seed: u64) -> (Vec<u8>, Vec<u8>) {
        let mut record = T::default();
        record.visit(&mut Noise(seed));
        let (mut first, mut second) = (Vec::new(), Vec::new());
        encode(&record, &mut first);
        encode(&decode::<T>(&first).unwrap(), &mut second);
        (first, second)
    }

    /// Fills every field with random bits (splitmix64).
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (z ^ (z >> 31)) & if z & 7 == 0 { 0x8000_0000_8000_0000 } else { u64::MAX }
        }
    }

    impl Visit for Noise {
        fn field(&mut self, _: u32, name: &'static str, value: Value<'_>) {
            match value {
                Value::Uint32(value) => {
                    let limit = if matches!(name, "phase" | "tool") { 0xff } else { u32::MAX };
                    *value = self.next() as u32 & limit;
                }
                Value::Uint64(value) => *value = self.next(),
                Value::Float(value) => *value = f32::from_bits(self.next() as u32),
                Value::Double(value) => *value = f64::from_bits(self.next()),
                Value::String(value) => *value = format!("é{:x}", self.next()),
                Value::Words(value) => *value = (0..self.next() % 9).map(|_| self.next()).collect(),
                Value::Message(_, fields) => fields(self),
            }
        }
    }

    proptest! {
        #[test]
        fn every_bit_survives(seed: u64) {
            for (first, second) in [round_trip::<TickRecord>(seed), round_trip::<CollisionRecord>(seed),
                                    round_trip::<SolverRecord>(seed), round_trip::<EventRecord>(seed), round_trip::<TeacherRecord>(seed),
                                    round_trip::<SecondRecord>(seed), round_trip::<StateRecord>(seed)] {
                prop_assert!(!first.is_empty());
                prop_assert_eq!(first, second);
            }
        }

        #[test]
        fn any_bytes_decode_or_fail_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = decode::<TickRecord>(&bytes);
            let _ = decode::<EventRecord>(&bytes);
            let _ = decode::<StateRecord>(&bytes);
        }
    }

    #[test]
    fn a_float_keeps_its_bits() {
        let record = TickRecord { depth_mm: f32::from_bits(0xffc1_2345), removed_mm3: -0.0, ..TickRecord::default() };
        let mut bytes = Vec::new();
        encode(&record, &mut bytes);
        let back: TickRecord = decode(&bytes).unwrap();
        assert_eq!((back.depth_mm.to_bits(), back.removed_mm3.to_bits()), (0xffc1_2345, 0x8000_0000));
    }
}
