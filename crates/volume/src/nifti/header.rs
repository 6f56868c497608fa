//! The fields of a NIfTI header that describe the voxels and their position.

use crate::sample::{ByteOrder, Number, Scale};
use crate::source::Source;
use crate::{Note, ReadError};
use glam::{DAffine3, DMat3, DVec3};

/// A parsed header of either version and byte order.
pub(super) struct Header {
    pub order: ByteOrder,
    pub dims: [i64; 3],
    /// Product of the sizes beyond the third.
    pub volumes: u64,
    pub number: Number,
    pub vox_offset: u64,
    /// `None` for a slope of 0, which means unscaled values.
    pub scale: Option<Scale>,
    pub voxels_elsewhere: bool,
    pixdim: [f64; 4],
    qform_code: i64,
    sform_code: i64,
    quaternion: DVec3,
    qoffset: DVec3,
    srow: [[f64; 4]; 3],
    mm_per_unit: f64,
}

/// The affine and the field that it comes from.
pub(super) struct Orientation {
    pub world_from_voxel: DAffine3,
    pub field: &'static str,
    pub note: Option<Note>,
}

impl Header {
    pub fn read(source: &mut Source) -> Result<Self, ReadError> {
        let start: [u8; 4] = source.header()?;
        match (i32::from_le_bytes(start), i32::from_be_bytes(start)) {
            (348, _) => Self::version_1(source, ByteOrder::Little),
            (_, 348) => Self::version_1(source, ByteOrder::Big),
            (540, _) => Self::version_2(source, ByteOrder::Little),
            (_, 540) => Self::version_2(source, ByteOrder::Big),
            (found, _) => {
                Err(source.field("sizeof_hdr", found, "a NIfTI file starts with 348 or 540; is this another format?"))
            }
        }
    }

