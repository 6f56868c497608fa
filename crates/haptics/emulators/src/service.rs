//! An emulator of the Haply Inverse service: a WebSocket server in this process, with faults on
//! demand.
//!
//! # Practice
//! Forces act once, as the service documents: a connection that ends leaves none.

use std::io::{ErrorKind, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use tungstenite::error::{Error, ProtocolError};
use tungstenite::protocol::frame::Frame;
use tungstenite::protocol::frame::coding::{Data, OpCode};
use tungstenite::{Message, WebSocket};

/// What the service sends and how it misbehaves.
#[derive(Clone, Debug)]
pub struct Behaviour {
    /// Position, m.
    pub position: [f64; 3],
    /// Velocity, m/s.
    pub velocity: [f64; 3],
    /// Status of the device, JSON.
    pub status: String,
    /// Text in place of the first message.
    pub inventory: Option<String>,
    /// Text in place of a state.
    pub garbage: Option<String>,
    /// The list of devices is empty.
    pub unplugged: bool,
    /// No replies.
    pub mute: bool,
    /// The reply comes this late, ms.
    pub late_ms: u64,
    /// Replies come in two frames, in pieces, after a ping.
    pub fragmented: bool,
    /// Send this event.
    pub event: Option<String>,
    /// Close all connections.
    pub hang_up: bool,
}

/// A status that lets force through.
pub const READY: &str = r#"{"calibrated":true,"in_use":true,"power_supply":true,"ready":true,"started":true}"#;

impl Default for Behaviour {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            velocity: [0.0; 3],
            status: READY.to_owned(),
            inventory: None,
            garbage: None,
            unplugged: false,
            mute: false,
            late_ms: 0,
            fragmented: false,
            event: None,
            hang_up: false,
        }
    }
}

/// What the service received.
#[derive(Clone, Debug, Default)]
pub struct ReceivedCalls {
    /// The force on the motors, N.
    pub force: Option<[f64; 3]>,
    /// Time from the last change of behaviour to the first zero force.
    pub no_force_after: Option<Duration>,
    /// Messages on the simulation channel.
    pub messages: u32,
    /// Requests for a state.
    pub probes: u32,
    /// Profile that the client announced.
    pub profile: Option<String>,
    /// Pongs received.
    pub pongs: u32,
    /// Closing frames received.
    pub goodbyes: u32,
    /// Invalid frames, messages that are not JSON, forces that are not numbers.
    pub misuse: u32,
}

struct Shared {
    behaviour: Mutex<Behaviour>,
    received: Mutex<ReceivedCalls>,
    changed: Mutex<Instant>,
    closing: AtomicBool,
}

impl Shared {
    /// Starts the clock of a fault.
    fn begin(&self) {
        *self.changed.lock().unwrap() = Instant::now();
        self.received.lock().unwrap().no_force_after = None;
    }

    /// Sets the force on the motors.
    fn drive(&self, force: [f64; 3]) {
        let mut received = self.received.lock().unwrap();
        received.force = Some(force);
        if force == [0.0; 3] && received.no_force_after.is_none() {
            received.no_force_after = Some(self.changed.lock().unwrap().elapsed());
        }
    }
}

/// A running service.
pub struct Service {
    shared: Arc<Shared>,
    /// Address of the simulation channel.
    pub simulation: String,
    /// Address of the event channel.
    pub events: String,
    threads: Vec<JoinHandle<()>>,
}

impl Service {
    /// Listens on two free ports of this machine.
    pub fn start(behaviour: Behaviour) -> Self {
        let shared = Arc::new(Shared {
            behaviour: Mutex::new(behaviour),
            received: Mutex::default(),
            changed: Mutex::new(Instant::now()),
            closing: AtomicBool::new(false),
        });
        let (simulation, one) = listen(shared.clone(), simulate);
        let (events, two) = listen(shared.clone(), send_events);
        Self { shared, simulation, events, threads: vec![one, two] }
    }

    /// Changes the behaviour from now on.
    pub fn behave(&self, change: impl FnOnce(&mut Behaviour)) {
        let mut behaviour = self.shared.behaviour.lock().unwrap();
        self.shared.begin();
        change(&mut behaviour);
    }

    /// What it received so far.
    pub fn received(&self) -> ReceivedCalls {
        self.shared.received.lock().unwrap().clone()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.shared.closing.store(true, Ordering::SeqCst);
        for thread in self.threads.drain(..) {
            thread.join().unwrap();
        }
    }
}

fn listen(shared: Arc<Shared>, serve: fn(&Shared, WebSocket<TcpStream>)) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let thread = thread::spawn(move || {
        let mut serving = Vec::new();
        while !shared.closing.load(Ordering::SeqCst) {
            if let Ok((stream, _)) = listener.accept() {
                stream.set_nonblocking(false).unwrap();
                stream.set_nodelay(true).unwrap();
                let shared = shared.clone();
                serving.retain(|serving: &JoinHandle<()>| !serving.is_finished());
                serving.push(thread::spawn(move || {
                    let Ok(socket) = tungstenite::accept(stream) else { return };
                    socket.get_ref().set_read_timeout(Some(Duration::from_millis(5))).unwrap();
                    serve(&shared, socket);
                }));
            }
            thread::sleep(Duration::from_millis(1));
        }
        serving.into_iter().for_each(|t| t.join().unwrap());
    });
    (address, thread)
}

