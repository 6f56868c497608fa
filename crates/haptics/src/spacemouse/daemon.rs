//! The spacenav daemon's socket: messages of eight native 32-bit integers.
//!
//! ```text
//! 0 motion   x y z  rx ry rz  period
//!            z and rz point away from the user: the daemon's axes are left-handed
//! 1 press    button
//! 2 release  button
//! 3 device   0 added, 1 removed: a removed knob is let go
//! others     settings: ignored
//! ```
//!
//! The daemon passes on what the kernel says of the knob. A knob of absolute axes reports changes
//! only, up to 500, so that silence means an unchanged knob; one of relative axes repeats every few
//! ms while it is pushed, up to 350, and may never report a zero. The system's description of the
//! knob says which it is; one that it does not describe counts as absolute, of 350.
//!
//! The daemon reports that a knob is removed to clients that ask for version 1 of its protocol, by
//! one integer that it answers with one. A daemon before 1.0 takes that for a sensitivity that is
//! no number, and ignores it; there the knob's device file says that it is gone.

use super::{FULL_SCALE, Knob, Link, hid};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;
use trepan_geometry::Vec3;

/// Count that a knob of absolute axes reports at full deflection.
const ABSOLUTE_SCALE: f32 = 500.0;
const MESSAGE: usize = 32;
/// Bytes of the answer to a request for a version.
const ANSWER: usize = 4;
const MOTION: i32 = 0;
const PRESS: i32 = 1;
const RELEASE: i32 = 2;
const DEVICE: i32 = 3;
/// Request for version 1 of the protocol, and its answer.
const VERSION_1: i32 = 0x7faa_5501;

/// A connection to the daemon.
pub(super) struct Daemon {
    socket: UnixStream,
    buffer: [u8; MESSAGE],
    filled: usize,
    /// Whether the knob's device file is gone; set by a thread that looks for it.
    gone: Arc<AtomicBool>,
    /// Whether its axes are absolute, if the system says.
    absolute: Option<bool>,
}

/// Time between two looks for a knob's device file.
const LOOK: Duration = Duration::from_millis(100);

/// Looks for a device file from a thread of its own, since a tick does not.
///
/// The flag is set when the file is gone. The thread ends then, or with the flag's owner.
fn watched(file: PathBuf) -> Arc<AtomicBool> {
    let gone = Arc::new(AtomicBool::new(false));
    let flag = Arc::downgrade(&gone);
    std::thread::spawn(move || {
        while let Some(flag) = flag.upgrade() {
            flag.store(!file.exists(), Relaxed);
            if flag.load(Relaxed) {
                break;
            }
            drop(flag);
            std::thread::park_timeout(LOOK);
        }
    });
    gone
}

/// Path of the daemon's socket.
pub(super) fn usual_place() -> PathBuf {
    std::env::var_os("SPNAV_SOCKET").map_or_else(|| "/var/run/spnav.sock".into(), PathBuf::from)
}

impl Daemon {
    /// Connects with non-blocking reads.
    pub(super) fn connect(path: &Path) -> io::Result<Self> {
        let mut socket = UnixStream::connect(path)?;
        socket.set_nonblocking(true)?;
        socket.write_all(&VERSION_1.to_ne_bytes())?;
        let file = hid::find();
        let absolute = file.as_deref().and_then(hid::is_absolute);
        Ok(Self { socket, buffer: [0; MESSAGE], filled: 0, gone: file.map(watched).unwrap_or_default(), absolute })
    }
}

impl Link for Daemon {
    fn is_silent_when_held(&self) -> bool {
        self.absolute != Some(false)
    }

    fn full_scale(&self) -> f32 {
        if self.absolute == Some(true) { ABSOLUTE_SCALE } else { FULL_SCALE }
    }

    fn next(&mut self, knob: &mut Knob) -> io::Result<bool> {
        while self.filled < MESSAGE {
            if self.filled == ANSWER && self.buffer[..ANSWER] == VERSION_1.to_ne_bytes() {
                self.filled = 0;
            }
            let end = if self.filled < ANSWER { ANSWER } else { MESSAGE };
            match self.socket.read(&mut self.buffer[self.filled..end]) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => self.filled += count,
                Err(fault) if fault.kind() == ErrorKind::WouldBlock => {
                    if self.gone.load(Relaxed) {
                        *knob = Knob::default();
                    }
                    return Ok(false);
                }
                Err(fault) if fault.kind() == ErrorKind::Interrupted => {}
                Err(fault) => return Err(fault),
            }
        }
        self.filled = 0;
        apply(&numbers(&self.buffer), knob);
        Ok(true)
    }
}

fn numbers(bytes: &[u8; MESSAGE]) -> [i32; 8] {
    std::array::from_fn(|at| i32::from_ne_bytes(std::array::from_fn(|byte| bytes[4 * at + byte])))
}

fn apply(message: &[i32; 8], knob: &mut Knob) {
    let vector = |at: usize| Vec3::new(message[at] as f32, message[at + 1] as f32, -(message[at + 2] as f32));
    let bit = u32::try_from(message[1]).ok().and_then(|button| 1u32.checked_shl(button)).unwrap_or(0);
    match message[0] {
        MOTION => (knob.push, knob.turn) = (vector(1), vector(4)),
        PRESS => knob.buttons |= bit,
        RELEASE => knob.buttons &= !bit,
        DEVICE if message[1] != 0 => *knob = Knob::default(),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_file_that_goes_is_noticed() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let gone = watched(file.path().into());
        std::thread::sleep(2 * LOOK);
        assert!(!gone.load(Relaxed));
        drop(file);
        let noticed = (0..50).any(|_| {
            std::thread::sleep(LOOK);
            gone.load(Relaxed)
        });
        assert!(noticed);
    }

    #[test]
    fn any_message_is_handled() {
        let mut knob = Knob::default();
        for first in [i32::MIN, -1, 0, 1, 2, 3, 7, VERSION_1, i32::MAX] {
            for rest in [i32::MIN, -1, 0, 31, 32, i32::MAX] {
                apply(&[first, rest, rest, rest, rest, rest, rest, rest], &mut knob);
                assert!(knob.push.is_finite() && knob.turn.is_finite());
            }
        }
    }
}
