//! What is left of a session: summary, page, files.

pub(crate) mod against;
pub(crate) mod chart;
pub(crate) mod drilled;
pub(crate) mod output;
pub(crate) mod page;
pub(crate) mod regions;
pub(crate) mod summary;
