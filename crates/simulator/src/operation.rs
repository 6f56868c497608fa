//! Settings of an operation: flap, loss of cerebrospinal fluid, forbidden tissue, brain stiffness,
//! tick rate. They come from the options, else from the replayed recording, else from defaults.

use crate::options::Options;
use serde::{Deserialize, Serialize};
use trepan_haptics::DeviceName;
use trepan_measurements::{aspirator, brain_living, support};
use trepan_patient::{MadeTumour, TissueClass, TissueSource};

/// Default diameter of the flap that the scripts `flap` and `resect` cut, mm.
const SCRIPTED_FLAP_MM: f32 = 24.0;
/// Radius of the tumour that the script `resect` takes where the case has none, mm.
const SCRIPTED_TUMOUR_MM: &[f32] = &[7.5];
/// Default factor by which the fluid drains faster than in a patient.
const CSF_SPEED_UP: f32 = support::DRAIN_SPEED_UP.f32();
/// Default Young's modulus of the brain in a slow test, kPa.
const YOUNG_KPA: f32 = brain_living::YOUNG_MODULUS.f32();
/// Default rate at which an aspirator takes brain tissue, mm/s.
const ASPIRATION_MM_S: f32 = aspirator::REMOVAL_RATE.f32();
/// Default haptic tick rate, Hz, numerical.
const RATE_HZ: f32 = 1000.0;

/// Settings of an operation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Operation {
    /// Diameter of the planned flap, mm; 0 for a burr hole alone.
    pub flap_mm: f32,
    /// The planned flap's line as it was drawn on the skull, RAS mm; empty for a round one.
    pub flap_line: Vec<[f32; 3]>,
    /// Share of the fluid's buoyancy that is lost when the dura is opened, 0 to 1; `None`: by what
    /// holds the brain.
    pub csf_loss: Option<f32>,
    /// Factor by which the fluid drains faster than in a patient, 1 to 1000.
    pub csf_speed_up: f32,
    /// Tissue classes that raise a warning when a tool comes close.
    pub forbidden: Vec<TissueClass>,
    /// Young's modulus of the brain, kPa.
    pub young_modulus_kpa: f32,
    /// Brain that the aspirator takes in a second for each area in contact, mm/s; 0 for none.
    pub aspiration_mm_s: f32,
    /// Bleeding of cut tissue over the usual; 0 for none.
    pub bleeding: f32,
    /// Whether the dura is closed and is to be incised; `None`: where there is a tumour. Recordings
    /// of versions without it had it open.
    #[serde(default = "opens_by_itself")]
    pub dura: Option<bool>,
    /// Made tumour: its radius, mm, after its centre, RAS mm, if that is given; empty without one.
    pub tumour: Vec<f32>,
    /// Haptic tick rate, Hz.
    pub rate_hz: f32,
    /// Whether the brain's tools require an open skull; false for a watcher.
    pub opening_needed: bool,
    /// Whether force stays off after a device fault until the user acts; false for a watcher.
    pub force_waits: bool,
}

fn opens_by_itself() -> Option<bool> {
    Some(false)
}

impl Default for Operation {
    fn default() -> Self {
        Self {
            flap_mm: 0.0,
            flap_line: Vec::new(),
            csf_loss: None,
            csf_speed_up: CSF_SPEED_UP,
            forbidden: vec![TissueClass::Vessel],
            young_modulus_kpa: YOUNG_KPA,
            aspiration_mm_s: ASPIRATION_MM_S,
            bleeding: 1.0,
            dura: None,
            tumour: Vec::new(),
            rate_hz: RATE_HZ,
            opening_needed: true,
            force_waits: true,
        }
    }
}

impl Operation {
    /// The made tumour; `None` without one.
    pub fn made_tumour(&self) -> Option<MadeTumour> {
        match self.tumour[..] {
            [radius_mm] => Some(MadeTumour { centre: None, radius_mm }),
            [x, y, z, radius_mm] => Some(MadeTumour { centre: Some([x, y, z]), radius_mm }),
            _ => None,
        }
    }

