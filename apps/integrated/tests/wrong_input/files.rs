//! Invalid files, and the valid ones given with them.

use flate2::{Compression, write::GzEncoder};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use std::fs;
use std::io::Write;
use std::path::Path;
use trepan_link::Recorder;
use trepan_link::wire::{SessionHeader, TickRecord};
use trepan_volume::{VoxelVolume, nifti};

/// Voxels of a small volume along each axis.
const N: usize = 32;

/// Makes a small head: a hollow ball of bone in a volume of 64 mm.
pub fn ball() -> VoxelVolume<i16> {
    let mut ct = VoxelVolume::isotropic([N; 3], Vec3::splat(-31.0), 2.0, -1000i16);
    for at in 0..ct.data.len() {
        ct.data[at] = match ct.centre_of([at % N, at / N % N, at / (N * N)]).length() {
            r if r < 24.0 => 40,
            r if r < 29.0 => 1200,
            _ => -1000,
        };
    }
    ct
}

/// Makes an adult head of ellipsoids: CT, T1 MRI and brain mask, each of 3 mm voxels in one space.
fn head() -> (VoxelVolume<i16>, VoxelVolume<u8>, VoxelVolume<u8>) {
    let dims = [64, 76, 64];
    let mut ct = VoxelVolume::isotropic(dims, Vec3::new(-94.5, -112.5, -94.5), 3.0, -1000i16);
    let (mut mri, mut brain) = (ct.map(|_| 0u8), ct.map(|_| 0u8));
    for at in 0..ct.data.len() {
        let place = ct.centre_of([at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])]);
        // Length 1 on the brain's surface. The nose makes the head asymmetric.
        let within = |grow: f64| (place / (DVec3::new(64.0, 82.0, 62.0) + grow)).length() < 1.0;
        // The opening of the skull for the brain stem.
        let neck = place.truncate().length() < 14.0 && place.z < -40.0;
        let nose = (place - DVec3::new(0.0, 100.0, -35.0)).length() < 14.0;
        (ct.data[at], mri.data[at], brain.data[at]) = if (place / DVec3::new(40.0, 56.0, 38.0)).length() < 1.0 {
            (35, 150, 1)
        } else if within(0.0) {
            (40, 105, 1)
        } else if neck {
            (40, 105, 0)
        } else if within(3.5) {
            (5, 25, 0)
        } else if within(12.0) {
            (1100, 12, 0)
        } else if within(19.0) || nose {
            (60, 200, 0)
        } else {
            (-1000, 0, 0)
        };
    }
    (ct, mri, brain)
}

fn turned<T: Copy>(mut volume: VoxelVolume<T>, degrees: f64, shift: DVec3) -> VoxelVolume<T> {
    let turn = DAffine3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 1.0, 1.0).normalize(), degrees.to_radians()));
    volume.world_from_voxel = DAffine3::from_translation(shift) * turn * volume.world_from_voxel;
    volume
}

pub fn gz(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(bytes).unwrap();
    gzip.finish().unwrap()
}

/// Makes a gzip file that unpacks to `head` and `mib` MiB of zeros, by repeating a packed piece.
fn bomb(head: &[u8], mib: usize) -> Vec<u8> {
    let piece = gz(&vec![0; 16 << 20]);
    let mut bytes = gz(head);
    (0..mib.div_ceil(16)).for_each(|_| bytes.extend(&piece));
    bytes
}

/// Writer of an explicit little-endian DICOM file.
pub struct Slice(pub Vec<u8>);

impl Slice {
    fn element(&mut self, tag: u32, vr: &[u8; 2], value: &[u8]) -> &mut Self {
        self.0.extend(((tag >> 16) as u16).to_le_bytes());
        self.0.extend((tag as u16).to_le_bytes());
        self.0.extend(vr);
        let even = value.len() + value.len() % 2;
        if vr == b"OW" {
            self.0.extend([0, 0]);
            self.0.extend((even as u32).to_le_bytes());
        } else {
            self.0.extend((even as u16).to_le_bytes());
        }
        self.0.extend(value);
        self.0.resize(self.0.len() + even - value.len(), b' ');
        self
    }

