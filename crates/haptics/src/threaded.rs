//! Runs a device on its own thread, so that its delays do not affect other devices.
//!
//! # Theory
//! ```text
//!   haptic loop: read() <──reading── thread: apply, read ── device
//!                apply() ──command──>
//! ```
//! Both pass through triple buffers: neither side waits. This costs one tick of delay, which the
//! capabilities include.
//!
//! # Practice
//! For the second hand's device, whose link must not delay the first one's tick. `apply` wakes the
//! thread. A silent loop means no calls to the device, and its driver then cuts the force. A device
//! that hangs for 50 ms is lost. Closing waits for the call in progress.
//!
//! # When not to use it
//! For the only device, and for scripts: their calls do not wait.

use crate::{Capabilities, HapticDevice, Reading, Status};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use trepan_contact::GuardedWrench;
use trepan_geometry::ToolState;
use triple_buffer::{Input, Output, triple_buffer};

/// Time without a reading after which a device is lost, ms.
const LOST_MS: f64 = 50.0;

/// The haptic loop's handle to a device on another thread.
pub struct ThreadedDevice {
    capabilities: Capabilities,
    news: Output<News>,
    commands: Input<Command>,
    closing: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    number: u64,
    last_news: u64,
    last: Reading,
    time_ms: f64,
    fresh_ms: f64,
}

#[derive(Clone, Copy)]
struct News {
    number: u64,
    reading: Reading,
}

#[derive(Clone, Copy, Default)]
struct Command {
    number: u64,
    time_ms: f64,
    wrench: GuardedWrench,
}

impl ThreadedDevice {
    /// Moves the device to a new thread.
    pub fn new(mut device: Box<dyn HapticDevice>) -> Self {
        let capabilities = device.capabilities();
        let last = Reading { status: Status::Stale, ..device.read(0.0) };
        let (news_in, news) = triple_buffer(&News { number: 0, reading: last });
        let (commands, command_output) = triple_buffer(&Command::default());
        let closing = Arc::new(AtomicBool::new(false));
        let ends = closing.clone();
        let thread = thread::spawn(move || serve(device, news_in, command_output, &ends));
        Self {
            capabilities: Capabilities { delay_ticks: capabilities.delay_ticks.saturating_add(1), ..capabilities },
            news,
            commands,
            closing,
            thread: Some(thread),
            number: 0,
            last_news: 0,
            last,
            time_ms: 0.0,
            fresh_ms: f64::NAN,
        }
    }
}

/// The thread: applies each command and returns a reading; sets zero force at the end.
fn serve(device: Box<dyn HapticDevice>, mut news: Input<News>, mut commands: Output<Command>, closing: &AtomicBool) {
    let mut device = Closing(device);
    let mut last = 0;
    while !closing.load(Ordering::Acquire) {
        let command = *commands.read();
        if command.number == last {
            thread::park();
            continue;
        }
        last = command.number;
        device.0.apply(command.wrench);
        news.write(News { number: command.number, reading: device.0.read(command.time_ms) });
    }
}

/// Closes the device however the thread ends, also by a panic.
struct Closing(Box<dyn HapticDevice>);

impl Drop for Closing {
    fn drop(&mut self) {
        self.0.apply(GuardedWrench::ZERO);
        self.0.close();
    }
}

impl HapticDevice for ThreadedDevice {
    fn read(&mut self, time_ms: f64) -> Reading {
        if self.fresh_ms.is_nan() {
            self.fresh_ms = time_ms;
        }
        self.time_ms = time_ms;
        let News { number, reading } = *self.news.read();
        self.last.status = Status::Stale;
        if number != self.last_news {
            (self.last_news, self.fresh_ms, self.last) = (number, time_ms, reading);
        }
        self.last.tool = ToolState { time_ms, ..self.last.tool };
        if self.thread.is_none() || time_ms - self.fresh_ms > LOST_MS {
            self.last.status = Status::Lost;
        }
        self.last
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        let Some(thread) = &self.thread else { return };
        self.number += 1;
        self.commands.write(Command { number: self.number, time_ms: self.time_ms, wrench });
        thread.thread().unpark();
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities.clone()
    }

