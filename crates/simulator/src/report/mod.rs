//! Output files of a session: summary, scores, report page, drilled skull.

pub(crate) mod chart;
pub(crate) mod csv;
pub(crate) mod debrief;
pub(crate) mod drilled;
pub(crate) mod film;
pub(crate) mod kept;
pub(crate) mod output;
pub(crate) mod page;
pub(crate) mod regions;
pub(crate) mod sessions;
pub(crate) mod slicer;
pub(crate) mod summary;
pub(crate) mod ticks;
