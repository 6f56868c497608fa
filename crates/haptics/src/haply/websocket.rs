//! A WebSocket client for a service on the same machine: text messages, one thread, every length
//! bounded.
//!
//! # Practice
//! The handshake uses the nonce of the standard's example, and masks come from a counter. Their
//! randomness only protects caches between machines; a loopback connection has none.
//!
//! # Sources
//! RFC 6455.
//!
//! # When not to use it
//! Across a network, or for a server.

use std::io::{Error, ErrorKind, Read, Result, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Longest message that is read, bytes.
const MAX_MESSAGE: usize = 1 << 20;
/// Longest handshake reply that is read, bytes.
const MAX_HANDSHAKE: usize = 8 << 10;
const NONCE: &str = "dGhlIHNhbXBsZSBub25jZQ==";
const ANSWER_TO_NONCE: &str = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";

const FINAL: u8 = 0x80;
const MASKED: u8 = 0x80;
const CONTINUATION: u8 = 0;
const TEXT: u8 = 1;
const BINARY: u8 = 2;
const CLOSE: u8 = 8;
const PING: u8 = 9;
const PONG: u8 = 10;

/// An open connection.
pub(super) struct WebSocket {
    stream: TcpStream,
    /// Bytes received and not yet used.
    received: Vec<u8>,
    /// The text message that is being assembled.
    message: Vec<u8>,
    frame: Vec<u8>,
    masks: u32,
}

impl WebSocket {
    /// Connects to `address` (`host:port`); fails after `patience`.
    pub(super) fn connect(address: &str, patience: Duration) -> Result<Self> {
        let mut refused = Error::new(ErrorKind::AddrNotAvailable, "no such host");
        for candidate in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&candidate, patience) {
                Ok(stream) => return Self::handshake(stream, address, patience),
                Err(error) => refused = error,
            }
        }
        Err(refused)
    }

    /// Sends a text message.
    pub(super) fn send(&mut self, text: &str) -> Result<()> {
        self.send_frame(TEXT, text.as_bytes())
    }

    /// Returns the next message; `None` when none arrived within `patience`.
    pub(super) fn receive(&mut self, patience: Duration) -> Result<Option<String>> {
        self.stream.set_read_timeout(Some(patience))?;
        loop {
            while let Some((first, payload)) = self.take_frame()? {
                if let Some(message) = self.frame(first, payload)? {
                    return Ok(Some(message));
                }
            }
            if !self.fill()? {
                return Ok(None);
            }
        }
    }

    /// Sends a closing frame; the connection may already be closed.
    pub(super) fn close(mut self) {
        let _ = self.send_frame(CLOSE, &1000u16.to_be_bytes());
    }

    fn handshake(stream: TcpStream, address: &str, patience: Duration) -> Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(patience))?;
        stream.set_write_timeout(Some(patience))?;
        let mut socket = Self { stream, received: Vec::new(), message: Vec::new(), frame: Vec::new(), masks: 1 };
        let request = format!(
            "GET / HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Key: {NONCE}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        );
        socket.stream.write_all(request.as_bytes())?;
        let end = loop {
            if let Some(at) = socket.received.windows(4).position(|w| w == b"\r\n\r\n") {
                break at + 4;
            }
            if socket.received.len() > MAX_HANDSHAKE || !socket.fill()? {
                return Err(Error::new(ErrorKind::InvalidData, "no answer to the WebSocket handshake"));
            }
        };
        let answer = String::from_utf8_lossy(&socket.received[..end]).into_owned();
        socket.received.drain(..end);
        let first = answer.lines().next().unwrap_or_default().to_owned();
        if first.split(' ').nth(1) != Some("101") || !answer.contains(ANSWER_TO_NONCE) {
            return Err(Error::new(ErrorKind::InvalidData, format!("it does not speak WebSocket: {first:?}")));
        }
        Ok(socket)
    }

    /// Reads the bytes available; false when none arrived in time.
    fn fill(&mut self) -> Result<bool> {
        let mut bytes = [0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(Error::new(ErrorKind::UnexpectedEof, "the service closed the connection")),
            Ok(count) => {
                self.received.extend_from_slice(&bytes[..count]);
                Ok(true)
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Ok(false),
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(true),
            Err(error) => Err(error),
        }
    }

    /// Removes the first complete frame from the buffer: its first byte and payload.
    fn take_frame(&mut self) -> Result<Option<(u8, Vec<u8>)>> {
        let Some((start, end)) = frame_bounds(&self.received)? else { return Ok(None) };
        let first = self.received[0];
        let payload = self.received[start..end].to_vec();
        self.received.drain(..end);
        Ok(Some((first, payload)))
    }

    /// Handles a frame; returns the message that it completes.
    fn frame(&mut self, first: u8, payload: Vec<u8>) -> Result<Option<String>> {
        match first & 0x0f {
            CONTINUATION | TEXT | BINARY => {
                if first & 0x0f != CONTINUATION {
                    self.message.clear();
                }
                if self.message.len() + payload.len() > MAX_MESSAGE {
                    return Err(too_long());
                }
                self.message.extend(payload);
                let complete = first & FINAL != 0;
                Ok(complete.then(|| String::from_utf8_lossy(&self.message).into_owned()))
            }
            CLOSE => Err(Error::new(ErrorKind::ConnectionAborted, "the service closed the connection")),
            PING => self.send_frame(PONG, &payload).map(|()| None),
            _ => Ok(None),
        }
    }

    fn send_frame(&mut self, opcode: u8, payload: &[u8]) -> Result<()> {
        self.masks = self.masks.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let mask = self.masks.to_be_bytes();
        self.frame.clear();
        self.frame.push(FINAL | opcode);
        match payload.len() {
            length @ 0..126 => self.frame.push(MASKED | length as u8),
            length @ 126..=0xffff => {
                self.frame.push(MASKED | 126);
                self.frame.extend((length as u16).to_be_bytes());
            }
            length => {
                self.frame.push(MASKED | 127);
                self.frame.extend((length as u64).to_be_bytes());
            }
        }
        self.frame.extend(mask);
        self.frame.extend(payload.iter().zip(mask.iter().cycle()).map(|(byte, key)| byte ^ key));
        self.stream.write_all(&self.frame)
    }
}