    fn close(&mut self) {
        self.closing.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A thread that panicked has closed the device already.
            let _ = thread.join();
        }
    }
}

impl Drop for ThreadedDevice {
    fn drop(&mut self) {
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::time::Duration;
    use trepan_contact::{ForceGuard, GuardConfig};
    use trepan_geometry::{Pose, Vec3, Wrench};

    /// The calls that the test device received, and its behaviour.
    #[derive(Default)]
    struct DeviceLog {
        force: Vec3,
        closed: u32,
        hangs: bool,
        panics: bool,
    }

    struct Bench(Arc<Mutex<DeviceLog>>);

    impl HapticDevice for Bench {
        fn read(&mut self, time_ms: f64) -> Reading {
            while self.0.lock().unwrap().hangs {
                thread::sleep(Duration::from_millis(1));
            }
            assert!(!self.0.lock().unwrap().panics, "as the test asks");
            let tool = ToolState { time_ms, ..ToolState::at(Pose::from_translation(Vec3::X)) };
            Reading { tool, status: Status::Fresh }
        }
        fn apply(&mut self, wrench: GuardedWrench) {
            self.0.lock().unwrap_or_else(|e| e.into_inner()).force = wrench.force();
        }
        fn capabilities(&self) -> Capabilities {
            Capabilities::passive("bench")
        }
        fn close(&mut self) {
            self.0.lock().unwrap_or_else(|e| e.into_inner()).closed += 1;
        }
    }

    fn pair() -> (Arc<Mutex<DeviceLog>>, ThreadedDevice) {
        let seen = Arc::new(Mutex::new(DeviceLog::default()));
        (seen.clone(), ThreadedDevice::new(Box::new(Bench(seen))))
    }

    fn newton() -> GuardedWrench {
        let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, slew_n_per_ms: 10.0, ..GuardConfig::default() });
        guard.guard(Wrench { force: Vec3::X, torque: Vec3::ZERO }, &ToolState::at(Pose::IDENTITY), 1.0)
    }

    /// Reads until a reading has the status; panics on a timeout.
    fn until(device: &mut ThreadedDevice, from_ms: f64, status: Status) -> f64 {
        for tick in 0..5000 {
            let time_ms = from_ms + f64::from(tick);
            let reading = device.read(time_ms);
            device.apply(newton());
            if reading.status == status {
                return time_ms;
            }
            thread::sleep(Duration::from_micros(300));
        }
        panic!("never {status:?}");
    }

    #[test]
    fn force_goes_through_readings_come_back_and_closing_leaves_none() {
        let (seen, mut device) = pair();
        assert_eq!(device.capabilities().delay_ticks, 1);
        until(&mut device, 1.0, Status::Fresh);
        assert_eq!(device.read(9000.0).tool.tip(), Vec3::X);
        assert_eq!(seen.lock().unwrap().force, Vec3::X);
        device.close();
        device.close();
        let (force, closed) = {
            let seen = seen.lock().unwrap();
            (seen.force, seen.closed)
        };
        assert_eq!((force, closed), (Vec3::ZERO, 1));
        assert_eq!(device.read(9001.0).status, Status::Lost);
    }

    #[test]
    fn a_device_that_hangs_is_lost_without_delaying_the_loop() {
        let (seen, mut device) = pair();
        let at_ms = until(&mut device, 1.0, Status::Fresh);
        seen.lock().unwrap().hangs = true;
        let at_ms = until(&mut device, at_ms, Status::Lost);
        seen.lock().unwrap().hangs = false;
        until(&mut device, at_ms, Status::Fresh);
    }

    #[test]
    fn a_device_that_panics_is_closed_and_lost() {
        let (seen, mut device) = pair();
        let at_ms = until(&mut device, 1.0, Status::Fresh);
        seen.lock().unwrap().panics = true;
        until(&mut device, at_ms, Status::Lost);
        device.close();
        let seen = seen.lock().unwrap_or_else(|e| e.into_inner());
        assert_eq!((seen.force, seen.closed), (Vec3::ZERO, 1));
    }
}
