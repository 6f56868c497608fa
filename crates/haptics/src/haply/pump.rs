//! The thread that exchanges messages with the service: one out, one back, at the haptic rate.
//!
//! # Practice
//! The loop's `apply` wakes the thread. A loop silent for [`SILENT`] gets no force. A reply later
//! than [`LATE`] sets the force to zero, in the service too, until it arrives; without one for
//! [`GONE`] the device is lost.

use super::protocol::{self, Event, Frame};
use super::websocket::WebSocket;
use crate::{Fault, STALE_MS, Watch, ramp::Ramp};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use trepan_geometry::Vec3;
use triple_buffer::{Input, Output};

/// Duration that an exchange counts for in the ramp, ms: the service's usual period.
const TICK_MS: f32 = 1.0;
/// Silence of the loop that cuts the force: 8 ms, since 10 ms includes the message's transit.
const SILENT: Duration = Duration::from_millis(8);
/// Reply time that counts as late: the operating system may wake a waiting socket 4 ms late.
const LATE: Duration = Duration::from_millis(4);
const GONE: Duration = Duration::from_millis(1000);
/// How long the event listener waits before it checks for closing.
const LISTEN: Duration = Duration::from_millis(20);
/// Consecutive invalid messages after which the device is lost.
const MAX_GARBLED: u32 = 100;

/// The latest state from the service.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct News {
    pub number: u64,
    pub frame: Frame,
}

/// The latest force requested by the loop, N, service axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Command {
    pub number: u64,
    pub force: Vec3,
    /// Age of the pose that the force was computed for, ms.
    pub pose_age_ms: f64,
}

/// Flags shared by both threads.
#[derive(Debug, Default)]
pub(super) struct Flags {
    /// The driver asks the thread to end.
    pub closing: AtomicBool,
    /// The device is disconnected.
    pub lost: AtomicBool,
    /// Whether an event reported the brakes on.
    pub braked: AtomicBool,
    /// The motors stalled or a device disconnected since the last check: cuts the force once.
    pub cut_once: AtomicBool,
}

/// The state of the thread.
pub(super) struct Pump {
    pub socket: WebSocket,
    pub device: String,
    /// Id of the grip; `None` accepts any.
    pub grip: Option<String>,
    pub news: Input<News>,
    pub commands: Output<Command>,
    pub flags: Arc<Flags>,
    pub watch: Watch,
    pub ramp: Ramp,
    pub known: Frame,
    pub number: u64,
    /// Consecutive invalid messages.
    pub garbled: u32,
}

impl Pump {
    /// Runs until the driver closes or the device is lost; the last message sets zero force.
    pub(super) fn run(mut self) {
        let mut last = 0;
        while !self.flags.closing.load(Ordering::Acquire) {
            let force = self.next_force(&mut last);
            if let Err(error) = self.exchange(force) {
                self.watch.set(Some(match error.kind() {
                    io::ErrorKind::InvalidData => Fault::InvalidMessage,
                    io::ErrorKind::TimedOut => Fault::ServiceSilent,
                    _ => Fault::Disconnected,
                }));
                self.flags.lost.store(true, Ordering::Release);
                return;
            }
        }
        let _ = self.exchange(Vec3::ZERO);
        self.socket.close();
    }

    /// Waits for the loop, then returns the force to send.
    fn next_force(&mut self, last: &mut u64) -> Vec3 {
        // Discard wake-ups for commands already read: the current one is still to come.
        thread::park_timeout(Duration::ZERO);
        if self.commands.read().number == *last {
            thread::park_timeout(SILENT);
        }
        let command = *self.commands.read();
        let silent = command.number == *last;
        *last = command.number;
        if let Err(fault) = self.known.status.unwrap_or(Err(Fault::NotCalibrated)) {
            self.ramp.cut(fault);
        } else if self.flags.braked.load(Ordering::Acquire) || self.flags.cut_once.swap(false, Ordering::AcqRel) {
            self.ramp.cut(Fault::Braked);
        } else if silent && command.number > 0 {
            self.ramp.cut(Fault::LoopSilent);
        } else if command.pose_age_ms > STALE_MS {
            self.ramp.cut_again_or(Fault::Stale);
        }
        let share = self.ramp.share(TICK_MS);
        if command.force.is_finite() { command.force * share } else { Vec3::ZERO }
    }

    /// Sends one message and receives one. While the answer is late, zero force is sent once more:
    /// the service may still receive it.
    fn exchange(&mut self, force: Vec3) -> io::Result<()> {
        self.socket.send(&protocol::force(&self.device, force))?;
        let mut owed = 1;
        let mut waited = Duration::ZERO;
        while owed > 0 {
            let Some(message) = self.socket.receive(LATE)? else {
                if waited.is_zero() {
                    self.socket.send(&protocol::force(&self.device, Vec3::ZERO))?;
                    owed += 1;
                }
                waited += LATE;
                self.ramp.cut(Fault::ServiceSilent);
                if waited >= GONE || self.flags.closing.load(Ordering::Acquire) {
                    return Err(io::ErrorKind::TimedOut.into());
                }
                continue;
            };
            owed -= 1;
            match protocol::frame(&message, &self.device, self.grip.as_deref()) {
                Ok(Some(frame)) => {
                    self.garbled = 0;
                    self.publish(frame);
                }
                Ok(None) => return Err(io::ErrorKind::NotConnected.into()),
                Err(_) if self.garbled < MAX_GARBLED => {
                    self.garbled += 1;
                    self.ramp.cut(Fault::InvalidMessage);
                }
                Err(_) => return Err(io::ErrorKind::InvalidData.into()),
            }
        }
        Ok(())
    }

    /// Merges a frame into the published state; missing fields keep their values.
    fn publish(&mut self, frame: Frame) {
        let known = &mut self.known;
        known.status = frame.status.or(known.status);
        known.orientation = frame.orientation.or(known.orientation);
        known.buttons = frame.buttons.or(known.buttons);
        if let Some(cursor) = frame.cursor {
            known.cursor = Some(cursor);
            self.number += 1;
            self.news.write(News { number: self.number, frame: *known });
        }
    }
}

/// Listens to the service's events until the driver closes: they report brakes and losses first.
pub(super) fn listen(mut events: WebSocket, flags: &Flags) {
    while !flags.closing.load(Ordering::Acquire) && !flags.lost.load(Ordering::Acquire) {
        match events.receive(LISTEN) {
            Ok(Some(message)) => match protocol::event(&message) {
                Some(Event::Braked) => flags.braked.store(true, Ordering::Release),
                Some(Event::Released) => flags.braked.store(false, Ordering::Release),
                // The next state shows whether it was this device: its list then lacks it.
                Some(Event::Stalled | Event::Disconnected) => flags.cut_once.store(true, Ordering::Release),
                None => {}
            },
            Ok(None) => {}
            Err(_) => return,
        }
    }
    events.close();
}
