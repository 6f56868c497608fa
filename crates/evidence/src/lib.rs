//! What runs any suite: parts, rows, limits, charts, maps, kept boundaries, comparison, page.

pub mod borders;
pub mod compare;
pub mod curve;
mod figure;
pub mod files;
pub mod front;
pub mod limits;
pub mod memory;
pub mod nearest;
pub mod page;
pub mod part;
pub mod picture;
pub mod plot;
pub mod repeat;
pub mod report;
pub mod row;
pub mod store;
pub mod suite;
pub mod timer;
pub mod worst;
