//! What runs on libHD's own thread, once per millisecond: sense, publish, command.
//!
//! # Practice
//! The force is what the haptic loop last asked for, as long as that is younger than [`SILENT_TICKS`] ticks: a loop that died
//! cannot leave its last force on the motors. After any fault the force rests, then ramps in.

use super::codes;
use super::library::Hd;
use crate::{Fault, ramp::Ramp};
use trepan_geometry::Wrench;
use triple_buffer::{Input, Output};

/// Ticks without a new command after which the force is cut.
pub(super) const SILENT_TICKS: u32 = 10;

/// What the device felt, in its own axes: mm, mm/ms, rad/ms.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sample {
    pub number: u64,
    /// Column-major, translation in 12..15.
    pub transform: [f64; 16],
    pub linear: [f64; 3],
    pub angular: [f64; 3],
    pub buttons: u32,
}

/// What the motors shall do, device axes, N and N mm.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Command {
    pub number: u64,
    pub wrench: Wrench,
}

/// The state of the servo loop.
pub(super) struct Servo {
    pub hd: Hd,
    pub device: u32,
    pub drives_torque: bool,
    pub calibration_style: u32,
    pub samples: Input<Sample>,
    pub commands: Output<Command>,
    pub ramp: Ramp,
    pub number: u64,
    pub last_command: u64,
    pub silent_ticks: u32,
}

impl Servo {
    /// One tick; says whether the library shall call again.
    pub(super) fn tick(&mut self) -> u32 {
        let calibrated = self.calibrate();
        self.hd.begin_frame(self.device);
        self.sense();
        let wrench = self.wanted(calibrated);
        self.hd.set_vector(codes::CURRENT_FORCE, wrench.force.to_array().map(f64::from));
        if self.drives_torque {
            // mN·m is N mm.
            self.hd.set_vector(codes::CURRENT_TORQUE, wrench.torque.to_array().map(f64::from));
        }
        self.hd.end_frame(self.device);
        match self.hd.drain_errors() {
            codes::SUCCESS => {
                self.samples.publish();
                codes::CALLBACK_CONTINUE
            }
            error => self.fault(error),
        }
    }

    /// Whether the device knows where it is; if not, helps it to, without force.
    fn calibrate(&mut self) -> bool {
        match self.hd.check_calibration() {
            codes::CALIBRATION_OK => return true,
            codes::CALIBRATION_NEEDS_UPDATE => self.hd.update_calibration(self.calibration_style),
            _ => {}
        }
        self.ramp.cut(Fault::NotCalibrated);
        false
    }

    fn sense(&mut self) {
        self.number += 1;
        let per_ms = |values: [f64; 16]| [values[0] * 1e-3, values[1] * 1e-3, values[2] * 1e-3];
        *self.samples.input_buffer_mut() = Sample {
            number: self.number,
            transform: self.hd.doubles(codes::CURRENT_TRANSFORM),
            linear: per_ms(self.hd.doubles(codes::CURRENT_VELOCITY)),
            angular: per_ms(self.hd.doubles(codes::CURRENT_ANGULAR_VELOCITY)),
            buttons: self.hd.integer(codes::CURRENT_BUTTONS).cast_unsigned(),
        };
    }

    /// The newest command, or nothing when it is old, when there is a fault, or part of it after one.
    fn wanted(&mut self, calibrated: bool) -> Wrench {
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
            return Wrench::ZERO;
        }
        let share = self.ramp.share();
        Wrench { force: command.wrench.force * share, torque: command.wrench.torque * share }
    }

    /// Force errors rest and go on; anything else means that the device or the loop is gone.
    fn fault(&mut self, error: u32) -> u32 {
        let fault = match error {
            codes::WARM_MOTORS => Fault::Overheated,
            codes::EXCEEDED_MAX_VELOCITY => Fault::TooFast,
            codes::EXCEEDED_MAX_FORCE | codes::EXCEEDED_MAX_FORCE_IMPULSE | codes::FORCE_ERROR => Fault::ForceRefused,
            _ => {
                self.hd.disable(codes::FORCE_OUTPUT);
                self.hd.drain_errors();
                self.ramp.cut(Fault::Disconnected);
                return codes::CALLBACK_DONE;
            }
        };
        self.ramp.cut(fault);
        self.samples.publish();
        codes::CALLBACK_CONTINUE
    }
}
