//! The messages of the Haply Inverse service, version 3.5.
//!
//! # Practice
//! Entries are parsed one by one, so that a malformed one does not lose the others. A missing array
//! means "unchanged".
//!
//! # Sources
//! Haply Inverse SDK documentation: WebSocket protocol, control commands, events.

use crate::Fault;
use serde::Deserialize;
use serde_json::{Value, json};
use trepan_geometry::{Buttons, Quat, Vec3};

/// The contents of one frame of the service about the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Frame {
    /// Position, m, and velocity, m/s, service axes.
    pub cursor: Option<(Vec3, Vec3)>,
    /// Whether force may be applied, and if not, why.
    pub status: Option<Result<(), Fault>>,
    /// Orientation of the grip.
    pub orientation: Option<Quat>,
    /// Buttons of the grip.
    pub buttons: Option<Buttons>,
}

#[derive(Deserialize)]
struct Vector {
    x: f32,
    y: f32,
    z: f32,
}

#[derive(Deserialize)]
struct Rotation {
    w: f32,
    x: f32,
    y: f32,
    z: f32,
}

#[derive(Deserialize)]
struct InverseState {
    cursor_position: Vector,
    cursor_velocity: Vector,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct InverseStatus {
    calibrated: bool,
    power_supply: bool,
    ready: bool,
}

#[derive(Deserialize)]
struct GripState {
    orientation: Option<Rotation>,
    button: Option<bool>,
    buttons: Option<GripButtons>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct GripButtons {
    a: bool,
    b: bool,
}

/// Why a message is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InvalidMessage {
    /// Not JSON, or not an object.
    NotJson,
    /// Device lists are maps: the service is older than 3.5.
    TooOld,
}

/// Ids of the devices in the service's inventory; only `wanted`, if given.
pub(super) fn devices(message: &str, wanted: Option<&str>) -> Result<Vec<String>, InvalidMessage> {
    let message = object(message)?;
    let ids = entries(&message, "inverse3").filter_map(|entry| entry["device_id"].as_str());
    Ok(ids.filter(|id| wanted.is_none_or(|wanted| wanted.eq_ignore_ascii_case(id))).map(str::to_owned).collect())
}

/// Id of the grip to read: `wanted`, or the first listed.
pub(super) fn grip(message: &str, wanted: Option<&str>) -> Option<String> {
    let message = object(message).ok()?;
    let listed = grips(&message).find_map(|entry| entry["device_id"].as_str().map(str::to_owned));
    wanted.map(str::to_uppercase).or(listed)
}

/// Parses the entries for `device` and `grip` (any grip if `None`) from a message. A grip in
/// several lists is read once. Returns `None` if the device list exists but lacks the device: it is
/// disconnected.
pub(super) fn frame(message: &str, device: &str, grip: Option<&str>) -> Result<Option<Frame>, InvalidMessage> {
    let message = object(message)?;
    let mut frame = Frame::default();
    let listed = entries(&message, "inverse3").find(|entry| entry["device_id"] == device);
    if let Some(entry) = listed {
        if let Ok(state) = InverseState::deserialize(&entry["state"]) {
            frame.cursor = Some((state.cursor_position.vec3(), state.cursor_velocity.vec3()));
        }
        if let Ok(status) = InverseStatus::deserialize(&entry["status"]) {
            frame.status = Some(status.may_push());
        }
    } else if message.get("inverse3").is_some() {
        return Ok(None);
    }
    let held =
        |entry: &&Value| grip.is_none_or(|id| entry["device_id"].as_str().is_some_and(|d| d.eq_ignore_ascii_case(id)));
    let states = grips(&message).filter(held);
    if let Some(grip) = states.filter_map(|entry| GripState::deserialize(&entry["state"]).ok()).next() {
        frame.orientation =
            grip.orientation.as_ref().map(|q| Quat::from_xyzw(q.x, q.y, q.z, q.w)).filter(|q| q.length() > 0.5);
        frame.buttons = grip.buttons();
    }
    Ok(Some(frame))
}

/// The first message: announces this client.
pub(super) fn hello(device: &str) -> String {
    json!({
        "session": {"configure": {"profile": {"name": "trepan"}}},
        "inverse3": [{"device_id": device, "commands": {"probe_position": {}}}],
    })
    .to_string()
}

/// The command for a force, N, in service axes.
pub(super) fn force(device: &str, force: Vec3) -> String {
    let vector = json!({"x": force.x, "y": force.y, "z": force.z});
    json!({"inverse3": [{"device_id": device, "commands": {"set_cursor_force": {"vector": vector}}}]}).to_string()
}

/// An event of the service that affects the force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    /// The emergency brake is on, until it is released.
    Braked,
    /// The emergency brake is off.
    Released,
    /// The motors stalled.
    Stalled,
    /// A device was disconnected.
    Disconnected,
}