fn simulate(shared: &Shared, mut socket: WebSocket<TcpStream>) {
    let behaviour = || shared.behaviour.lock().unwrap().clone();
    let b = behaviour();
    send(socket.get_mut(), text(b.inventory.clone().unwrap_or_else(|| state(&b)), true));
    while !shared.closing.load(Ordering::SeqCst) && !behaviour().hang_up {
        let message = socket.read();
        let mut received = shared.received.lock().unwrap();
        match message {
            Ok(Message::Text(message)) => {
                drop(received);
                note(shared, &message);
                reply(socket.get_mut(), &behaviour());
            }
            Ok(Message::Close(_)) => received.goodbyes += 1,
            Ok(Message::Pong(_)) => received.pongs += 1,
            Ok(_) => received.misuse += 1,
            Err(error) if is_timeout(&error) => {}
            Err(Error::Io(_) | Error::ConnectionClosed) => break,
            Err(Error::Protocol(ProtocolError::ResetWithoutClosingHandshake)) => break,
            Err(_) => {
                received.misuse += 1;
                break;
            }
        }
    }
    shared.drive([0.0; 3]);
}

/// Sends a reply; a late one delays no later ones, and the service keeps listening.
fn reply(stream: &mut TcpStream, b: &Behaviour) {
    if b.late_ms > 0 {
        let (mut stream, late) = (stream.try_clone().unwrap(), Behaviour { late_ms: 0, ..b.clone() });
        let wait = Duration::from_millis(b.late_ms);
        thread::spawn(move || {
            thread::sleep(wait);
            reply(&mut stream, &late);
        });
        return;
    }
    let message = b.garbage.clone().unwrap_or_else(|| state(b));
    if b.mute {
    } else if b.fragmented {
        let (head, tail) = message.split_at(message.len() / 2);
        send(stream, Frame::ping("still there?"));
        send(stream, text(head.to_owned(), false));
        let mut bytes = Vec::new();
        Frame::message(tail.to_owned(), OpCode::Data(Data::Continue), true).format(&mut bytes).unwrap();
        let _ = stream.write_all(&bytes[..1]);
        thread::sleep(Duration::from_millis(1));
        let _ = stream.write_all(&bytes[1..4]);
        let _ = stream.write_all(&bytes[4..]);
    } else {
        send(stream, text(message, true));
    }
}

fn send_events(shared: &Shared, mut socket: WebSocket<TcpStream>) {
    while !shared.closing.load(Ordering::SeqCst) {
        if let Some(event) = shared.behaviour.lock().unwrap().event.take() {
            shared.begin();
            send(socket.get_mut(), text(event, true));
        }
        if socket.read().is_err_and(|error| !is_timeout(&error)) {
            return;
        }
    }
}

fn state(b: &Behaviour) -> String {
    let vector = |v: [f64; 3]| format!(r#"{{"x":{},"y":{},"z":{}}}"#, v[0], v[1], v[2]);
    let device = format!(
        r#"{{"device_id":"049D","state":{{"cursor_position":{},"cursor_velocity":{},"mode":"idle"}},"status":{}}}"#,
        vector(b.position),
        vector(b.velocity),
        b.status
    );
    let grip = r#"{"device_id":"60BD","state":{"battery_level":0.9,"buttons":{"a":true,"b":false,"c":false},"hall":1,
        "orientation":{"w":0.8,"x":0.0,"y":0.0,"z":0.6}},"status":{"ready":true,"connected":true,"awake":true}}"#;
    let devices = if b.unplugged { "" } else { &device };
    format!(r#"{{"session_id":1,"inverse3":[{devices}],"wireless_verse_grip":[{grip}],"custom_verse_grip":[{grip}]}}"#)
}

fn note(shared: &Shared, message: &str) {
    let mut received = shared.received.lock().unwrap();
    received.messages += 1;
    let Ok(message) = serde_json::from_str::<serde_json::Value>(message) else {
        received.misuse += 1;
        return;
    };
    if let Some(profile) = message["session"]["configure"]["profile"]["name"].as_str() {
        received.profile = Some(profile.to_owned());
    }
    let device = &message["inverse3"][0];
    if device["device_id"] != "049D" {
        received.misuse += 1;
    }
    received.probes += u32::from(!device["commands"]["probe_position"].is_null());
    let vector = &device["commands"]["set_cursor_force"]["vector"];
    let force = ["x", "y", "z"].map(|axis| vector[axis].as_f64());
    if let [Some(x), Some(y), Some(z)] = force {
        drop(received);
        shared.drive([x, y, z]);
    } else if !vector.is_null() {
        received.misuse += 1;
    }
}

fn is_timeout(error: &Error) -> bool {
    matches!(error, Error::Io(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut))
}

fn text(message: String, is_final: bool) -> Frame {
    Frame::message(message, OpCode::Data(Data::Text), is_final)
}

/// Sends a frame in one piece; the client may already have gone.
fn send(stream: &mut TcpStream, frame: Frame) {
    let mut bytes = Vec::new();
    frame.format(&mut bytes).unwrap();
    let _ = stream.write_all(&bytes);
}
