//! An emulator of the Haply Inverse service: a WebSocket server in this process, with faults on
//! demand.
//!
//! # Practice
//! Forces act once, as the service documents: a connection that ends leaves none.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

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
pub struct Told {
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
    /// Unmasked frames, messages that are not JSON, forces that are not numbers.
    pub misuse: u32,
}

struct Shared {
    behaviour: Mutex<Behaviour>,
    told: Mutex<Told>,
    changed: Mutex<Instant>,
    closing: AtomicBool,
}

impl Shared {
    /// Starts the clock of a fault.
    fn begin(&self) {
        *self.changed.lock().unwrap() = Instant::now();
        self.told.lock().unwrap().no_force_after = None;
    }

    /// Sets the force on the motors.
    fn drive(&self, force: [f64; 3]) {
        let mut told = self.told.lock().unwrap();
        told.force = Some(force);
        if force == [0.0; 3] && told.no_force_after.is_none() {
            told.no_force_after = Some(self.changed.lock().unwrap().elapsed());
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
            told: Mutex::default(),
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
    pub fn told(&self) -> Told {
        self.shared.told.lock().unwrap().clone()
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

fn listen(shared: Arc<Shared>, serve: fn(&Shared, TcpStream)) -> (String, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let thread = thread::spawn(move || {
        let mut serving = Vec::new();
        while !shared.closing.load(Ordering::SeqCst) {
            if let Ok((stream, _)) = listener.accept() {
                stream.set_nonblocking(false).unwrap();
                stream.set_nodelay(true).unwrap();
                stream.set_read_timeout(Some(Duration::from_millis(5))).unwrap();
                let shared = shared.clone();
                serving.retain(|serving: &JoinHandle<()>| !serving.is_finished());
                serving.push(thread::spawn(move || serve(&shared, stream)));
            }
            thread::sleep(Duration::from_millis(1));
        }
        serving.into_iter().for_each(|t| t.join().unwrap());
    });
    (address, thread)
}

fn shake_hands(stream: &mut TcpStream) {
    let mut request = Vec::new();
    while !request.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        if stream.read(&mut byte).is_ok_and(|count| count == 1) {
            request.push(byte[0]);
        }
    }
    assert!(String::from_utf8(request).unwrap().contains("Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="));
    let answer = "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                  Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n\r\n";
    stream.write_all(answer.as_bytes()).unwrap();
}

fn simulate(shared: &Shared, mut stream: TcpStream) {
    shake_hands(&mut stream);
    let behaviour = || shared.behaviour.lock().unwrap().clone();
    let b = behaviour();
    let _ = send(&mut stream, 0x81, b.inventory.clone().unwrap_or_else(|| state(&b)).as_bytes());
    let mut received = Vec::new();
    while !shared.closing.load(Ordering::SeqCst) && !behaviour().hang_up {
        let mut bytes = [0; 4096];
        match stream.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) => received.extend_from_slice(&bytes[..count]),
            Err(_) => continue,
        }
        while let Some((opcode, payload)) = take_frame(shared, &mut received) {
            match opcode {
                1 => {
                    note(shared, &payload);
                    reply(&mut stream, &behaviour());
                }
                8 => shared.told.lock().unwrap().goodbyes += 1,
                10 => shared.told.lock().unwrap().pongs += 1,
                _ => shared.told.lock().unwrap().misuse += 1,
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
    let text = b.garbage.clone().unwrap_or_else(|| state(b));
    if b.mute {
    } else if b.fragmented {
        let (head, tail) = text.as_bytes().split_at(text.len() / 2);
        let _ = send(stream, 0x89, b"still there?");
        let _ = send(stream, 0x01, head);
        let _ = stream.write_all(&[0x80]);
        thread::sleep(Duration::from_millis(1));
        let _ = stream.write_all(&[126, (tail.len() >> 8) as u8, tail.len() as u8]);
        let _ = stream.write_all(tail);
    } else {
        let _ = send(stream, 0x81, text.as_bytes());
    }
}

fn send_events(shared: &Shared, mut stream: TcpStream) {
    shake_hands(&mut stream);
    while !shared.closing.load(Ordering::SeqCst) {
        if let Some(event) = shared.behaviour.lock().unwrap().event.take() {
            shared.begin();
            let _ = send(&mut stream, 0x81, event.as_bytes());
        }
        if matches!(stream.read(&mut [0; 64]), Ok(0)) {
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

fn note(shared: &Shared, payload: &[u8]) {
    let mut told = shared.told.lock().unwrap();
    told.messages += 1;
    let Ok(message) = serde_json::from_slice::<serde_json::Value>(payload) else {
        told.misuse += 1;
        return;
    };
    if let Some(profile) = message["session"]["configure"]["profile"]["name"].as_str() {
        told.profile = Some(profile.to_owned());
    }
    let device = &message["inverse3"][0];
    if device["device_id"] != "049D" {
        told.misuse += 1;
    }
    told.probes += u32::from(!device["commands"]["probe_position"].is_null());
    let vector = &device["commands"]["set_cursor_force"]["vector"];
    let force = ["x", "y", "z"].map(|axis| vector[axis].as_f64());
    if let [Some(x), Some(y), Some(z)] = force {
        drop(told);
        shared.drive([x, y, z]);
    } else if !vector.is_null() {
        told.misuse += 1;
    }
}

/// Opcode and unmasked payload of the first complete frame.
fn take_frame(shared: &Shared, received: &mut Vec<u8>) -> Option<(u8, Vec<u8>)> {
    let second = *received.get(1)?;
    let (start, length) = match second & 0x7f {
        126 => (4, usize::from(u16::from_be_bytes(received.get(2..4)?.try_into().unwrap()))),
        short => (2, usize::from(short)),
    };
    if second & 0x80 == 0 {
        shared.told.lock().unwrap().misuse += 1;
    }
    let mask: [u8; 4] = received.get(start..start + 4)?.try_into().unwrap();
    let payload = received.get(start + 4..start + 4 + length)?;
    let payload = payload.iter().zip(mask.iter().cycle()).map(|(b, m)| b ^ m).collect();
    let opcode = received[0] & 0x0f;
    received.drain(..start + 4 + length);
    Some((opcode, payload))
}

fn send(stream: &mut TcpStream, first: u8, payload: &[u8]) -> std::io::Result<()> {
    let mut frame = vec![first];
    match payload.len() {
        length @ 0..126 => frame.push(length as u8),
        length => frame.extend([126, (length >> 8) as u8, length as u8]),
    }
    frame.extend(payload);
    stream.write_all(&frame)
}
