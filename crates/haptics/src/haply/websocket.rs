//! A WebSocket client for a service on the same machine: text messages, one thread, every length
//! bounded.
//!
//! # Sources
//! RFC 6455, by the crate `tungstenite`.
//!
//! # When not to use it
//! Across a network: nothing is encrypted.

use std::io::{Error, ErrorKind, Result};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;
use tungstenite::error::{Error as Failure, ProtocolError};
use tungstenite::protocol::{CloseFrame, WebSocketConfig, frame::coding::CloseCode};
use tungstenite::{HandshakeError, Message, client::client_with_config};

/// Longest message that is read, bytes.
const MAX_MESSAGE: usize = 1 << 20;
/// Most bytes that one call reads.
const READ_BYTES: usize = 4096;

/// An open connection.
pub(super) struct WebSocket(tungstenite::WebSocket<TcpStream>);

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
        self.0.send(Message::text(text)).map_err(failed)
    }

    /// Returns the next message; `None` when none arrived within `patience`.
    pub(super) fn receive(&mut self, patience: Duration) -> Result<Option<String>> {
        self.0.get_ref().set_read_timeout(Some(patience))?;
        loop {
            match self.0.read() {
                Ok(Message::Text(text)) => return Ok(Some(text.as_str().to_owned())),
                Ok(Message::Binary(bytes)) => return Ok(Some(String::from_utf8_lossy(&bytes).into_owned())),
                Ok(Message::Close(_)) => return Err(failed(Failure::ConnectionClosed)),
                Ok(_) => {}
                Err(Failure::Io(error)) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => return Ok(None),
                    ErrorKind::Interrupted => {}
                    _ => return Err(error),
                },
                Err(failure) => return Err(failed(failure)),
            }
        }
    }

    /// Sends a closing frame; the connection may already be closed.
    pub(super) fn close(mut self) {
        let _ = self.0.close(Some(CloseFrame { code: CloseCode::Normal, reason: "".into() }));
    }

    fn handshake(stream: TcpStream, address: &str, patience: Duration) -> Result<Self> {
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(patience))?;
        stream.set_write_timeout(Some(patience))?;
        let limits = WebSocketConfig::default()
            .read_buffer_size(READ_BYTES)
            .max_message_size(Some(MAX_MESSAGE))
            .max_frame_size(Some(MAX_MESSAGE));
        match client_with_config(format!("ws://{address}/"), stream, Some(limits)) {
            Ok((socket, _)) => Ok(Self(socket)),
            Err(HandshakeError::Interrupted(_) | HandshakeError::Failure(Failure::AttackAttempt)) => {
                Err(Error::new(ErrorKind::InvalidData, "no answer to the WebSocket handshake"))
            }
            Err(HandshakeError::Failure(failure)) => Err(failed(failure)),
        }
    }
}

fn failed(failure: Failure) -> Error {
    let foreign = |words| Error::new(ErrorKind::InvalidData, format!("it does not speak WebSocket: {words:?}"));
    match failure {
        Failure::Io(error) => error,
        Failure::ConnectionClosed
        | Failure::AlreadyClosed
        | Failure::Protocol(ProtocolError::ResetWithoutClosingHandshake | ProtocolError::HandshakeIncomplete) => {
            Error::new(ErrorKind::UnexpectedEof, "the service closed the connection")
        }
        Failure::Capacity(_) => {
            Error::new(ErrorKind::InvalidData, format!("a message is longer than {MAX_MESSAGE} bytes"))
        }
        Failure::Http(answer) => foreign(format!("{:?} {}", answer.version(), answer.status())),
        other => foreign(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::net::TcpListener;
    use std::thread;

    /// What a client receives from a service that sends `bytes` after the handshake or instead.
    fn received(shakes_hands: bool, bytes: Vec<u8>) -> Result<Option<String>> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let service = thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            if shakes_hands {
                stream = tungstenite::accept(stream).unwrap().into_inner();
            }
            let _ = stream.write_all(&bytes);
            stream
        });
        let patience = Duration::from_millis(100);
        let socket = WebSocket::connect(&address, patience);
        let _open = service.join().unwrap();
        socket?.receive(patience)
    }

    #[test]
    fn messages_of_all_three_length_forms_are_read() {
        let text = |header: &[u8], length: usize| [header, &vec![b'7'; length]].concat();
        for (header, length) in [
            (&[0x81, 2][..], 2),
            (&[0x81, 126, 1, 0], 256),
            (&[0x81, 127, 0, 0, 0, 0, 0, 1, 0, 0], 1 << 16),
            (&[0x82, 3], 3),
        ] {
            assert_eq!(received(true, text(header, length)).unwrap(), Some("7".repeat(length)));
        }
        assert_eq!(received(true, text(&[0x81, 126, 1, 0], 100)).unwrap(), None, "incomplete");
    }

    #[test]
    fn a_hostile_service_is_an_error_in_words() {
        let error = |shakes_hands, bytes: &[u8]| {
            let error = received(shakes_hands, bytes.to_vec()).unwrap_err();
            (error.kind(), error.to_string())
        };
        let invalid = |words: &str| (ErrorKind::InvalidData, words.to_owned());
        let too_long = invalid("a message is longer than 1048576 bytes");
        assert_eq!(error(true, &[0x81, 127, 0xff, 0, 0, 0, 0, 0, 0, 0]), too_long);
        assert_eq!(error(true, &[0x81, 127, 0, 0, 0, 0, 0, 0x10, 0, 1]), too_long);
        let fragment = [&[0x01, 127, 0, 0, 0, 0, 0, 0x10, 0, 0][..], &[b'7'; 1 << 20], &[0x80, 1, b'7']].concat();
        assert_eq!(error(true, &fragment), too_long);
        for bytes in [&[0x81, 0x82, 0, 0, 0, 0, 1, 2][..], &[0x83, 0], &[0xc1, 0], &[0x80, 0], &[0x81, 1, 0xff]] {
            assert_eq!(error(true, bytes).0, ErrorKind::InvalidData, "{bytes:?}");
        }
        assert_eq!(error(true, &[0x88, 0]), (ErrorKind::UnexpectedEof, "the service closed the connection".to_owned()));
        assert_eq!(
            error(false, b"HTTP/1.1 404 Not Found\r\n\r\n"),
            invalid("it does not speak WebSocket: \"HTTP/1.1 404 Not Found\"")
        );
        assert_eq!(error(false, b"HTTP/1.1 101"), invalid("no answer to the WebSocket handshake"));
        assert!(error(false, b"SSH-2.0-OpenSSH\r\n").1.starts_with("it does not speak WebSocket"));
    }
}
