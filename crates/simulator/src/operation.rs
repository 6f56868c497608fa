//! Settings of an operation: flap, loss of cerebrospinal fluid, forbidden tissue, brain stiffness,
//! tick rate. They come from the options, else from the replayed recording, else from defaults.

use crate::options::{CSF_SPEED_UPS, MODULI_KPA, Options, RATES_HZ};
use crate::tissue_class::TissueClass;
use trepan_haptics::DeviceName;
use trepan_link::Recording;
use trepan_measurements::{brain_living, support};

/// Default diameter of the flap that script `flap` cuts, mm.
const SCRIPTED_FLAP_MM: f32 = 24.0;
/// Default factor by which the fluid drains faster than in a patient.
const CSF_SPEED_UP: f32 = support::DRAIN_SPEED_UP.f32();
/// Default Young's modulus of the brain in a slow test, kPa.
const YOUNG_KPA: f32 = brain_living::YOUNG_MODULUS.f32();
/// Default haptic tick rate, Hz, numerical.
const RATE_HZ: f32 = 1000.0;

/// Settings of an operation.
#[derive(Clone, Debug, PartialEq)]
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
    pub young_kpa: f32,
    /// Haptic tick rate, Hz.
    pub rate_hz: f32,
    /// Whether the brain's tools require an open skull; false for a watcher.
    pub opening_needed: bool,
    /// Whether force stays off after a device fault until the user acts. False for a watcher, and
    /// for recordings of versions without this rule.
    pub force_waits: bool,
}

impl Operation {
    /// Takes settings from the options, and missing ones from the replayed recording, if any.
    pub fn of(options: &Options, device: &DeviceName, recording: Option<&Recording>) -> Self {
        let recorded = |key: &str| recording?.header.config.get(key);
        let number = |key: &str| recorded(key)?.parse::<f32>().ok().filter(|value| value.is_finite());
        let within = |key: &str, [low, high]: [f64; 2]| number(key).filter(|&n| (low..=high).contains(&n.into()));
        let scripted = device.operation() == Some("flap");
        let flap = options.flap.or_else(|| number("flap_mm")).or(scripted.then_some(SCRIPTED_FLAP_MM));
        let listed = || {
            let names = recorded("forbidden")?;
            Some(names.split(',').filter_map(TissueClass::named).collect())
        };
        Self {
            flap_mm: flap.unwrap_or(0.0),
            flap_line: match (&options.flap_line[..], options.flap) {
                ([], None) => recorded("flap_line").map_or_else(Vec::new, |text| points(text)),
                (line, _) => line.to_vec(),
            },
            csf_loss: options.csf_loss.or_else(|| number("csf_loss")).or_else(|| number("fluid_lost")),
            csf_speed_up: options
                .csf_speed_up
                .or_else(|| within("csf_speed_up", CSF_SPEED_UPS))
                .unwrap_or(CSF_SPEED_UP),
            forbidden: options.forbid.clone().or_else(listed).unwrap_or_else(|| vec![TissueClass::Vessel]),
            young_kpa: options
                .young_modulus_kpa
                .or_else(|| within("young_modulus_kpa", MODULI_KPA))
                .unwrap_or(YOUNG_KPA),
            rate_hz: options.rate_hz.or_else(|| within("rate_hz", RATES_HZ)).unwrap_or(RATE_HZ),
            // A watcher does not see the bone that was drilled before it joined.
            opening_needed: options.watch.is_none()
                && recorded("opening_needed").is_none_or(|needed| needed != "false"),
            force_waits: options.watch.is_none()
                && recording.is_none_or(|_| recorded("force_waits").is_some_and(|waits| waits == "true")),
        }
    }

    /// Entries for a recording's header.
    pub fn entries(&self) -> [(String, String); 9] {
        let forbidden: Vec<&str> = self.forbidden.iter().map(|class| class.name()).collect();
        [
            ("flap_mm".into(), self.flap_mm.to_string()),
            (
                "flap_line".into(),
                self.flap_line.iter().map(|[x, y, z]| format!("{x} {y} {z}")).collect::<Vec<_>>().join(","),
            ),
            ("csf_loss".into(), self.csf_loss.map_or_else(String::new, |share| share.to_string())),
            ("csf_speed_up".into(), self.csf_speed_up.to_string()),
            ("forbidden".into(), forbidden.join(",")),
            ("young_modulus_kpa".into(), self.young_kpa.to_string()),
            ("rate_hz".into(), self.rate_hz.to_string()),
            ("opening_needed".into(), self.opening_needed.to_string()),
            ("force_waits".into(), self.force_waits.to_string()),
        ]
    }
}

/// Reads the points of a recorded line; none if one of them is no point.
fn points(text: &str) -> Vec<[f32; 3]> {
    let point = |text: &str| {
        let numbers: Vec<f32> = text.split(' ').map_while(|number| number.parse().ok()).collect();
        <[f32; 3]>::try_from(numbers).ok()
    };
    text.split(',').map(point).collect::<Option<_>>().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn options_override_the_recording_and_the_recording_the_defaults() {
        let parse = |line: &str| Options::try_parse_from(line.split(' ')).unwrap();
        let script = DeviceName::scripted("flap");
        let usual = Operation::of(&parse("x"), &DeviceName::MOUSE, None);
        assert_eq!((usual.flap_mm, usual.csf_loss, &usual.forbidden[..]), (0.0, None, &[TissueClass::Vessel][..]));
        assert_eq!(Operation::of(&parse("x"), &script, None).flap_mm, SCRIPTED_FLAP_MM);
        let line = "x --flap 30 --forbid tumour,vessel --csf-loss 0 --csf-speed-up 10 --young-modulus-kpa 6 --rate-hz 500 --watch other";
        let drawn = Options { flap_line: vec![[1.5, -2.0, 0.1], [3.0, 4.0, 5.0]], ..parse(line) };
        let given = Operation::of(&drawn, &script, None);
        assert!(!given.opening_needed && usual.opening_needed);
        let mut recording = Recording::default();
        assert!(usual.force_waits && !Operation::of(&parse("x"), &script, Some(&recording)).force_waits);
        recording.header.config.extend(given.entries());
        assert_eq!(Operation::of(&parse("x"), &DeviceName::MOUSE, Some(&recording)), given);
        let round = Operation::of(&parse("x --flap 40"), &script, Some(&recording));
        assert!(round.flap_mm == 40.0 && round.flap_line.is_empty());
        let older = |line: &str| Operation::of(&parse(line), &script, Some(&recording)).csf_loss;
        assert_eq!((older("x"), older("x --fluid-lost 0.2")), (Some(0.0), Some(0.2)), "the flag of version 0.1");
        let lost = recording.header.config.remove("csf_loss").unwrap();
        recording.header.config.insert("fluid_lost".into(), lost);
        assert_eq!(Operation::of(&parse("x"), &script, Some(&recording)).csf_loss, Some(0.0), "the key of version 0.1");
        recording.header.config.insert("rate_hz".into(), "0".into());
        assert_eq!(
            Operation::of(&parse("x"), &script, Some(&recording)).rate_hz,
            RATE_HZ,
            "a rate out of range is ignored"
        );
    }
}
