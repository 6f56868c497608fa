//! Identifies the patient of a session by the hashes of the images.
//!
//! # Practice
//! The hash of a case changes with voxel size, tetrahedra and version; those of its images do not.
//! Recordings of older versions contain the case's hash only: then the name may identify the
//! patient, or the patient is unknown.

use crate::Inputs;
use crate::PatientError;
use crate::Recipe;
use crate::cache::digest_of_all;
use std::collections::BTreeMap;
use trepan_link::wire::SessionHeader;

/// Name prefix of users' own cases; digits of the hash follow.
pub const USERS: &str = "case-";
/// Key of the case's hash in a header.
const CASE: &str = "case";

/// Identity of a patient.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Identity {
    /// Name of the case; empty if unknown.
    pub name: String,
    /// Hash of the case built from the images, if known.
    pub case: Option<String>,
    /// Hash of each image, by `ct` and `mri`.
    pub images: BTreeMap<String, String>,
}

impl Identity {
    /// Reads the identity from a recording's header.
    pub fn of(header: &SessionHeader) -> Self {
        let mut images = header.hashes.clone();
        let case = images.remove(CASE);
        Self { name: header.case.clone(), case, images }
    }

    /// Whether both are of one patient; `None` if unknown.
    pub fn is(&self, other: &Self) -> Option<bool> {
        let mut shared =
            self.images.iter().filter_map(|(image, hash)| Some(other.images.get(image)? == hash)).peekable();
        if shared.peek().is_some() {
            return Some(shared.all(|same| same));
        }
        if self.case.is_some() && self.case == other.case {
            return Some(true);
        }
        match (self.built_in()?, other.built_in()?) {
            (true, true) => Some(self.name == other.name),
            (false, false) => None,
            _ => Some(false),
        }
    }

    /// Hashes for a recording's header.
    pub fn hashes(&self) -> BTreeMap<String, String> {
        let case = self.case.iter().map(|hash| (CASE.to_string(), hash.clone()));
        self.images.clone().into_iter().chain(case).collect()
    }

    fn built_in(&self) -> Option<bool> {
        let digits = |name: &str| name.strip_prefix(USERS).is_some_and(|d| d.bytes().all(|b| b.is_ascii_hexdigit()));
        (!self.name.is_empty()).then(|| !digits(&self.name))
    }

    /// Describes the identity: the name and the first digits of the images' hashes.
    pub fn describe(&self) -> String {
        let short = |hash: &str| hash.chars().take(8).collect::<String>();
        let images = self.images.iter().map(|(image, hash)| format!("{image} {}", short(hash)));
        let case = self.case.iter().map(|hash| format!("hash {}", short(hash)));
        let hashes: Vec<String> = if self.images.is_empty() { case.collect() } else { images.collect() };
        let name = if self.name == USERS { "the given images" } else { &self.name };
        format!("{name} ({})", hashes.join(", "))
    }
}

/// Hash of each of the patient's images, by `ct` and `mri`.
pub fn images(inputs: &Inputs, recipe: &Recipe) -> Result<BTreeMap<String, String>, PatientError> {
    let images = [("ct", &inputs.ct, recipe.ct_series), ("mri", &inputs.mri, recipe.mri_series)];
    let given = images.into_iter().filter_map(|(name, path, series)| Some((name, path.as_deref()?, series)));
    given.map(|(name, path, series)| Ok((name.into(), digest_of_all(&format!("{series:?}"), &[path])?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(name: &str, case: &str, images: &[(&str, &str)]) -> Identity {
        let images = images.iter().map(|(image, hash)| (image.to_string(), hash.to_string())).collect();
        Identity { name: name.into(), case: (!case.is_empty()).then(|| case.into()), images }
    }

    #[test]
    fn images_identify_patients_and_older_recordings_may_not() {
        let fine = known("case-1", "1", &[("ct", "a"), ("mri", "b")]);
        assert_eq!(fine.is(&known("case-2", "2", &[("ct", "a"), ("mri", "b")])), Some(true), "another voxel size");
        assert_eq!(fine.is(&known("case-3", "3", &[("ct", "a")])), Some(true), "drilled only");
        assert_eq!(fine.is(&known("case-4", "4", &[("ct", "a"), ("mri", "c")])), Some(false));
        let old = known("case-5", "5", &[]);
        assert_eq!((old.is(&fine), old.is(&known("case-6", "6", &[])), old.is(&old)), (None, None, Some(true)));
        assert_eq!(known("case-head", "7", &[]).is(&known("case-head", "8", &[])), Some(true), "built in");
        assert_eq!(known("case-head", "7", &[]).is(&old), Some(false));
        assert_eq!(known("", "", &[]).is(&old), None);
        assert!(fine.describe().contains("case-1 (ct a, mri b)") && old.describe().contains("hash 5"));
    }
}
