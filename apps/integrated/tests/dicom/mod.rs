//! A small head as a DICOM series with all identifiers that a hospital adds.

use glam::Vec3;
use std::fs;
use std::path::{Path, PathBuf};
use trepan_volume::VoxelVolume;

/// Writer of an explicit little-endian DICOM file.
struct Slice(Vec<u8>);

impl Slice {
    fn new() -> Self {
        let mut slice = Self([vec![0; 128], b"DICM".to_vec()].concat());
        slice.text(0x0002_0010, b"UI", "1.2.840.10008.1.2.1");
        slice
    }

    fn element(&mut self, tag: u32, vr: &[u8; 2], value: &[u8]) -> &mut Self {
        self.0.extend(((tag >> 16) as u16).to_le_bytes());
        self.0.extend((tag as u16).to_le_bytes());
        self.0.extend(vr);
        let even = value.len() + value.len() % 2;
        match vr {
            b"OW" | b"UN" | b"UT" => {
                self.0.extend([0, 0]);
                self.0.extend((even as u32).to_le_bytes());
            }
            _ => self.0.extend((even as u16).to_le_bytes()),
        }
        self.0.extend(value);
        self.0.resize(self.0.len() + even - value.len(), b' ');
        self
    }

    fn text(&mut self, tag: u32, vr: &[u8; 2], value: &str) -> &mut Self {
        self.element(tag, vr, value.as_bytes())
    }

    fn short(&mut self, tag: u32, value: u16) -> &mut Self {
        self.element(tag, b"US", &value.to_le_bytes())
    }
}

const SIDE: usize = 32;
const SPACING_MM: f32 = 2.0;

/// Makes a hollow ball of bone about the origin.
pub fn head() -> VoxelVolume<i16> {
    let mut ct = VoxelVolume::isotropic([SIDE; 3], Vec3::splat(-31.0), SPACING_MM, -1000i16);
    for at in 0..ct.data.len() {
        let r = ct.centre_of([at % SIDE, at / SIDE % SIDE, at / (SIDE * SIDE)]).length();
        ct.data[at] = match r {
            r if r < 24.0 => 40,
            r if r < 29.0 => 1200,
            _ => -1000,
        };
    }
    ct
}

/// Writes the head as a DICOM series with all identifiers that a hospital adds.
pub fn series(folder: &Path) -> PathBuf {
    let place = folder.join("MUSTERMANN^ERIKA");
    fs::create_dir(&place).unwrap();
    let ct = head();
    for k in 0..SIDE {
        let mut slice = Slice::new();
        slice.text(0x0008_0016, b"UI", "1.2.840.10008.5.1.4.1.1.2").text(
            0x0008_0018,
            b"UI",
            &format!("1.2.276.99.{k}"),
        );
        slice.text(0x0008_0050, b"SH", "ACC-0815").text(0x0008_0060, b"CS", "CT").text(
            0x0008_0080,
            b"LO",
            "Klinik-Nirgends",
        );
        slice.text(0x0008_0081, b"ST", "Lindenallee 5").text(0x0008_0090, b"PN", "Dr-Seltsam").text(
            0x0008_103e,
            b"LO",
            "series-for-her",
        );
        slice.text(0x0009_0010, b"LO", "PRIVATE-CREATOR").text(0x0009_1001, b"LT", "private-note").text(
            0x0009_1002,
            b"UN",
            "private-note",
        );
        slice.text(0x0010_0010, b"PN", "MUSTERMANN^ERIKA").text(0x0010_0020, b"LO", "PID-4711").text(
            0x0010_0030,
            b"DA",
            "19491224",
        );
        slice.text(0x0010_1005, b"PN", "MAIDENNAME^ERIKA").text(0x0010_1040, b"LO", "Lindenallee 5").text(
            0x0010_4000,
            b"LT",
            "comment-on-her",
        );
        slice.text(0x0020_000d, b"UI", "1.2.276.99.1").text(0x0020_000e, b"UI", "1.2.276.99.2").text(
            0x0020_4000,
            b"LT",
            "comment-on-her",
        );
        // DICOM's axes are left and posterior.
        slice.text(0x0020_0032, b"DS", &format!("31\\31\\{}", -31.0 + SPACING_MM * k as f32));
        slice.text(0x0020_0037, b"DS", "-1\\0\\0\\0\\-1\\0");
        slice
            .short(0x0028_0002, 1)
            .text(0x0028_0004, b"CS", "MONOCHROME2")
            .short(0x0028_0010, SIDE as u16)
            .short(0x0028_0011, SIDE as u16);
        slice
            .text(0x0028_0030, b"DS", "2\\2")
            .short(0x0028_0100, 16)
            .short(0x0028_0101, 16)
            .short(0x0028_0102, 15)
            .short(0x0028_0103, 1);
        slice.text(0x0028_1052, b"DS", "0").text(0x0028_1053, b"DS", "1").text(0x0040_a160, b"UT", "comment-on-her");
        let pixels: Vec<u8> =
            ct.data[k * SIDE * SIDE..][..SIDE * SIDE].iter().flat_map(|hu| hu.to_le_bytes()).collect();
        slice.element(0x7fe0_0010, b"OW", &pixels);
        fs::write(place.join(format!("MUSTERMANN-{k:02}.dcm")), slice.0).unwrap();
    }
    place
}