    /// Takes settings from the options, and missing ones from the replayed recording, if any.
    pub fn of(options: &Options, device: &DeviceName, recorded: Option<&Self>) -> Self {
        let cuts_flap = matches!(device.operation(), Some("flap" | "resect" | "bleed"));
        let flap_mm = if cuts_flap { SCRIPTED_FLAP_MM } else { 0.0 };
        let tumour = if device.operation() == Some("resect") { SCRIPTED_TUMOUR_MM } else { &[] };
        let base = recorded.cloned().unwrap_or_else(|| Self { flap_mm, tumour: tumour.into(), ..Self::default() });
        // A folder is not built again.
        let given = options.patient.tumour.filter(|_| options.case.is_none());
        let makes_none = options.case.is_some() || options.patient.tissues.iter().any(TissueSource::is_tumour);
        let tumour = match given {
            Some(MadeTumour { centre, radius_mm }) => centre.into_iter().flatten().chain([radius_mm]).collect(),
            None if makes_none => Vec::new(),
            None => base.tumour,
        };
        let keeps_line = options.flap_line.is_empty() && options.flap.is_none();
        // A watcher does not see the bone that was drilled before it joined.
        let watches = options.watch.is_some();
        Self {
            flap_mm: options.flap.unwrap_or(base.flap_mm),
            flap_line: if keeps_line { base.flap_line } else { options.flap_line.clone() },
            csf_loss: options.csf_loss.or(base.csf_loss),
            csf_speed_up: options.csf_speed_up.unwrap_or(base.csf_speed_up),
            forbidden: options.forbid.clone().unwrap_or(base.forbidden),
            young_modulus_kpa: options.young_modulus_kpa.unwrap_or(base.young_modulus_kpa),
            aspiration_mm_s: options.aspiration.unwrap_or(base.aspiration_mm_s),
            bleeding: options.bleeding.unwrap_or(base.bleeding),
            dura: options.dura.or(base.dura),
            tumour,
            rate_hz: options.rate_hz.unwrap_or(base.rate_hz),
            opening_needed: base.opening_needed && !watches,
            force_waits: base.force_waits && !watches,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn options_override_the_recording_and_the_recording_the_defaults() {
        let parse = |line: &str| Options::try_parse_from(line.split(' ')).unwrap();
        let script = DeviceName::scripted("flap");
        let resection = Operation::of(&parse("x"), &DeviceName::scripted("resect"), None);
        assert_eq!((resection.flap_mm, &resection.tumour[..]), (SCRIPTED_FLAP_MM, SCRIPTED_TUMOUR_MM));
        let labelled = Operation::of(&parse("x --tissue tumour=a.nii"), &DeviceName::scripted("resect"), None);
        assert!(labelled.made_tumour().is_none() && resection.made_tumour().is_some_and(|made| made.centre.is_none()));
        let usual = Operation::of(&parse("x"), &DeviceName::MOUSE, None);
        assert_eq!((usual.flap_mm, usual.csf_loss, &usual.forbidden[..]), (0.0, None, &[TissueClass::Vessel][..]));
        assert_eq!(Operation::of(&parse("x"), &script, None).flap_mm, SCRIPTED_FLAP_MM);
        let line = "x --flap 30 --forbid tumour,vessel --csf-loss 0 --csf-speed-up 10 --young-modulus-kpa 6 --aspiration 0.5 --bleeding 2 --dura closed --tumour 1,2,3,4 --rate-hz 500 --watch other";
        let drawn = Options { flap_line: vec![[1.5, -2.0, 0.1], [3.0, 4.0, 5.0]], ..parse(line) };
        let given = Operation::of(&drawn, &script, None);
        assert!(!given.opening_needed && usual.opening_needed && usual.force_waits);
        assert_eq!(Operation::of(&parse("x"), &DeviceName::MOUSE, Some(&given)), given);
        let round = Operation::of(&parse("x --flap 40"), &script, Some(&given));
        assert!(round.flap_mm == 40.0 && round.flap_line.is_empty());
        assert_eq!(Operation::of(&parse("x"), &script, Some(&given)).csf_loss, Some(0.0));
    }
}
