//! Runtime faults of a device, and their remedies.
//!
//! # Practice
//! A driver sets a fault where it occurs; the force is zero from that tick on. The code that shows
//! messages owns a [`Watch`], made before the device is moved to the haptic loop. Both ends are
//! wait-free.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Why a device applies no force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Fault {
    /// The link to the device is lost.
    Disconnected = 1,
    /// The motors are too warm.
    Overheated = 2,
    /// The device rejected a force.
    ForceRefused = 3,
    /// The tool moved faster than the device allows.
    TooFast = 4,
    /// The device does not know its own position yet.
    NotCalibrated = 5,
    /// Brakes, emergency stop or dead-man switch are engaged.
    Braked = 6,
    /// The haptic loop sent no force for 10 ms.
    LoopSilent = 7,
    /// The vendor's service does not answer.
    ServiceSilent = 8,
    /// The device or its service sends invalid data.
    InvalidMessage = 9,
    /// The device has no power.
    NoPower = 10,
    /// The device sends no new positions.
    Stale = 11,
    /// The maker's software stopped serving the device.
    Stopped = 12,
}

/// Every fault, with its cause and remedy.
const ALL: [(Fault, &str); 12] = [
    (Fault::Disconnected, "the device is disconnected: check its cable and power, then start again"),
    (Fault::Overheated, "the motors are too warm: rest the device for a few minutes"),
    (Fault::ForceRefused, "the device refused a force: lower the stiffness or the force limit"),
    (Fault::TooFast, "the tool moved too fast and the device cut its force: hold it and move slowly"),
    (Fault::NotCalibrated, "the device is not calibrated: put the stylus in its inkwell, or move it through its range"),
    (Fault::Braked, "the brakes are on: release the emergency stop, press the device's force button"),
    (Fault::LoopSilent, "the haptic loop was silent for 10 ms and the force was cut: close other programs"),
    (Fault::ServiceSilent, "the vendor's service does not answer: see whether it runs, then start again"),
    (Fault::InvalidMessage, "the device sends invalid data: update its driver or its service"),
    (Fault::NoPower, "the device has no power: plug in its power supply"),
    (Fault::Stale, "the device sends no new positions: close other programs, check its cable"),
    (Fault::Stopped, "the maker's software stopped serving the device: close other programs, then start again"),
];

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        ALL.iter().filter(|(fault, _)| fault == self).try_for_each(|(_, words)| f.write_str(words))
    }
}

/// The latest fault of a device, readable from another thread.
#[derive(Clone, Debug, Default)]
pub struct Watch(Arc<State>);

#[derive(Debug, Default)]
struct State {
    now: AtomicU32,
    count: AtomicU64,
}

impl Watch {
    /// The current fault, if any.
    pub fn fault(&self) -> Option<Fault> {
        let code = self.0.now.load(Ordering::Relaxed);
        ALL.iter().map(|(fault, _)| *fault).find(|fault| *fault as u32 == code)
    }

    /// Number of faults so far.
    pub fn count(&self) -> u64 {
        self.0.count.load(Ordering::Relaxed)
    }

    /// Sets or clears the fault; a new one is counted.
    pub(crate) fn set(&self, fault: Option<Fault>) {
        let code = fault.map_or(0, |fault| fault as u32);
        if self.0.now.swap(code, Ordering::Relaxed) != code && code != 0 {
            self.0.count.fetch_add(1, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_seen_counted_once_and_says_what_to_do() {
        let watch = Watch::default();
        for (fault, _) in ALL {
            watch.set(Some(fault));
            watch.set(Some(fault));
            assert_eq!(watch.fault(), Some(fault));
            assert!(fault.to_string().contains(':'), "{fault}");
        }
        watch.set(None);
        assert_eq!((watch.fault(), watch.count()), (None, ALL.len() as u64));
    }
}
