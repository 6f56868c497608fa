//! Names of entries in recordings made before 2026-11-29. Goes on 2027-06-01.

use std::borrow::Cow;
use std::collections::BTreeMap;
use trepan_models::ingredients::KEYS;

/// Entries of the operation and of the models' sizes.
const OPERATION: [&str; 9] = [
    "flap_mm",
    "flap_line",
    "csf_loss",
    "csf_speed_up",
    "forbidden",
    "young_modulus_kpa",
    "rate_hz",
    "opening_needed",
    "force_waits",
];
const SIZES: [&str; 5] = ["spacing_mm", "tets", "halvings", "picture_detail", "picture_sparse"];

/// The entries by the paths of today.
pub(super) fn renamed(config: &BTreeMap<String, String>) -> BTreeMap<Cow<'_, str>, Cow<'_, str>> {
    let is_old = !config.keys().any(|name| name.contains('.'));
    let one = |(name, text): (&'_ String, &'_ String)| (Cow::from(path(name)), Cow::from(value(name, text)));
    match is_old {
        true => config.iter().filter(|(_, text)| !text.is_empty()).map(one).collect(),
        false => config.iter().map(|(name, text)| (name.into(), text.into())).collect(),
    }
}

fn path(name: &str) -> String {
    let of_device = |name: &str| name.strip_prefix("device_").map(|limit| format!("device.{limit}"));
    if let Some(limit) = name.strip_prefix("second_").and_then(of_device) {
        return format!("second_{limit}");
    }
    if let Some(part) = name.strip_suffix("_why") {
        return format!("why.{part}");
    }
    let key = KEYS.iter().find(|key| key.name.replace('-', "_") == name);
    match (key, of_device(name)) {
        (Some(key), _) => format!("ingredients.{}", key.name),
        (None, Some(path)) => path,
        _ if OPERATION.contains(&name) => format!("operation.{name}"),
        _ if SIZES.contains(&name) => format!("sizes.{name}"),
        _ => name.into(),
    }
}

/// Lists were separated by commas, the numbers of a point by blanks.
fn value(name: &str, text: &str) -> String {
    let listed = |each: fn(&str) -> String| format!("[{}]", text.split(',').map(each).collect::<Vec<_>>().join(","));
    match name {
        "forbidden" => listed(|class| format!("\"{class}\"")),
        "flap_line" => listed(|point| format!("[{}]", point.replace(' ', ","))),
        _ => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use crate::config::SessionConfig;
    use trepan_link::wire::SessionHeader;
    use trepan_models::ingredients::Element;
    use trepan_patient::TissueClass;

    #[test]
    fn a_header_of_before_is_read_in_full() {
        let old = [
            ("quality", "auto"),
            ("tissue_why", "the cheapest"),
            ("spacing_mm", "0.85"),
            ("tets", "8000"),
            ("halvings", "4"),
            ("picture_sparse", "true"),
            ("element", "locking-free"),
            ("bone_friction", "0.3"),
            ("flap_line", "1.5 -2 0.1,3 4 5"),
            ("csf_loss", ""),
            ("forbidden", "tumour,vessel"),
            ("force_waits", "true"),
            ("device_peak_force_n", "3.3"),
            ("device_delay_ticks", "1"),
            ("second_device_scale", "0.5"),
        ];
        let config = old.map(|(name, text)| (name.to_string(), text.to_string())).into();
        let read = SessionConfig::of(&SessionHeader { config, ..SessionHeader::default() }).unwrap();
        assert_eq!((read.quality.as_str(), read.why.tissue.as_str()), ("auto", "the cheapest"));
        assert_eq!((read.sizes.spacing_mm, read.sizes.tets, read.sizes.halvings), (Some(0.85), Some(8000), Some(4)));
        assert_eq!((read.ingredients.element, read.ingredients.bone_friction), (Element::LockingFree, 0.3));
        assert_eq!(read.operation.flap_line, [[1.5, -2.0, 0.1], [3.0, 4.0, 5.0]]);
        assert_eq!(read.operation.forbidden, [TissueClass::Tumour, TissueClass::Vessel]);
        assert_eq!((read.operation.csf_loss, read.operation.force_waits), (None, true));
        assert_eq!((read.device.peak_force_n, read.device.delay_ticks), (3.3, 1));
        assert_eq!(read.second_device.unwrap().scale, 0.5);
    }
}