    /// Adds pixels as one compressed fragment after an empty offset table.
    fn packed(&mut self, stream: &[u8]) -> &mut Self {
        self.0.extend([0xe0, 0x7f, 0x10, 0, b'O', b'B', 0, 0, 0xff, 0xff, 0xff, 0xff]);
        for piece in [&[], stream] {
            self.0.extend([0xfe, 0xff, 0, 0xe0]);
            self.0.extend((piece.len() as u32).to_le_bytes());
            self.0.extend(piece);
        }
        self.0.extend([0xfe, 0xff, 0xdd, 0xe0, 0, 0, 0, 0]);
        self
    }

    fn text(&mut self, tag: u32, vr: &[u8; 2], value: &str) -> &mut Self {
        self.element(tag, vr, value.as_bytes())
    }

    fn short(&mut self, tag: u32, value: u16) -> &mut Self {
        self.element(tag, b"US", &value.to_le_bytes())
    }
}

/// Transfer syntax: explicit little-endian, not compressed.
const PLAIN: &str = "1.2.840.10008.1.2.1";

/// Properties of a slice, some of them invalid.
#[derive(Clone)]
pub struct Odd {
    pub modality: &'static str,
    pub series: &'static str,
    pub syntax: &'static str,
    pub height_mm: f64,
    pub beside_mm: f64,
    pub samples: u16,
    pub bits: [u16; 3],
    pub placed: bool,
    pub spaced: bool,
    pub scaled: bool,
    pub rows: u16,
    pub pixels: usize,
}

/// Returns the properties of the valid slice `k`.
pub fn sound(k: usize) -> Odd {
    Odd {
        modality: "CT",
        series: "1.2.3",
        syntax: PLAIN,
        height_mm: -31.0 + 2.0 * k as f64,
        beside_mm: 0.0,
        samples: 1,
        bits: [16, 16, 15],
        placed: true,
        spaced: true,
        scaled: false,
        rows: N as u16,
        pixels: N * N,
    }
}

/// Makes slice `k` of the ball.
pub fn slice(k: usize, odd: &Odd) -> Vec<u8> {
    let mut slice = Slice([vec![0; 128], b"DICM".to_vec()].concat());
    slice.text(0x0002_0010, b"UI", odd.syntax).text(0x0008_0060, b"CS", odd.modality).text(
        0x0020_000e,
        b"UI",
        odd.series,
    );
    if odd.placed {
        // DICOM's axes are left and posterior.
        slice.text(0x0020_0032, b"DS", &format!("{}\\31\\{}", 31.0 + odd.beside_mm, odd.height_mm));
        slice.text(0x0020_0037, b"DS", "-1\\0\\0\\0\\-1\\0");
    }
    slice.short(0x0028_0002, odd.samples).short(0x0028_0010, odd.rows).short(0x0028_0011, N as u16);
    if odd.spaced {
        slice.text(0x0028_0030, b"DS", "2\\2");
    }
    slice
        .short(0x0028_0100, odd.bits[0])
        .short(0x0028_0101, odd.bits[1])
        .short(0x0028_0102, odd.bits[2])
        .short(0x0028_0103, 1);
    if odd.scaled {
        slice.text(0x0028_1052, b"DS", "0").text(0x0028_1053, b"DS", "1");
    }
    let pixels = &ball().data[k * N * N..][..odd.pixels];
    let pixels: Vec<u8> = pixels.iter().flat_map(|hu| hu.to_le_bytes()).collect();
    match odd.syntax == PLAIN {
        true => slice.element(0x7fe0_0010, b"OW", &pixels),
        false => slice.packed(&pixels),
    };
    slice.0
}

/// Writes a folder of slices; `odd` gives the properties of each.
pub fn series(folder: &Path, odd: impl Fn(usize) -> Option<Odd>) {
    fs::create_dir_all(folder).unwrap();
    for k in 0..N {
        if let Some(odd) = odd(k) {
            fs::write(folder.join(format!("{}-{k:02}.dcm", odd.series)), slice(k, &odd)).unwrap();
        }
    }
}

/// A NIfTI-1 header of 352 bytes.
pub struct Nifti {
    pub dim: [i16; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f32; 4],
    pub vox_offset: f32,
    pub slope: [f32; 2],
    pub srow: Option<[[f32; 4]; 3]>,
    pub magic: [u8; 4],
}

