//! The thread that talks to the service: one message out, one back, at the haptic loop's pace.
//!
//! # Practice
//! The loop's `apply` wakes the thread; a loop that is silent for [`SILENT`] gets no force. A reply
//! later than [`LATE`] cuts the force, on the wire too, until it comes; without one for [`GONE`]
//! the device is lost.

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

/// An exchange counts as so long for the ramp, ms: the service's usual pace.
const TICK_MS: f32 = 1.0;
/// Within 10 ms there is no force: the rest is for the message's way.
const SILENT: Duration = Duration::from_millis(8);
/// Systems wake a waiting socket up to 4 ms late.
const LATE: Duration = Duration::from_millis(4);
const GONE: Duration = Duration::from_millis(1000);
/// How long the listener waits before it looks whether the driver closes.
const LISTEN: Duration = Duration::from_millis(20);
/// Messages in a row without sense after which the device is lost.
const MAX_GARBLED: u32 = 100;

/// What the service last said.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct News {
    pub number: u64,
    pub frame: Frame,
}

/// What the loop last asked for, N, service axes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Command {
    pub number: u64,
    pub force: Vec3,
    /// Age of the pose that it was made for, ms.
    pub pose_age_ms: f64,
}

/// Flags that both threads see.
#[derive(Debug, Default)]
pub(super) struct Flags {
    /// The driver wants the thread to end.
    pub closing: AtomicBool,
    /// The device is gone.
    pub lost: AtomicBool,
    /// Brakes as the service's events tell.
    pub braked: AtomicBool,
    /// The motors stalled, or a device went, since the last look: a rest, once.
    pub cut_once: AtomicBool,
}

/// The state of the thread.
pub(super) struct Pump {
    pub socket: WebSocket,
    pub device: String,
    /// Id of the grip; any where there is none.
    pub grip: Option<String>,
    pub news: Input<News>,
    pub wishes: Output<Command>,
    pub flags: Arc<Flags>,
    pub watch: Watch,
    pub ramp: Ramp,
    pub known: Frame,
    pub number: u64,
    /// Messages without sense in a row.
    pub garbled: u32,
}

impl Pump {
    /// Runs until the driver closes or the device is lost; the last message asks for no force.
    pub(super) fn run(mut self) {
        let mut last = 0;
        while !self.flags.closing.load(Ordering::Acquire) {
            let force = self.next_force(&mut last);
            if let Err(error) = self.exchange(force) {
                self.watch.set(Some(match error.kind() {
                    io::ErrorKind::InvalidData => Fault::Garbled,
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

    /// Waits for the loop, and gives the force to send.
    fn next_force(&mut self, last: &mut u64) -> Vec3 {
        // Forget wake-ups for wishes that were read already: the one that counts is still to come.
        thread::park_timeout(Duration::ZERO);
        if self.wishes.read().number == *last {
            thread::park_timeout(SILENT);
        }
        let wish = *self.wishes.read();
        let silent = wish.number == *last;
        *last = wish.number;
        if let Err(fault) = self.known.status.unwrap_or(Err(Fault::NotCalibrated)) {
            self.ramp.cut(fault);
        } else if self.flags.braked.load(Ordering::Acquire) || self.flags.cut_once.swap(false, Ordering::AcqRel) {
            self.ramp.cut(Fault::Braked);
        } else if silent && wish.number > 0 {
            self.ramp.cut(Fault::LoopSilent);
        } else if wish.pose_age_ms > STALE_MS {
            self.ramp.cut_again_or(Fault::Stale);
        }
        let share = self.ramp.share(TICK_MS);
        if wish.force.is_finite() { wish.force * share } else { Vec3::ZERO }
    }

    /// One message out, one back. While the answer is late the service is told once more that no
    /// force is wanted: it may still listen.
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
                    self.ramp.cut(Fault::Garbled);
                }
                Err(_) => return Err(io::ErrorKind::InvalidData.into()),
            }
        }
        Ok(())
    }

    /// Lays a frame over what is known: what it does not mention stays.
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

/// Listens to the service's events until the driver closes: brakes and losses show there first.
pub(super) fn listen(mut events: WebSocket, flags: &Flags) {
    while !flags.closing.load(Ordering::Acquire) && !flags.lost.load(Ordering::Acquire) {
        match events.receive(LISTEN) {
            Ok(Some(message)) => match protocol::event(&message) {
                Some(Event::Braked) => flags.braked.store(true, Ordering::Release),
                Some(Event::Released) => flags.braked.store(false, Ordering::Release),
                // Whether it was ours, the next state tells: its list lacks the device.
                Some(Event::Stalled | Event::Disconnected) => flags.cut_once.store(true, Ordering::Release),
                None => {}
            },
            Ok(None) => {}
            Err(_) => return,
        }
    }
    events.close();
}
