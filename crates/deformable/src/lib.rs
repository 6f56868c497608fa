//! A tool's ball against a moving tetrahedral mesh: which points are inside, how deep, and what pushes back.

pub mod broad;
mod config;
mod method;
mod narrow;
mod response;
mod scene;
mod search;
mod step;
mod surface;
mod triangle;

pub use broad::BroadPhase;
pub use config::{Config, ConfigError};
pub use method::Method;
pub use response::Response;
pub use step::{TissueCollision, TissueStep};
