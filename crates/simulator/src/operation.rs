//! What the operation is: flap, fluid lost, what must not be touched. From the options, else from the recording that is run again, else the usual.

use crate::case::tissue::TissueClass;
use crate::options::Options;
use trepan_haptics::DeviceName;
use trepan_link::Recording;

/// Diameter of the flap that the script of that name cuts when none is asked for, mm.
const SCRIPTED_FLAP_MM: f32 = 24.0;
/// Share of the fluid's lift that is lost when the dura is opened.
const FLUID_LOST: f32 = 0.05;

/// Settings of an operation.
#[derive(Clone, Debug, PartialEq)]
pub struct Operation {
    /// Diameter of the planned flap, mm; 0 for a burr hole alone.
    pub flap_mm: f32,
    /// Share of the lift of the brain's fluid that is lost when the dura is opened, 0 to 1.
    pub fluid_lost: f32,
    /// Tissue that no tool may come close to.
    pub forbidden: Vec<TissueClass>,
}

impl Operation {
    /// From the options; what they leave open from the recording, if one is run again.
    pub fn of(options: &Options, device: &DeviceName, recording: Option<&Recording>) -> Self {
        let recorded = |key: &str| recording?.header.config.get(key);
        let number = |key: &str| recorded(key)?.parse::<f32>().ok().filter(|value| value.is_finite());
        let scripted = matches!(device, DeviceName::Script(name) | DeviceName::Simulated(name) if name == "flap");
        let flap = options.flap.or_else(|| number("flap_mm")).or(scripted.then_some(SCRIPTED_FLAP_MM));
        let listed = || {
            let names = recorded("forbidden")?;
            Some(names.split(',').filter_map(TissueClass::named).collect())
        };
        Self {
            flap_mm: flap.unwrap_or(0.0),
            fluid_lost: options.fluid_lost.or_else(|| number("fluid_lost")).unwrap_or(FLUID_LOST),
            forbidden: options.forbid.clone().or_else(listed).unwrap_or_else(|| vec![TissueClass::Vessel]),
        }
    }

    /// As a recording keeps it.
    pub fn entries(&self) -> [(String, String); 3] {
        let forbidden: Vec<&str> = self.forbidden.iter().map(|class| class.name()).collect();
        [
            ("flap_mm".into(), self.flap_mm.to_string()),
            ("fluid_lost".into(), self.fluid_lost.to_string()),
            ("forbidden".into(), forbidden.join(",")),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn options_come_before_the_recording_and_that_before_the_usual() {
        let parse = |line: &str| Options::try_parse_from(line.split(' ')).unwrap();
        let script = DeviceName::Script("flap".into());
        let usual = Operation::of(&parse("x"), &DeviceName::Mouse, None);
        assert_eq!(
            (usual.flap_mm, usual.fluid_lost, &usual.forbidden[..]),
            (0.0, FLUID_LOST, &[TissueClass::Vessel][..])
        );
        assert_eq!(Operation::of(&parse("x"), &script, None).flap_mm, SCRIPTED_FLAP_MM);
        let asked = Operation::of(&parse("x --flap 30 --forbid tumour,vessel --fluid-lost 0"), &script, None);
        let mut recording = Recording::default();
        recording.header.config.extend(asked.entries());
        assert_eq!(Operation::of(&parse("x"), &DeviceName::Mouse, Some(&recording)), asked);
        assert_eq!(Operation::of(&parse("x --flap 40"), &script, Some(&recording)).flap_mm, 40.0);
    }
}
