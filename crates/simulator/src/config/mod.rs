//! Everything that a session's forces depend on, as one value that its recording keeps.
//!
//! # Practice
//! The header of a recording holds one entry for each leaf of [`SessionConfig`], named by its path:
//! `operation.flap_mm`, `ingredients.element`, `device.scale`. A leaf that is missing has its
//! default, so a setting that is added must default to what ran before it; entries without a field
//! are left alone. [`old_header`] reads the headers of before 2026-11-29.

mod old_header;

use crate::device_limits::DeviceLimits;
use crate::error::SessionError;
use crate::operation::Operation;
use crate::options::{ASPIRATIONS_MM_S, BLEEDINGS, CSF_SPEED_UPS, MODULI_KPA, RATES_HZ};
use serde::{Deserialize, Serialize};
use serde_json::{Number, Value};
use std::borrow::Cow;
use std::collections::BTreeMap;
use trepan_link::wire::SessionHeader;
use trepan_models::ingredients::Ingredients;
use trepan_models::measure::Parts;
use trepan_stages::force_scale::ForceScale;

/// Everything that a session's forces depend on, with the reasons for its models.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct SessionConfig {
    /// Source of the models: the name of a quality, or `replay`.
    pub quality: String,
    /// Reasons for the models.
    pub why: Parts<String>,
    /// Name of the tissue solver that ran.
    pub solver_run: String,
    /// Sizes of the models.
    pub sizes: Sizes,
    /// What the models are made of.
    pub ingredients: Ingredients,
    /// Settings of the operation.
    pub operation: Operation,
    /// Limits of the first hand's device.
    pub device: DeviceLimits,
    /// Limits of the second hand's device.
    pub second_device: Option<DeviceLimits>,
}

/// Sizes of a session's models; `None` where they were not recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Sizes {
    /// Edge of a skull voxel, mm.
    pub spacing_mm: Option<f64>,
    /// Number of tetrahedra.
    pub tets: Option<usize>,
    /// Halvings of the edge length at the opening, 0 to 4.
    pub halvings: Option<u32>,
    /// Resolution of the picture along an edge, as a share of the full one.
    pub picture_detail: Option<f64>,
    /// Whether rays are skipped where bone is smooth.
    pub picture_sparse: bool,
}

impl SessionConfig {
    /// Entries of a recording's header.
    pub fn entries(&self) -> BTreeMap<String, String> {
        let mut out = BTreeMap::new();
        flatten(&to_value(self), String::new(), &mut out);
        out
    }

    /// Refuses a recorded number that no flag allows.
    fn check(&self) -> Result<(), String> {
        let Sizes { spacing_mm, halvings, .. } = self.sizes;
        let second = self.second_device.clone().unwrap_or_default();
        let of_flags = |mm: f64| mm as f32;
        let ranges = [
            ("operation.flap_mm", self.operation.flap_mm, [0.0, 90.0]),
            ("operation.csf_loss", self.operation.csf_loss.unwrap_or(0.0), [0.0, 1.0]),
            ("operation.csf_speed_up", self.operation.csf_speed_up, CSF_SPEED_UPS.map(of_flags)),
            ("operation.young_modulus_kpa", self.operation.young_modulus_kpa, MODULI_KPA.map(of_flags)),
            ("operation.aspiration_mm_s", self.operation.aspiration_mm_s, ASPIRATIONS_MM_S.map(of_flags)),
            ("operation.bleeding", self.operation.bleeding, BLEEDINGS.map(of_flags)),
            ("operation.rate_hz", self.operation.rate_hz, RATES_HZ.map(of_flags)),
            ("sizes.spacing_mm", spacing_mm.map_or(1.0, of_flags), [0.2, 4.0]),
            ("sizes.halvings", halvings.unwrap_or(0) as f32, [0.0, 4.0]),
            ("device.scale", self.device.scale, [0.2, 5.0]),
            ("device.force_scale", self.device.force_scale, ForceScale::RANGE.map(of_flags)),
            ("second_device.scale", second.scale, [0.2, 5.0]),
            ("second_device.force_scale", second.force_scale, ForceScale::RANGE.map(of_flags)),
        ];
        match ranges.into_iter().find(|(_, value, [low, high])| !(low..=high).contains(&value)) {
            None => Ok(()),
            Some((path, value, [low, high])) => Err(format!("{path} is {value}, out of {low} to {high}")),
        }
    }

    /// Reads a recording's header.
    ///
    /// # Errors
    /// If an entry is not a value of its field.
    pub fn of(header: &SessionHeader) -> Result<Self, SessionError> {
        let entries = old_header::renamed(&header.config);
        let filled = |entries: &mut dyn Iterator<Item = (&Cow<'_, str>, &Cow<'_, str>)>| {
            let mut value = to_value(&Self::default());
            entries.for_each(|(path, text)| fill(&mut value, path, text));
            serde_json::from_value::<Self>(value)
        };
        let read = filled(&mut entries.iter()).map_err(|fault| {
            let alone = entries.iter().find(|entry| filled(&mut [*entry].into_iter()).is_err());
            format!("{}: {fault}", alone.map_or("", |(path, _)| path))
        });
        let read = read.and_then(|config| config.check().map(|()| config));
        read.map_err(|fault| {
            let remedy = "run the version that made it, or record again";
            SessionError::Usage(format!("the session's header cannot be read: {fault}; {remedy}"))
        })
    }
}

fn to_value(config: &SessionConfig) -> Value {
    serde_json::to_value(config).unwrap_or_default()
}

