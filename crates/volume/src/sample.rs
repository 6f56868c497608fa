//! Voxel number types and their decoding to f32.

use bytemuck::Pod;

/// A voxel type that volumes can be resampled to and written in.
pub trait Sample: Pod + PartialEq + PartialOrd + Send + Sync {
    /// The type's name in files.
    const NUMBER: Number;

    /// Converts to the nearest value: integers round and saturate, NaN becomes 0.
    fn from_f32(value: f32) -> Self;

    /// Converts to f32; integers over 2²⁴ are rounded.
    fn to_f32(self) -> f32;

    /// Appends the little-endian bytes of values to `out`.
    fn write_le(values: &[Self], out: &mut Vec<u8>);
}

macro_rules! sample {
    ($($type:ty, $number:ident, $convert:expr;)*) => {$(
        impl Sample for $type {
            const NUMBER: Number = Number::$number;
            fn from_f32(value: f32) -> Self {
                let convert: fn(f32) -> $type = $convert;
                convert(value)
            }
            fn to_f32(self) -> f32 {
                self as f32
            }
            fn write_le(values: &[Self], out: &mut Vec<u8>) {
                const SIZE: usize = size_of::<$type>();
                let start = out.len();
                out.resize(start + SIZE * values.len(), 0);
                for (to, value) in out[start..].chunks_exact_mut(SIZE).zip(values) {
                    to.copy_from_slice(&value.to_le_bytes());
                }
            }
        }
    )*};
}

sample! {
    u8, U8, |v| rounded(v) as u8;
    i8, I8, |v| rounded(v) as i8;
    u16, U16, |v| rounded(v) as u16;
    i16, I16, |v| rounded(v) as i16;
    u32, U32, |v| v.round() as u32;
    i32, I32, |v| v.round() as i32;
    f32, F32, |v| v;
    f64, F64, f64::from;
}

/// The nearest integer, ties away from 0, for magnitudes under 2²²; faster than the system's
/// `round`.
fn rounded(value: f32) -> f32 {
    value + (0.5 - f32::EPSILON / 4.0).copysign(value)
}

/// A number type in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 64 bits.
    I64,
    /// IEEE single precision.
    F32,
    /// IEEE double precision.
    F64,
}

/// Byte order of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Lowest byte first.
    Little,
    /// Highest byte first.
    Big,
}

/// `value = slope · stored + intercept`, in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    pub slope: f64,
    pub intercept: f64,
}

impl Scale {
    pub const NONE: Self = Self { slope: 1.0, intercept: 0.0 };
}

impl std::fmt::Display for Scale {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} x stored + {}", self.slope, self.intercept)
    }
}

impl Number {
    /// Bytes of one number.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Name and byte order, for the facts of an import.
    pub(crate) fn stored(self, order: ByteOrder) -> String {
        match (self.bytes(), order) {
            (1, _) => self.name().into(),
            (_, ByteOrder::Little) => format!("{}, little-endian", self.name()),
            (_, ByteOrder::Big) => format!("{}, big-endian", self.name()),
        }
    }

    /// Name, as NRRD writes it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::I8 => "int8",
            Self::U16 => "uint16",
            Self::I16 => "int16",
            Self::U32 => "uint32",
            Self::I32 => "int32",
            Self::U64 => "uint64",
            Self::I64 => "int64",
            Self::F32 => "float",
            Self::F64 => "double",
        }
    }

    /// Decodes numbers from `bytes` (a multiple of [`bytes`](Self::bytes) long), scaled in f64, and
    /// appends them to `out`.
    pub(crate) fn decode(self, bytes: &[u8], order: ByteOrder, scale: Scale, out: &mut Vec<f32>) {
        macro_rules! each {
            ($type:ty) => {{
                let numbers = bytes.chunks_exact(size_of::<$type>()).map(|b| {
                    let raw: [u8; size_of::<$type>()] = std::array::from_fn(|i| b[i]);
                    match order {
                        ByteOrder::Little => <$type>::from_le_bytes(raw),
                        ByteOrder::Big => <$type>::from_be_bytes(raw),
                    }
                });
                match scale == Scale::NONE {
                    true => out.extend(numbers.map(|v| v as f32)),
                    false => out.extend(numbers.map(|v| (scale.slope * v as f64 + scale.intercept) as f32)),
                }
            }};
        }
        match self {
            Self::U8 => each!(u8),
            Self::I8 => each!(i8),
            Self::U16 => each!(u16),
            Self::I16 => each!(i16),
            Self::U32 => each!(u32),
            Self::I32 => each!(i32),
            Self::U64 => each!(u64),
            Self::I64 => each!(i64),
            Self::F32 => each!(f32),
            Self::F64 => each!(f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_byte_orders_decode_to_the_same_value() {
        let (mut little, mut big) = (Vec::new(), Vec::new());
        Number::I16.decode(&(-875i16).to_le_bytes(), ByteOrder::Little, Scale::NONE, &mut little);
        Number::I16.decode(&(-875i16).to_be_bytes(), ByteOrder::Big, Scale::NONE, &mut big);
        assert_eq!((little, big), (vec![-875.0], vec![-875.0]));
    }

    #[test]
    fn scaling_happens_in_double_precision() {
        let mut out = Vec::new();
        let scale = Scale { slope: 1e-3, intercept: -16_777_217.0 };
        Number::U32.decode(&4_000_000_000u32.to_le_bytes(), ByteOrder::Little, scale, &mut out);
        assert_eq!(out, [(4e6 - 16_777_217.0) as f32]);
    }

    #[test]
    fn integers_round_and_saturate() {
        assert_eq!(i16::from_f32(-0.5), -1);
        for n in -40_000..40_000i32 {
            for off in [-0.5, -0.499_999_97, -0.25, 0.0, 0.25, 0.499_999_97, 0.5] {
                let value = n as f32 / 8.0 + off;
                assert_eq!(i16::from_f32(value), value.round() as i16, "{value}");
            }
        }
        assert_eq!(i16::from_f32(1e9), i16::MAX);
        assert_eq!(u8::from_f32(-3.0), 0);
        assert_eq!(i16::from_f32(f32::NAN), 0);
    }
}
