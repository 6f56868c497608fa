//! HID reports, read from the system's device file without a library.
//!
//! ```text
//! 1  x y z [rx ry rz]   i16 little-endian      raw axes: x right, y to the user, z down
//! 2  rx ry rz           i16                    older models send the rotation separately
//! ```

use super::{FULL_SCALE, Knob, Link};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use trepan_geometry::Vec3;

/// Linux's O_NONBLOCK on the supported processors.
const NONBLOCK: i32 = 0o4000;
/// Longest report that is parsed, bytes.
const LONGEST: usize = 32;
/// Product ids of six-axis devices under Logitech's vendor id.
const LOGITECH: [u16; 11] = [0xc603, 0xc605, 0xc606, 0xc621, 0xc623, 0xc625, 0xc626, 0xc627, 0xc628, 0xc629, 0xc62b];
/// Product ids of six-axis devices under 3Dconnexion's vendor id.
const CONNEXION: [u16; 9] = [0xc62e, 0xc62f, 0xc631, 0xc632, 0xc633, 0xc635, 0xc636, 0xc638, 0xc63a];

/// An open device file.
pub(super) struct Hid {
    file: File,
}

/// The device file of the first known knob of the system.
pub(super) fn find() -> Option<PathBuf> {
    let known =
        |entry: &fs::DirEntry| fs::read_to_string(entry.path().join("device/uevent")).is_ok_and(|text| is_knob(&text));
    let entry = fs::read_dir("/sys/class/hidraw").ok()?.flatten().find(known)?;
    Some(Path::new("/dev").join(entry.file_name()))
}

/// Whether the axes of a device file's knob are absolute; `None` if the system does not say.
pub(super) fn is_absolute(file: &Path) -> Option<bool> {
    has_absolute_axes(&Path::new("/sys/class/hidraw").join(file.file_name()?).join("device/input"))
}

fn has_absolute_axes(inputs: &Path) -> Option<bool> {
    let axes = |folder: &Path, kind: &str| {
        let text = fs::read_to_string(folder.join("capabilities").join(kind)).unwrap_or_default();
        text.chars().any(|c| c.is_ascii_hexdigit() && c != '0')
    };
    let mut folders = fs::read_dir(inputs).ok()?.flatten().map(|entry| entry.path());
    let folder = folders.find(|folder| axes(folder, "abs") || axes(folder, "rel"))?;
    Some(axes(&folder, "abs"))
}

/// Whether the system's description of a HID device is that of a six-axis knob.
fn is_knob(uevent: &str) -> bool {
    let id = uevent.lines().find_map(|line| line.strip_prefix("HID_ID=")).unwrap_or_default();
    let mut parts = id.split(':').skip(1).map(|part| u32::from_str_radix(part, 16).unwrap_or(0));
    let (vendor, product) = (parts.next(), parts.next().and_then(|product| u16::try_from(product).ok()));
    product.is_some_and(|product| match vendor {
        Some(0x046d) => LOGITECH.contains(&product),
        Some(0x256f) => CONNEXION.contains(&product),
        _ => false,
    })
}

impl Hid {
    /// Opens a device file with non-blocking reads.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        Ok(Self { file: OpenOptions::new().read(true).custom_flags(NONBLOCK).open(path)? })
    }
}

impl Link for Hid {
    fn is_silent_when_held(&self) -> bool {
        false
    }

    fn full_scale(&self) -> f32 {
        FULL_SCALE
    }

    fn next(&mut self, knob: &mut Knob) -> io::Result<bool> {
        let mut report = [0; LONGEST];
        match self.file.read(&mut report) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                apply(&report[..count], knob);
                Ok(true)
            }
            Err(fault) if matches!(fault.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(false),
            Err(fault) => Err(fault),
        }
    }
}

/// Merges a report into the known state; ignores reports that are too short.
fn apply(report: &[u8], knob: &mut Knob) {
    let Some((&id, rest)) = report.split_first() else { return };
    match id {
        1 => {
            knob.push = vector(rest).unwrap_or(knob.push);
            knob.turn = rest.get(6..).and_then(vector).unwrap_or(knob.turn);
        }
        2 => knob.turn = vector(rest).unwrap_or(knob.turn),
        3 => knob.buttons = rest.iter().take(4).rev().fold(0, |bits, &byte| bits << 8 | u32::from(byte)),
        _ => {}
    }
}

/// Converts three raw values (x right, y to the user, z down) to right, up, to the user.
fn vector(bytes: &[u8]) -> Option<Vec3> {
    let number = |at: usize| Some(f32::from(i16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?])));
    Some(Vec3::new(number(0)?, -number(4)?, number(2)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn knob(reports: &[&[u8]]) -> Knob {
        let mut knob = Knob::default();
        reports.iter().for_each(|report| apply(report, &mut knob));
        knob
    }

    #[test]
    fn reports_of_both_kinds_give_the_same_knob() {
        // Right 350, to the user 1, down 256; about them 2, -1, -350.
        let long = [1, 0x5e, 1, 1, 0, 0, 1, 2, 0, 0xff, 0xff, 0xa2, 0xfe];
        let old: [&[u8]; 2] = [&[1, 0x5e, 1, 1, 0, 0, 1], &[2, 2, 0, 0xff, 0xff, 0xa2, 0xfe]];
        let expected = Knob { push: Vec3::new(350.0, -256.0, 1.0), turn: Vec3::new(2.0, 350.0, -1.0), buttons: 0 };
        assert_eq!((knob(&[&long]), knob(&old)), (expected, expected));
        assert_eq!(knob(&[&[3, 0x02, 0x01]]).buttons, 0x102);
    }

    #[test]
    fn the_kind_of_the_axes_is_what_the_system_says() {
        let folder = tempfile::tempdir().unwrap();
        let inputs = folder.path();
        assert_eq!(has_absolute_axes(inputs), None);
        let put = |input: &str, abs: &str, rel: &str| {
            let at = inputs.join(input).join("capabilities");
            fs::create_dir_all(&at).unwrap();
            fs::write(at.join("abs"), abs).unwrap();
            fs::write(at.join("rel"), rel).unwrap();
        };
        put("input3", "0\n", "0\n");
        assert_eq!(has_absolute_axes(inputs), None);
        put("input4", "0\n", "3f\n");
        assert_eq!(has_absolute_axes(inputs), Some(false));
        put("input4", "3f\n", "0\n");
        assert_eq!(has_absolute_axes(inputs), Some(true));
    }

    #[test]
    fn only_six_axis_devices_are_knobs() {
        assert!(is_knob("DRIVER=hid\nHID_ID=0003:0000046D:0000C626\nHID_NAME=3Dconnexion SpaceNavigator"));
        assert!(is_knob("HID_ID=0003:0000256F:0000C635"));
        for other in ["", "HID_ID=", "HID_ID=0003:0000046D:0000C077", "HID_ID=0003:0000256F:0000C652", "HID_ID=x:y:z"] {
            assert!(!is_knob(other), "{other}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_leave_a_finite_knob(reports in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 0..20)) {
            let mut knob = Knob::default();
            for report in &reports {
                apply(report, &mut knob);
                prop_assert!(knob.push.is_finite() && knob.turn.is_finite());
            }
        }
    }
}
