//! From a patient's files to the operating table.

pub(crate) mod cache;
pub(crate) mod folder;
pub(crate) mod import;
pub(crate) mod scene;
pub(crate) mod site;
