//! The spacenav daemon's socket: messages of eight native 32-bit integers.
//!
//! ```text
//! 0 motion   x y z  rx ry rz  period
//!            z and rz point away from the user: the daemon's axes are left-handed
//! 1 press    button
//! 2 release  button
//! others     devices, settings: ignored
//! ```

use super::{Knob, Link};
use std::io::{self, ErrorKind, Read};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use trepan_geometry::Vec3;

const MESSAGE: usize = 32;
const MOTION: i32 = 0;
const PRESS: i32 = 1;
const RELEASE: i32 = 2;

/// A connection to the daemon.
pub(super) struct Daemon {
    socket: UnixStream,
    buffer: [u8; MESSAGE],
    filled: usize,
}

/// Path of the daemon's socket.
pub(super) fn usual_place() -> PathBuf {
    std::env::var_os("SPNAV_SOCKET").map_or_else(|| "/var/run/spnav.sock".into(), PathBuf::from)
}

impl Daemon {
    /// Connects with non-blocking reads.
    pub(super) fn connect(path: &Path) -> io::Result<Self> {
        let socket = UnixStream::connect(path)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, buffer: [0; MESSAGE], filled: 0 })
    }
}

impl Link for Daemon {
    fn next(&mut self, knob: &mut Knob) -> io::Result<bool> {
        while self.filled < MESSAGE {
            match self.socket.read(&mut self.buffer[self.filled..]) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => self.filled += count,
                Err(fault) if fault.kind() == ErrorKind::WouldBlock => return Ok(false),
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
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_message_is_handled() {
        let mut knob = Knob::default();
        for first in [i32::MIN, -1, 0, 1, 2, 3, 7, i32::MAX] {
            for rest in [i32::MIN, -1, 0, 31, 32, i32::MAX] {
                apply(&[first, rest, rest, rest, rest, rest, rest, rest], &mut knob);
                assert!(knob.push.is_finite() && knob.turn.is_finite());
            }
        }
    }
}