/// Parses an event; `None` for unknown events and those that do not affect the force.
pub(super) fn event(message: &str) -> Option<Event> {
    let event = object(message).ok()?;
    match (event["name"].as_str()?, event["data"]["safety_type"].as_str()) {
        ("device-safety-triggered", Some("ebrake_triggered")) => Some(Event::Braked),
        ("device-safety-triggered", Some("ebrake_released")) => Some(Event::Released),
        ("device-safety-triggered", Some("stall_detected")) => Some(Event::Stalled),
        ("device-disconnected", _) => Some(Event::Disconnected),
        _ => None,
    }
}

fn object(message: &str) -> Result<Value, InvalidMessage> {
    let value: Value = serde_json::from_str(message).map_err(|_| InvalidMessage::NotJson)?;
    match &value["inverse3"] {
        _ if !value.is_object() => Err(InvalidMessage::NotJson),
        Value::Object(_) => Err(InvalidMessage::TooOld),
        _ => Ok(value),
    }
}

fn entries<'a>(message: &'a Value, kind: &str) -> impl Iterator<Item = &'a Value> {
    message[kind].as_array().into_iter().flatten()
}

fn grips(message: &Value) -> impl Iterator<Item = &Value> {
    ["verse_grip", "wireless_verse_grip", "custom_verse_grip"].into_iter().flat_map(|kind| entries(message, kind))
}

impl Vector {
    fn vec3(&self) -> Vec3 {
        Vec3::new(self.x, self.y, self.z)
    }
}

impl InverseStatus {
    fn may_push(&self) -> Result<(), Fault> {
        match self {
            Self { power_supply: false, .. } => Err(Fault::NoPower),
            Self { calibrated: false, .. } => Err(Fault::NotCalibrated),
            Self { ready: false, .. } => Err(Fault::Braked),
            _ => Ok(()),
        }
    }
}