    fn version_1(source: &mut Source, order: ByteOrder) -> Result<Self, ReadError> {
        let bytes: [u8; 344] = source.header()?;
        let f = Fields { bytes: &bytes, start: 4, order };
        let voxels_elsewhere = match &bytes[340..344] {
            b"n+1\0" => false,
            b"ni1\0" => true,
            [0, 0, 0, 0] => {
                let remedy = "this is the older Analyze 7.5, which does not say left from right; convert it to NIfTI where it was made";
                return Err(source.field("magic", "empty", remedy));
            }
            other => {
                return Err(source.field(
                    "magic",
                    text(other),
                    "a NIfTI-1 header ends in n+1 or ni1; fetch the file again",
                ));
            }
        };
        let dim: [i64; 8] = std::array::from_fn(|i| f.i16(40 + 2 * i));
        let header = Self {
            order,
            dims: [dim[1], dim[2], dim[3]],
            volumes: volumes(source, dim)?,
            number: number(source, f.i16(70), f.i16(72))?,
            vox_offset: vox_offset(source, f.f32(108), if voxels_elsewhere { 0 } else { 352 })?,
            scale: scale(source, f.f32(112), f.f32(116))?,
            voxels_elsewhere,
            pixdim: std::array::from_fn(|i| f.f32(76 + 4 * i)),
            qform_code: f.i16(252),
            sform_code: f.i16(254),
            quaternion: DVec3::from_array(std::array::from_fn(|i| f.f32(256 + 4 * i))),
            qoffset: DVec3::from_array(std::array::from_fn(|i| f.f32(268 + 4 * i))),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f32(280 + 16 * r + 4 * c))),
            mm_per_unit: mm_per_unit(i64::from(bytes[123 - 4])),
        };
        Ok(header)
    }

    fn version_2(source: &mut Source, order: ByteOrder) -> Result<Self, ReadError> {
        let bytes: [u8; 536] = source.header()?;
        let f = Fields { bytes: &bytes, start: 4, order };
        let voxels_elsewhere = match &bytes[0..4] {
            b"n+2\0" => false,
            b"ni2\0" => true,
            other => {
                return Err(source.field(
                    "magic",
                    text(other),
                    "a NIfTI-2 header has n+2 or ni2 there; fetch the file again",
                ));
            }
        };
        if bytes[4..8] != *b"\r\n\x1a\n" {
            let remedy = "NIfTI-2 has CR LF 26 LF there; the file was transferred as text, fetch it again as binary";
            return Err(source.field("magic", format!("followed by {:?}", &bytes[4..8]), remedy));
        }
        let dim: [i64; 8] = std::array::from_fn(|i| f.i64(16 + 8 * i));
        let offset = f.i64(168);
        let Ok(vox_offset) = u64::try_from(offset) else {
            return Err(source.field("vox_offset", offset, "it must not be negative"));
        };
        Ok(Self {
            order,
            dims: [dim[1], dim[2], dim[3]],
            volumes: volumes(source, dim)?,
            number: number(source, f.i16(12), f.i16(14))?,
            vox_offset: if vox_offset == 0 && !voxels_elsewhere { 544 } else { vox_offset },
            scale: scale(source, f.f64(176), f.f64(184))?,
            voxels_elsewhere,
            pixdim: std::array::from_fn(|i| f.f64(104 + 8 * i)),
            qform_code: f.i32(344),
            sform_code: f.i32(348),
            quaternion: DVec3::from_array(std::array::from_fn(|i| f.f64(352 + 8 * i))),
            qoffset: DVec3::from_array(std::array::from_fn(|i| f.f64(376 + 8 * i))),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f64(400 + 32 * r + 8 * c))),
            mm_per_unit: mm_per_unit(f.i32(500)),
        })
    }

    /// The affine to RAS+ mm: sform, else qform, else the spacings alone.
    pub fn orientation(&self, source: &Source) -> Result<Orientation, ReadError> {
        let spacing = DVec3::new(self.pixdim[1], self.pixdim[2], self.pixdim[3]) * self.mm_per_unit;
        if !(spacing.cmpgt(DVec3::ZERO).all() && spacing.is_finite()) {
            return Err(ReadError::Spacing { file: source.file().into(), field: "pixdim", found: spacing.to_string() });
        }
        if self.sform_code > 0 {
            let sform = self.sform();
            crate::source::check_affine(source.file(), "srow_x/y/z", sform)?;
            let note = (self.qform_code > 0).then(|| self.difference(sform, self.qform(spacing))).flatten();
            return Ok(Orientation { world_from_voxel: sform, field: "srow_x/y/z", note });
        }
        if self.qform_code > 0 {
            return Ok(Orientation { world_from_voxel: self.qform(spacing), field: "quatern_b/c/d", note: None });
        }
        let note = Some(Note::NoOrientation { field: "qform_code and sform_code are 0" });
        Ok(Orientation { world_from_voxel: DAffine3::from_scale(spacing), field: "pixdim", note })
    }

    fn sform(&self) -> DAffine3 {
        let column = |c: usize| DVec3::new(self.srow[0][c], self.srow[1][c], self.srow[2][c]) * self.mm_per_unit;
        DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
    }

    /// R(a, b, c, d) · diag(spacing with the third mirrored where pixdim\[0\] < 0),
    /// a = √(1 - b² - c² - d²).
    fn qform(&self, spacing: DVec3) -> DAffine3 {
        let v = self.quaternion;
        let rest = 1.0 - v.length_squared();
        let (a, v) = if rest < 1e-7 { (0.0, v.normalize_or_zero()) } else { (rest.sqrt(), v) };
        let q = glam::DQuat::from_xyzw(v.x, v.y, v.z, a).normalize();
        let qfac = if self.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let scale = DMat3::from_diagonal(spacing * DVec3::new(1.0, 1.0, qfac));
        DAffine3 { matrix3: DMat3::from_quat(q) * scale, translation: self.qoffset * self.mm_per_unit }
    }

    /// Returns a note if sform and qform place a corner of the volume over 0.1 mm apart.
    fn difference(&self, sform: DAffine3, qform: DAffine3) -> Option<Note> {
        let by_mm = (0..8)
            .map(|corner| {
                let at = |axis: usize| if corner >> axis & 1 == 0 { 0.0 } else { (self.dims[axis] - 1) as f64 };
                let p = DVec3::new(at(0), at(1), at(2));
                sform.transform_point3(p).distance(qform.transform_point3(p))
            })
            .fold(0.0, f64::max);
        (by_mm > 0.1).then_some(Note::TwoOrientations { used: "sform", ignored: "qform", by_mm })
    }
}