/// Writes the leaves below a path; empty ones are left out.
fn flatten(value: &Value, path: String, out: &mut BTreeMap<String, String>) {
    let text = match value {
        Value::Object(fields) => {
            let below = |name: &str| if path.is_empty() { name.into() } else { format!("{path}.{name}") };
            return fields.iter().for_each(|(name, value)| flatten(value, below(name), out));
        }
        Value::Null => return,
        Value::String(text) => text.clone(),
        other => leaf(other),
    };
    out.insert(path, text);
}

/// JSON of a value without named fields, its numbers as the shortest decimals.
fn leaf(value: &Value) -> String {
    match value {
        Value::Number(number) => decimal(number),
        Value::Array(values) => format!("[{}]", values.iter().map(leaf).collect::<Vec<_>>().join(",")),
        other => other.to_string(),
    }
}

/// The shortest decimal of a number: 0.1 also where it came from an `f32`.
fn decimal(number: &Number) -> String {
    let short = number.as_f64().filter(|_| number.is_f64()).map(|wide| (wide, wide as f32));
    let short = short.filter(|(wide, short)| f64::from(*short) == *wide).map(|(_, short)| short.to_string());
    short.unwrap_or_else(|| number.to_string())
}

/// Sets the leaf at a path: text where the default is text, else what it says as JSON. A path that
/// the default lacks is left alone, so the depth is bounded.
fn fill(value: &mut Value, path: &str, text: &str) {
    let Value::Object(fields) = value else { return };
    let (name, rest) = path.split_once('.').map_or((path, None), |(name, rest)| (name, Some(rest)));
    match (fields.get_mut(name), rest) {
        (None, _) => {}
        (Some(below), Some(rest)) => {
            if below.is_null() && name == "second_device" {
                *below = serde_json::to_value(DeviceLimits::default()).unwrap_or_default();
            }
            fill(below, rest, text);
        }
        (Some(leaf), None) => {
            // JSON's own reader may be off by the last bit.
            let exact = || Number::from_f64(text.parse().ok().filter(|_| text.contains('.'))?).map(Value::Number);
            let read = || exact().or_else(|| serde_json::from_str(text).ok());
            let read = Some(()).filter(|()| !leaf.is_string()).and_then(|()| read());
            *leaf = read.unwrap_or_else(|| Value::String(text.into()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_budget::Quality;
    use trepan_patient::TissueClass;

    fn read(config: BTreeMap<String, String>) -> Result<SessionConfig, SessionError> {
        SessionConfig::of(&SessionHeader { config, ..SessionHeader::default() })
    }

    /// A session in which no field has its default.
    fn unusual(number: f32, share: f64) -> SessionConfig {
        let device = DeviceLimits { peak_force_n: number, delay_ticks: 3, scale: 0.7, ..DeviceLimits::default() };
        SessionConfig {
            quality: "auto".into(),
            why: Parts { bone: "12".into(), tissue: "the cheapest".into(), picture: "0.5 %".into() },
            solver_run: "tled".into(),
            sizes: Sizes {
                spacing_mm: Some(share),
                tets: Some(8000),
                halvings: Some(4),
                picture_detail: Some(0.3),
                picture_sparse: true,
            },
            ingredients: Ingredients { friction: number, threads: Some(2), ..Ingredients::of(Quality::Fine) },
            operation: Operation {
                flap_mm: number,
                flap_line: vec![[1.5, -2.0, number], [3.0, 4.0, 5.0]],
                csf_loss: Some(0.3),
                forbidden: vec![TissueClass::Tumour, TissueClass::Vessel],
                opening_needed: false,
                force_waits: false,
                ..Operation::default()
            },
            device: device.clone(),
            second_device: Some(DeviceLimits { force_scale: 0.1, ..device }),
        }
    }

    #[test]
    fn what_is_written_is_read_to_the_last_bit() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..500 {
            let config = unusual(random.f32(), 0.2 + (random.f64() * 1e3).round() / 1e3);
            assert_eq!(read(config.entries()).unwrap(), config);
        }
    }

    #[test]
    fn leaves_are_named_by_their_path_and_missing_ones_have_their_default() {
        let entries = unusual(0.1, 0.85).entries();
        let of = |path: &str| entries[path].as_str();
        assert_eq!((of("operation.flap_mm"), of("device.scale"), of("sizes.spacing_mm")), ("0.1", "0.7", "0.85"));
        assert_eq!((of("ingredients.friction"), of("why.bone")), ("0.1", "12"));
        assert_eq!(of("operation.flap_line"), "[[1.5,-2,0.1],[3,4,5]]");
        assert_eq!(of("operation.forbidden"), "[\"tumour\",\"vessel\"]");
        assert_eq!(read(BTreeMap::new()).unwrap(), SessionConfig::default());
        let deep = "a.".repeat(200_000);
        let unknown = [("operation.blood_ml", "3"), ("rooms", "x"), ("ingredients.viscosity", "3"), (&deep, "3")];
        let unknown = unknown.map(|(path, text)| (path.to_string(), text.to_string())).into();
        assert_eq!(read(unknown).unwrap(), SessionConfig::default());
        let bad = [
            ("operation.rate_hz", "0"),
            ("operation.flap_mm", "wide"),
            ("operation.flap_mm", "91"),
            ("sizes.tets", "-1"),
            ("device.force_scale", "0"),
            ("second_device.scale", "9"),
        ];
        for (path, text) in bad {
            let fault = read(BTreeMap::from([(path.into(), text.into())])).unwrap_err().to_string();
            assert!(fault.contains("header cannot be read") && fault.contains(text) && fault.contains(path), "{fault}");
        }
    }
}
