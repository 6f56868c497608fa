//! Values of the keys that a comparison runs beside the default.

use super::keys::{Effect, KEYS, Key, Part};
use trepan_budget::Quality;

/// A value of a key beside the default.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Name of the key.
    pub key: &'static str,
    /// Value.
    pub value: String,
    /// What the value may change.
    pub effect: Effect,
}

impl Variant {
    /// The argument of `--set`.
    pub fn setting(&self) -> String {
        format!("{}={}", self.key, self.value)
    }

    /// Whether it means nothing to another solver than `tled`.
    pub fn is_of_tled(&self) -> bool {
        KEYS.iter().any(|key| key.name == self.key && key.part == Part::Tled)
    }

    /// The same key with its usual value, where it has one.
    pub fn usual(&self) -> Option<Self> {
        let value = KEYS.iter().find(|key| key.name == self.key)?.usual?;
        Some(Self { value: value.into(), ..self.clone() })
    }
}

/// Every value to compare with the default: the table's keys in order, with the most telling value
/// of a key first.
pub fn variants() -> Vec<Variant> {
    let of_key = |key: &'static Key| {
        let variant = move |value: String| Variant { key: key.name, effect: (key.effect)(&value), value };
        (key.compared)().into_iter().map(variant)
    };
    KEYS.iter().flat_map(of_key).collect()
}

/// The values by which a quality differs from the usual, whatever the machine.
pub fn of_quality(quality: Quality) -> Vec<Variant> {
    let of_key = |key: &'static Key| {
        let value = key.in_quality(quality)?;
        Some(Variant { key: key.name, value: value.into(), effect: (key.effect)(value) })
    };
    KEYS.iter().filter_map(of_key).filter(|variant| variant.effect == Effect::Model).collect()
}

/// The values that physical realism asks for, of every key that has one.
pub fn realistic() -> Vec<Variant> {
    let of_key = |key: &&'static Key| {
        let value = key.realistic?;
        Some(Variant { key: key.name, value: value.into(), effect: (key.effect)(value) })
    };
    KEYS.iter().filter_map(|key| of_key(&key)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Ingredients, setting};
    use super::*;

    /// Without values stands what means nothing alone: points of a method without points.
    #[test]
    fn every_value_is_known_and_differs_from_the_default() {
        let all = variants();
        let without: Vec<&str> =
            KEYS.iter().map(|key| key.name).filter(|name| all.iter().all(|variant| variant.key != *name)).collect();
        assert_eq!(without, ["rigid-points"]);
        let method = Some(trepan_rigid::god_object_sphere::METHOD.name);
        let usual = Ingredients { rigid: method, ..Ingredients::of(Quality::Usual) };
        for variant in all.iter().chain(&realistic()) {
            let given = setting(&variant.setting()).unwrap().unwrap();
            let mut made = usual.clone();
            given.key.set(&mut made, &given.text).unwrap();
            assert_ne!(made, usual, "{}", variant.setting());
            assert_eq!(all.iter().filter(|other| *other == variant).count(), 1, "{} once", variant.setting());
        }
        assert_eq!(realistic().len(), 10);
    }

    #[test]
    fn what_auto_adds_is_what_its_ingredients_have() {
        let mut made = Ingredients::of(Quality::Usual);
        for variant in of_quality(Quality::Auto) {
            let given = setting(&variant.setting()).unwrap().unwrap();
            given.key.set(&mut made, &given.text).unwrap();
            assert_ne!(variant.usual().unwrap(), variant);
        }
        assert_eq!(Ingredients { device: made.device, ..Ingredients::of(Quality::Auto) }, made);
        assert_eq!(of_quality(Quality::Usual), []);
    }

    #[test]
    fn only_searches_threads_and_device_keep_the_result() {
        let kept = |variant: &&Variant| variant.effect != Effect::Model;
        let all = variants();
        assert!(all.iter().filter(kept).all(|variant| ["search", "threads", "device"].contains(&variant.key)));
        let of = |setting: &str| all.iter().find(|variant| variant.setting() == setting).map(|v| v.effect);
        assert_eq!(of("search=thesis"), Some(Effect::Model), "it measures depth by other faces");
        assert_eq!(of("search=hashed-grid"), Some(Effect::Rounding));
        assert_eq!(of("threads=2"), Some(Effect::Cost));
    }
}