impl Default for Nifti {
    fn default() -> Self {
        let row = |axis: usize| {
            std::array::from_fn(|c| {
                if c == axis {
                    2.0
                } else if c == 3 {
                    -31.0
                } else {
                    0.0
                }
            })
        };
        Self {
            dim: [3, 32, 32, 32, 1, 1, 1, 1],
            datatype: 4,
            bitpix: 16,
            pixdim: [1.0, 2.0, 2.0, 2.0],
            vox_offset: 352.0,
            slope: [1.0, 0.0],
            srow: Some([row(0), row(1), row(2)]),
            magic: *b"n+1\0",
        }
    }
}

impl Nifti {
    pub fn header(&self) -> Vec<u8> {
        let mut h = vec![0; 352];
        let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &348i32.to_le_bytes());
        self.dim.iter().enumerate().for_each(|(n, d)| put(40 + 2 * n, &d.to_le_bytes()));
        put(70, &self.datatype.to_le_bytes());
        put(72, &self.bitpix.to_le_bytes());
        self.pixdim.iter().enumerate().for_each(|(n, p)| put(76 + 4 * n, &p.to_le_bytes()));
        put(108, &self.vox_offset.to_le_bytes());
        put(112, &self.slope[0].to_le_bytes());
        put(116, &self.slope[1].to_le_bytes());
        put(123, &[2]);
        if let Some(rows) = self.srow {
            put(254, &1i16.to_le_bytes());
            rows.iter().flatten().enumerate().for_each(|(n, v)| put(280 + 4 * n, &v.to_le_bytes()));
        }
        put(344, &self.magic);
        h
    }

    /// Returns the header and the ball's voxels.
    pub fn with_ball(&self) -> Vec<u8> {
        let mut bytes = self.header();
        ball().data.iter().for_each(|hu| bytes.extend(hu.to_le_bytes()));
        bytes
    }
}

/// Makes the ball as NRRD with a text of its header changed: `from` becomes `to`.
pub fn nrrd(from: &str, to: &str) -> Vec<u8> {
    let head = "NRRD0004\ntype: short\ndimension: 3\nspace: RAS\nsizes: 32 32 32\nspace directions: (2,0,0) (0,2,0) (0,0,2)\nendian: little\nencoding: raw\nspace origin: (-31,-31,-31)\n\n";
    text_and_ball(head, from, to)
}

/// Makes the ball as MetaImage with a text of its header changed: `from` becomes `to`.
pub fn meta(from: &str, to: &str) -> Vec<u8> {
    let head = "ObjectType = Image\nNDims = 3\nDimSize = 32 32 32\nElementSpacing = 2 2 2\nOffset = 31 31 -31\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    text_and_ball(head, from, to)
}

fn text_and_ball(head: &str, from: &str, to: &str) -> Vec<u8> {
    assert!(head.contains(from), "{from}");
    let mut bytes = head.replace(from, to).into_bytes();
    ball().data.iter().for_each(|hu| bytes.extend(hu.to_le_bytes()));
    bytes
}

