//! The servo callback on libHD's thread, once per millisecond and device: sense, publish, command.
//!
//! # Practice
//! The applied force is the haptic loop's latest command if it is younger than [`SILENT_TICKS`]
//! ticks and its pose younger than [`STALE_MS`]. So neither a dead loop nor a pause of the library
//! leaves the last force on the motors. After any fault the force is zero, then ramps in. A lost
//! device does not affect the others.

use super::codes;
use super::library::{Hd, MAX_ERRORS, RATE_HZ, Ticked};
use crate::{Fault, STALE_MS, ramp::Ramp};
use trepan_geometry::Wrench;
use triple_buffer::{Input, Output};

/// The servo's tick, ms.
const TICK_MS: f32 = 1e3 / RATE_HZ as f32;
/// Ticks without a new command after which the force is cut.
pub(super) const SILENT_TICKS: u32 = 10;

/// One sample of the device, in its own axes: mm, mm/ms, rad/ms.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sample {
    pub number: u64,
    /// Column-major, translation in 12..15.
    pub transform: [f64; 16],
    pub linear: [f64; 3],
    pub angular: [f64; 3],
    pub buttons: u32,
}

/// The commanded wrench, device axes, N and N mm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Command {
    pub number: u64,
    pub wrench: Wrench,
    /// Age of the pose that the command was computed for, ms.
    pub pose_age_ms: f64,
}

/// All devices of the library, served one after the other.
pub(super) struct ServoGroup {
    pub hd: Hd,
    pub servos: Vec<Servo>,
}

/// The servo loop of one device.
pub(super) struct Servo {
    pub device: u32,
    pub ramp: Ramp,
    drives_torque: bool,
    calibration_style: u32,
    samples: Input<Sample>,
    commands: Output<Command>,
    number: u64,
    last_command: u64,
    silent_ticks: u32,
    /// The wrench last sent to the motors.
    given: Wrench,
    /// The device is lost for good.
    lost: bool,
}

impl Ticked for ServoGroup {
    fn tick(&mut self) -> u32 {
        for place in 0..self.servos.len() {
            if !self.servos[place].lost {
                self.servos[place].frame(&self.hd);
                self.take_errors(place);
                self.servos[place].samples.publish();
            }
        }
        if self.servos.iter().all(|servo| servo.lost) { codes::CALLBACK_DONE } else { codes::CALLBACK_CONTINUE }
    }
}

impl ServoGroup {
    /// Passes every error to the device that it names, or else to the one at `place`.
    fn take_errors(&mut self, place: usize) {
        for _ in 0..MAX_ERRORS {
            let Some((error, device)) = self.hd.next_error() else { return };
            let place = self.servos.iter().position(|servo| servo.device == device).unwrap_or(place);
            self.servos[place].fault(&self.hd, error);
        }
    }
}

impl Servo {
    pub(super) fn new(
        device: u32,
        drives_torque: bool,
        calibration_style: u32,
        samples: Input<Sample>,
        commands: Output<Command>,
        ramp: Ramp,
    ) -> Self {
        Self {
            device,
            drives_torque,
            calibration_style,
            samples,
            commands,
            ramp,
            number: 0,
            last_command: 0,
            silent_ticks: 0,
            given: Wrench::ZERO,
            lost: false,
        }
    }

    fn frame(&mut self, hd: &Hd) {
        (hd.hdMakeCurrentDevice)(self.device);
        let calibrated = self.calibrate(hd);
        (hd.hdBeginFrame)(self.device);
        self.sense(hd);
        self.given = self.desired_wrench(calibrated);
        let wrench = self.given;
        hd.set_vector(codes::CURRENT_FORCE, wrench.force.to_array().map(f64::from));
        if self.drives_torque {
            // mN·m is N mm.
            hd.set_vector(codes::CURRENT_TORQUE, wrench.torque.to_array().map(f64::from));
        }
        (hd.hdEndFrame)(self.device);
    }

    /// Checks the calibration, and updates it if needed once the force is zero, since the position
    /// then jumps.
    fn calibrate(&mut self, hd: &Hd) -> bool {
        match (hd.hdCheckCalibration)() {
            codes::CALIBRATION_OK => return true,
            codes::CALIBRATION_NEEDS_UPDATE if self.given == Wrench::ZERO => {
                (hd.hdUpdateCalibration)(self.calibration_style);
            }
            _ => {}
        }
        self.ramp.cut(Fault::NotCalibrated);
        false
    }

    fn sense(&mut self, hd: &Hd) {
        self.number += 1;
        let per_ms = |values: [f64; 16]| [values[0] * 1e-3, values[1] * 1e-3, values[2] * 1e-3];
        *self.samples.input_buffer_mut() = Sample {
            number: self.number,
            transform: hd.doubles(codes::CURRENT_TRANSFORM),
            linear: per_ms(hd.doubles(codes::CURRENT_VELOCITY)),
            angular: per_ms(hd.doubles(codes::CURRENT_ANGULAR_VELOCITY)),
            buttons: hd.integer(codes::CURRENT_BUTTONS).cast_unsigned(),
        };
    }

    /// The wrench to apply: the newest command, scaled by the ramp, or zero if it is too old or
    /// there is a fault.
    fn desired_wrench(&mut self, calibrated: bool) -> Wrench {
        let command = *self.commands.read();
        if command.number != self.last_command {
            (self.last_command, self.silent_ticks) = (command.number, 0);
        } else {
            self.silent_ticks = self.silent_ticks.saturating_add(1);
        }
        if !calibrated {
            return Wrench::ZERO;
        }
        if self.last_command > 0 && self.silent_ticks >= SILENT_TICKS {
            self.ramp.cut(Fault::LoopSilent);
        } else if command.pose_age_ms > STALE_MS {
            self.ramp.cut_again_or(Fault::Stale);
        }
        let share = self.ramp.share(TICK_MS);
        Wrench { force: command.wrench.force * share, torque: command.wrench.torque * share }
    }

    /// Handles an error: force errors cut the force for a while; all others lose the device.
    fn fault(&mut self, hd: &Hd, error: u32) {
        let fault = match error {
            codes::WARM_MOTORS => Fault::Overheated,
            codes::EXCEEDED_MAX_VELOCITY => Fault::TooFast,
            codes::EXCEEDED_MAX_FORCE | codes::EXCEEDED_MAX_FORCE_IMPULSE | codes::FORCE_ERROR => Fault::ForceRefused,
            codes::DEVICE_FAULT | codes::COMM_ERROR => Fault::Disconnected,
            _ => Fault::Stopped,
        };
        self.ramp.cut(fault);
        if !self.lost && matches!(fault, Fault::Disconnected | Fault::Stopped) {
            self.lost = true;
            (hd.hdMakeCurrentDevice)(self.device);
            (hd.hdDisable)(codes::FORCE_OUTPUT);
        }
    }
}