impl GripState {
    fn buttons(&self) -> Option<Buttons> {
        let wireless = self.buttons.as_ref().map(|b| u32::from(b.a) | u32::from(b.b) << 1);
        wireless.or(self.button.map(u32::from)).map(Buttons)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: &str = r#"{"session_id":1,"inverse3":[{"device_id":"BAD1","state":7},
        {"device_id":"049D","state":{"cursor_position":{"x":0.01,"y":0.02,"z":0.03},"cursor_velocity":{"x":1,"y":2,"z":3},"mode":"idle"},
         "status":{"calibrated":true,"in_use":true,"power_supply":true,"ready":true,"started":true}}],
        "verse_grip":[{"device_id":"60BD","state":"?"},
         {"device_id":"60BE","state":{"button":true,"hall":3,"orientation":{"w":1,"x":0,"y":0,"z":0}},"status":{"ready":true}}]}"#;

    #[test]
    fn a_frame_is_read_past_malformed_neighbours() {
        let frame = frame(FRAME, "049D", None).unwrap().unwrap();
        assert_eq!(frame.cursor, Some((Vec3::new(0.01, 0.02, 0.03), Vec3::new(1.0, 2.0, 3.0))));
        assert_eq!(
            (frame.status, frame.orientation, frame.buttons),
            (Some(Ok(())), Some(Quat::IDENTITY), Some(Buttons(1)))
        );
        assert_eq!(devices(FRAME, Some("049d")), Ok(vec!["049D".to_owned()]));
        assert_eq!(devices(FRAME, None), Ok(vec!["BAD1".to_owned(), "049D".to_owned()]));
        assert_eq!(devices(FRAME, Some("049E")), Ok(Vec::new()));
    }

    #[test]
    fn the_requested_grip_is_read_from_any_list() {
        let entry = |id: &str, a: bool| format!(r#"{{"device_id":"{id}","state":{{"buttons":{{"a":{a}}}}}}}"#);
        let (left, right) = (entry("60BD", false), entry("71CE", true));
        let message = format!(r#"{{"wireless_verse_grip":[{left}],"custom_verse_grip":[{left},{right}]}}"#);
        let pedal = |grip| frame(&message, "1", grip).unwrap().unwrap().buttons;
        assert_eq!([None, Some("60bd"), Some("71CE")].map(pedal), [0, 0, 1].map(|bits| Some(Buttons(bits))));
        assert_eq!(pedal(Some("0000")), None);
        assert_eq!((grip(&message, None), grip(&message, Some("71ce"))), (Some("60BD".into()), Some("71CE".into())));
        assert_eq!(grip("{}", None), None);
    }

    #[test]
    fn a_missing_list_is_unchanged_and_a_missing_entry_is_a_loss() {
        assert_eq!(frame("{}", "049D", None), Ok(Some(Frame::default())));
        assert_eq!(frame(r#"{"inverse3":[]}"#, "049D", None), Ok(None));
    }

    #[test]
    fn an_old_service_and_invalid_messages_are_distinguished() {
        assert_eq!(frame(r#"{"inverse3":{"049D":{}}}"#, "049D", None), Err(InvalidMessage::TooOld));
        assert_eq!(frame("{\"inverse3", "049D", None), Err(InvalidMessage::NotJson));
        assert_eq!(frame("[1]", "049D", None), Err(InvalidMessage::NotJson));
    }

    #[test]
    fn force_is_refused_unless_powered_calibrated_and_ready() {
        let status = |text: &str| {
            let message = format!(r#"{{"inverse3":[{{"device_id":"1","status":{{{text}}}}}]}}"#);
            frame(&message, "1", None).unwrap().unwrap().status.unwrap()
        };
        assert_eq!(status(r#""calibrated":true,"ready":true"#), Err(Fault::NoPower));
        assert_eq!(status(r#""power_supply":true,"ready":true"#), Err(Fault::NotCalibrated));
        assert_eq!(status(r#""power_supply":true,"calibrated":true"#), Err(Fault::Braked));
    }

    #[test]
    fn events_that_affect_force_are_recognised() {
        let safety =
            |kind: &str| event(&format!(r#"{{"name":"device-safety-triggered","data":{{"safety_type":"{kind}"}}}}"#));
        assert_eq!(safety("ebrake_triggered"), Some(Event::Braked));
        assert_eq!(safety("ebrake_released"), Some(Event::Released));
        assert_eq!(safety("stall_detected"), Some(Event::Stalled));
        assert_eq!(event(r#"{"name":"device-disconnected"}"#), Some(Event::Disconnected));
        assert_eq!((safety("fod_stage_changed"), event(r#"{"name":"something-new"}"#)), (None, None));
    }

    proptest! {
        #[test]
        fn any_text_is_read_without_a_panic(text in "\\PC{0,200}") {
            let _ = (frame(&text, "1", None), devices(&text, None), event(&text));
        }
    }
}