/// Writes the valid files and the invalid ones whose header is not made by hand.
pub fn make(home: &Path) {
    let place = |name: &str| home.join(name);
    let ct = ball();
    let mask = ct.map(|hu| u8::from(hu == 40));
    nifti::write(&place("ct.nii"), &ct).unwrap();
    nifti::write(&place("mri.nii"), &mask.map(|v| 5 + 85 * v)).unwrap();
    nifti::write(&place("brain.nii"), &mask).unwrap();
    nifti::write(&place("no-bone.nii"), &ct.map(|hu| if hu == 1200 { 240 } else { hu })).unwrap();
    nifti::write(&place("no-air.nii"), &ct.map(|hu| hu.max(0))).unwrap();
    nifti::write(&place("nan.nii"), &ct.map(|_| f32::NAN)).unwrap();
    nifti::write(&place("one-nan.nii"), &ct.map(|hu| if hu == 40 { f32::NAN } else { f32::from(hu) })).unwrap();
    nifti::write(&place("empty-mask.nii"), &mask.map(|_| 0u8)).unwrap();
    nifti::write(&place("half-labels.nii"), &mask.map(|v| 0.5 * f32::from(v))).unwrap();
    nifti::write(&place("negative-labels.nii"), &mask.map(|v| -i16::from(v))).unwrap();
    let mut outside = mask.map(|_| 0u8);
    outside.data[..100].fill(7);
    nifti::write(&place("outside.nii"), &outside).unwrap();
    let mut two = mask.clone();
    (0..two.data.len()).filter(|at| at % N == N / 2).for_each(|at| two.data[at] = 0);
    nifti::write(&place("two-pieces.nii"), &two).unwrap();
    nifti::write(&place("far.nii"), &turned(ct.clone(), 0.0, DVec3::splat(500.0))).unwrap();
    nifti::write(&place("far-brain.nii"), &turned(mask, 0.0, DVec3::splat(500.0))).unwrap();
    nifti::write(&place("noise.nii"), &ct.map(|_| 100u8)).unwrap();
    let (ct, mri, brain) = head();
    nifti::write(&place("head-ct.nii"), &ct).unwrap();
    nifti::write(&place("head-mri.nii"), &mri).unwrap();
    nifti::write(&place("head-brain.nii"), &brain).unwrap();
    let moved = [
        ("turned", 20.0, DVec3::new(20.0, -15.0, 16.0)),
        ("shifted", 0.0, DVec3::new(0.0, 30.0, 0.0)),
        ("upside-down", 180.0, DVec3::ZERO),
    ];
    for (name, degrees, shift) in moved {
        nifti::write(&place(&format!("{name}-mri.nii")), &turned(mri.clone(), degrees, shift)).unwrap();
        nifti::write(&place(&format!("{name}-brain.nii")), &turned(brain.clone(), degrees, shift)).unwrap();
    }
    recordings(home);
    bombs(home);
}

/// Writes a recording of some ticks, and invalid ones.
fn recordings(home: &Path) {
    let whole = home.join("whole.mcap");
    let mut recorder = Recorder::create(&whole, &SessionHeader::default()).unwrap();
    (0..50)
        .for_each(|tick| recorder.tick(&TickRecord { tick, time_ms: tick as f64, ..TickRecord::default() }).unwrap());
    recorder.finish().unwrap();
    let bytes = fs::read(&whole).unwrap();
    fs::write(home.join("cut.mcap"), &bytes[..20]).unwrap();
    fs::write(home.join("text.mcap"), "not a recording").unwrap();
    fs::write(home.join("void.mcap"), "").unwrap();
    fs::create_dir(home.join("no-recordings")).unwrap();
}

/// Writes small files that need more memory than there is.
fn bombs(home: &Path) {
    // 1000 x 1000 x 700 voxels, all of them present.
    let huge = Nifti { dim: [3, 1000, 1000, 700, 1, 1, 1, 1], datatype: 2, bitpix: 8, ..Nifti::default() };
    fs::write(home.join("bomb.nii.gz"), bomb(&huge.header(), 704)).unwrap();
    let head = "NRRD0004\ntype: uchar\ndimension: 3\nspace: RAS\nsizes: 1000 1000 700\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nencoding: gzip\nspace origin: (0,0,0)\n\n";
    let nrrd = [head.as_bytes(), &bomb(&[], 704)].concat();
    fs::write(home.join("bomb.nrrd"), nrrd).unwrap();
    let head = "ObjectType = Image\nNDims = 3\nDimSize = 1000 1000 700\nElementSpacing = 1 1 1\nOffset = 0 0 0\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nElementType = MET_UCHAR\nCompressedData = True\nElementDataFile = LOCAL\n";
    fs::write(home.join("bomb.mha"), [head.as_bytes(), &bomb(&[], 704)].concat()).unwrap();
    // Few voxels, but metres apart: the grids made of them are huge.
    let wide = Nifti {
        srow: Some([[900.0, 0.0, 0.0, 0.0], [0.0, 900.0, 0.0, 0.0], [0.0, 0.0, 900.0, 0.0]]),
        pixdim: [1.0, 900.0, 900.0, 900.0],
        ..Nifti::default()
    };
    fs::write(home.join("wide.nii"), wide.with_ball()).unwrap();
}