/// Start and end of the payload of the first frame in `bytes`; `None` while incomplete.
fn frame_bounds(bytes: &[u8]) -> Result<Option<(usize, usize)>> {
    let Some(&second) = bytes.get(1) else { return Ok(None) };
    if second & MASKED != 0 {
        return Err(Error::new(ErrorKind::InvalidData, "a server must not mask"));
    }
    let (start, length) = match second {
        126 => match bytes.get(2..4).and_then(|b| b.try_into().ok()) {
            Some(b) => (4, u64::from(u16::from_be_bytes(b))),
            None => return Ok(None),
        },
        127 => match bytes.get(2..10).and_then(|b| b.try_into().ok()) {
            Some(b) => (10, u64::from_be_bytes(b)),
            None => return Ok(None),
        },
        short => (2, u64::from(short)),
    };
    if length > MAX_MESSAGE as u64 {
        return Err(too_long());
    }
    let end = start + length as usize;
    Ok((bytes.len() >= end).then_some((start, end)))
}

fn too_long() -> Error {
    Error::new(ErrorKind::InvalidData, format!("a message is longer than {MAX_MESSAGE} bytes"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bounds_of_all_three_length_forms() {
        assert_eq!(frame_bounds(&[0x81, 2, b'o', b'k', 9]).unwrap(), Some((2, 4)));
        let mut medium = vec![0x81, 126, 1, 0];
        medium.resize(4 + 256, 7);
        assert_eq!(frame_bounds(&medium).unwrap(), Some((4, 260)));
        assert_eq!(frame_bounds(&medium[..100]).unwrap(), None);
        assert!(frame_bounds(&[0x81, 127, 0xff, 0, 0, 0, 0, 0, 0, 0]).is_err());
        assert!(frame_bounds(&[0x81, 0x80]).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_bounded(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
            if let Ok(Some((start, end))) = frame_bounds(&bytes) {
                prop_assert!(start <= end && end <= bytes.len());
            }
        }
    }
}