/// Accesses fields by the standard's offsets; `bytes` starts `start` bytes into the header.
struct Fields<'a> {
    bytes: &'a [u8],
    start: usize,
    order: ByteOrder,
}

impl Fields<'_> {
    fn raw<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut raw: [u8; N] = std::array::from_fn(|i| self.bytes[at - self.start + i]);
        if self.order == ByteOrder::Big {
            raw.reverse();
        }
        raw
    }

    fn i16(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.raw(at)).into()
    }

    fn i32(&self, at: usize) -> i64 {
        i32::from_le_bytes(self.raw(at)).into()
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.raw(at))
    }

    fn f32(&self, at: usize) -> f64 {
        f32::from_le_bytes(self.raw(at)).into()
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.raw(at))
    }
}

fn volumes(source: &Source, dim: [i64; 8]) -> Result<u64, ReadError> {
    let used = match usize::try_from(dim[0]) {
        Ok(n @ 3..=7) => n,
        _ => {
            let found = format!("{} (the number of dimensions)", dim[0]);
            return Err(ReadError::Dimensions { file: source.file().into(), field: "dim[0]", found });
        }
    };
    let beyond =
        dim[4..=used.max(3)].iter().try_fold(1u64, |n, &d| u64::try_from(d).ok().filter(|&d| d > 0)?.checked_mul(n));
    beyond.ok_or_else(|| source.field("dim", format!("{dim:?}"), "sizes beyond the third must be at least 1"))
}

fn number(source: &Source, datatype: i64, bitpix: i64) -> Result<Number, ReadError> {
    let number = match datatype {
        2 => Number::U8,
        4 => Number::I16,
        8 => Number::I32,
        16 => Number::F32,
        64 => Number::F64,
        256 => Number::I8,
        512 => Number::U16,
        768 => Number::U32,
        1024 => Number::I64,
        1280 => Number::U64,
        128 | 2304 => {
            return Err(source.field(
                "datatype",
                format!("{datatype} (colour)"),
                "convert the picture to grey values first",
            ));
        }
        32 | 1792 | 2048 => {
            return Err(source.field("datatype", format!("{datatype} (complex)"), "store the magnitude"));
        }
        1536 => return Err(source.field("datatype", "1536 (128-bit float)", "store it as 32-bit float")),
        other => {
            return Err(source.field(
                "datatype",
                other,
                "2, 4, 8, 16, 64, 256, 512, 768, 1024 or 1280 (real numbers) is right",
            ));
        }
    };
    match bitpix == 8 * number.bytes() as i64 {
        true => Ok(number),
        false => {
            Err(source.field("bitpix", bitpix, "it must be the bits of one number of `datatype`; fetch the file again"))
        }
    }
}

fn vox_offset(source: &Source, offset: f64, least: u64) -> Result<u64, ReadError> {
    match offset {
        0.0 => Ok(least),
        o if (0.0..1e15).contains(&o) => Ok(o as u64),
        o => Err(source.field("vox_offset", o, "it must be a byte position in the file, 352 for most")),
    }
}

fn scale(source: &Source, slope: f64, intercept: f64) -> Result<Option<Scale>, ReadError> {
    match (slope, intercept) {
        (0.0, _) => Ok(None),
        (s, i) if s.is_finite() && i.is_finite() => Ok(Some(Scale { slope, intercept })),
        _ => Err(source.field(
            "scl_slope",
            format!("{slope} with scl_inter {intercept}"),
            "both must be numbers, or the slope 0",
        )),
    }
}

/// Millimetres in a unit of `xyzt_units`; unknown units are taken as mm.
fn mm_per_unit(xyzt_units: i64) -> f64 {
    match xyzt_units & 7 {
        1 => 1e3,
        3 => 1e-3,
        _ => 1.0,
    }
}

fn text(bytes: &[u8]) -> String {
    format!("\"{}\"", bytes.escape_ascii())
}
