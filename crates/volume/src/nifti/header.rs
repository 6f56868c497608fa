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
    /// A slope of 0 means unscaled values.
    pub scale: Scale,
    /// About a slope or intercept that is no number.
    pub note: Option<Note>,
    pub voxels_elsewhere: bool,
    pixdim: [f64; 4],
    qform_code: i64,
    sform_code: i64,
    quaternion: DVec3,
    qoffset: DVec3,
    srow: [[f64; 4]; 3],
    pub mm_per_unit: f64,
}

/// The affine and the field that it comes from.
pub(super) struct Orientation {
    pub world_from_voxel: DAffine3,
    pub field: &'static str,
    pub notes: Vec<Note>,
    /// Which transform, by which code.
    pub taken: String,
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
                let remedy = "a NIfTI-1 header ends in n+1 or ni1; fetch the file again";
                return Err(source.field("magic", text(other), remedy));
            }
        };
        let dim: [i64; 8] = std::array::from_fn(|i| f.i16(40 + 2 * i));
        let (scale, note) = scale(f.f32(112), f.f32(116));
        Ok(Self {
            order,
            dims: [dim[1], dim[2], dim[3]],
            volumes: volumes(source, dim)?,
            number: number(source, f.i16(70), f.i16(72))?,
            vox_offset: vox_offset(source, f.f32(108), if voxels_elsewhere { 0 } else { 352 })?,
            scale,
            note,
            voxels_elsewhere,
            pixdim: std::array::from_fn(|i| f.f32(76 + 4 * i)),
            qform_code: f.i16(252),
            sform_code: f.i16(254),
            quaternion: DVec3::from_array(std::array::from_fn(|i| f.f32(256 + 4 * i))),
            qoffset: DVec3::from_array(std::array::from_fn(|i| f.f32(268 + 4 * i))),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f32(280 + 16 * r + 4 * c))),
            mm_per_unit: mm_per_unit(i64::from(bytes[123 - 4])),
        })
    }

    fn version_2(source: &mut Source, order: ByteOrder) -> Result<Self, ReadError> {
        let bytes: [u8; 536] = source.header()?;
        let f = Fields { bytes: &bytes, start: 4, order };
        let voxels_elsewhere = match &bytes[0..4] {
            b"n+2\0" => false,
            b"ni2\0" => true,
            other => {
                let remedy = "a NIfTI-2 header has n+2 or ni2 there; fetch the file again";
                return Err(source.field("magic", text(other), remedy));
            }
        };
        if bytes[4..8] != *b"\r\n\x1a\n" {
            let remedy = "NIfTI-2 has CR LF 26 LF there; the file was transferred as text, fetch it again as binary";
            return Err(source.field("magic", format!("followed by {:?}", &bytes[4..8]), remedy));
        }
        let dim: [i64; 8] = std::array::from_fn(|i| f.i64(16 + 8 * i));
        let (scale, note) = scale(f.f64(176), f.f64(184));
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
            scale,
            note,
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

    /// The affine to RAS+ mm, by the policy in the crate's geometry.
    pub fn orientation(&self, source: &Source) -> Result<Orientation, ReadError> {
        let pixdim = DVec3::new(self.pixdim[1], self.pixdim[2], self.pixdim[3]) * self.mm_per_unit;
        let spacing = pixdim.abs();
        let sized = spacing.cmpgt(DVec3::ZERO).all() && spacing.is_finite();
        let qform = (self.qform_code > 0 && sized).then(|| self.qform(spacing));
        if self.sform_code > 0 {
            return self.by_sform(source, pixdim, qform);
        }
        if !sized {
            return Err(ReadError::Spacing { file: source.file().into(), field: "pixdim", found: pixdim.to_string() });
        }
        let negative = unusual("pixdim", pixdim, "the absolute values are taken");
        let mut notes: Vec<Note> = (pixdim != spacing).then_some(negative).into_iter().collect();
        if let Some(world_from_voxel) = qform {
            let taken = format!("qform, {}", name(self.qform_code));
            return Ok(Orientation { world_from_voxel, field: "quatern_b/c/d", notes, taken });
        }
        notes.push(Note::NoOrientation { field: "qform_code and sform_code are 0" });
        let axes = spacing * DVec3::new(-1.0, 1.0, 1.0);
        let middle = DVec3::from_array(self.dims.map(|n| (n - 1) as f64 / 2.0));
        let world_from_voxel = DAffine3 { matrix3: DMat3::from_diagonal(axes), translation: -axes * middle };
        let taken = "none, so left, front, head around the middle".into();
        Ok(Orientation { world_from_voxel, field: "pixdim", notes, taken })
    }

    /// The sform, or the qform where that one is to be preferred.
    fn by_sform(&self, source: &Source, pixdim: DVec3, qform: Option<DAffine3>) -> Result<Orientation, ReadError> {
        let sform = self.sform();
        let edges = DVec3::from_array([0, 1, 2].map(|axis| sform.matrix3.col(axis).length()));
        let close = |a: DVec3, b: DVec3| (a - b).abs().cmple(0.01 * b).all();
        let fits = close(edges, pixdim.abs());
        let sized = pixdim.cmpne(DVec3::ZERO).all() && pixdim.is_finite();
        let unscaled = !fits && sized && close(edges / self.mm_per_unit, DVec3::ONE);
        let by_mm = qform.and_then(|qform| self.difference(sform, qform));
        let of_atlas = self.sform_code >= 3 && self.qform_code <= 2;
        let by_qform = |qform, note, why| Orientation {
            world_from_voxel: qform,
            field: "quatern_b/c/d",
            notes: vec![note],
            taken: format!("qform, {}, since the sform, {}, {why}", name(self.qform_code), name(self.sform_code)),
        };
        let by_sform = |sform, notes, why| Orientation {
            world_from_voxel: sform,
            field: "srow_x/y/z",
            notes,
            taken: format!("sform, {}{why}", name(self.sform_code)),
        };
        let flat = crate::source::check_affine(source.file(), "srow_x/y/z", sform);
        Ok(match (flat, qform, by_mm) {
            (Err(fault), None, _) => return Err(fault),
            (Err(_), Some(qform), _) => {
                let note = unusual("srow_x/y/z", edges, "edges that span no volume, so the qform is taken");
                by_qform(qform, note, "spans no volume")
            }
            (Ok(()), Some(qform), _) if unscaled => {
                let note = unusual("pixdim", pixdim, "the sform lacks this scale, so the qform is taken");
                by_qform(qform, note, "lacks the scale")
            }
            (Ok(()), Some(qform), Some(by_mm)) if of_atlas => {
                let note = Note::TwoOrientations { used: "qform", ignored: "sform", by_mm };
                by_qform(qform, note, "leads to another space")
            }
            (Ok(()), None, _) if unscaled => {
                let note = unusual("pixdim", pixdim, "the sform lacks this scale and is given it; check the size");
                let scaled = sform.matrix3 * DMat3::from_diagonal(pixdim.abs() / edges);
                by_sform(DAffine3 { matrix3: scaled, ..sform }, vec![note], ", scaled by pixdim")
            }
            (Ok(()), _, by_mm) => {
                let size = unusual("pixdim", pixdim, "the sform gives other edges, which are taken; check the size");
                let two = by_mm.map(|by_mm| Note::TwoOrientations { used: "sform", ignored: "qform", by_mm });
                by_sform(sform, two.into_iter().chain((!fits).then_some(size)).collect(), "")
            }
        })
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

    /// Largest distance between where sform and qform place a corner of the volume, if over 0.1 mm.
    fn difference(&self, sform: DAffine3, qform: DAffine3) -> Option<f64> {
        let by_mm = (0..8)
            .map(|corner| {
                let at = |axis: usize| if corner >> axis & 1 == 0 { 0.0 } else { (self.dims[axis] - 1) as f64 };
                let p = DVec3::new(at(0), at(1), at(2));
                sform.transform_point3(p).distance(qform.transform_point3(p))
            })
            .fold(0.0, f64::max);
        (by_mm > 0.1).then_some(by_mm)
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
            let remedy = "convert the picture to grey values first";
            return Err(source.field("datatype", format!("{datatype} (colour)"), remedy));
        }
        32 | 1792 | 2048 => {
            return Err(source.field("datatype", format!("{datatype} (complex)"), "store the magnitude"));
        }
        1536 => return Err(source.field("datatype", "1536 (128-bit float)", "store it as 32-bit float")),
        other => {
            let remedy = "2, 4, 8, 16, 64, 256, 512, 768, 1024 or 1280 (real numbers) is right";
            return Err(source.field("datatype", other, remedy));
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

/// The scale, and a note if a number is none: such a slope counts as 0, such an intercept as 0.
fn scale(slope: f64, intercept: f64) -> (Scale, Option<Note>) {
    let finite = |v: f64| if v.is_finite() { v } else { 0.0 };
    let scale = match finite(slope) {
        0.0 => Scale::NONE,
        slope => Scale { slope, intercept: finite(intercept) },
    };
    let found = format!("{slope} with scl_inter {intercept}");
    let note = Note::Unusual { field: "scl_slope", found, taken: "what is no number is left out of the scale" };
    (scale, (!slope.is_finite() || !intercept.is_finite()).then_some(note))
}

fn unusual(field: &'static str, found: DVec3, taken: &'static str) -> Note {
    Note::Unusual { field, found: format!("{found:.4} mm"), taken }
}

/// A code of a form with its meaning.
fn name(code: i64) -> String {
    let names = ["none", "scanner", "aligned to another image", "Talairach", "MNI", "another template"];
    let meaning = usize::try_from(code).ok().and_then(|code| names.get(code)).unwrap_or(&"unknown");
    format!("code {code} ({meaning})")
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
