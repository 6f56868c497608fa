//! Parts for a search in another crate: what it looks at, boxes, lists that never grow, the walk.

pub use crate::bounded::push_bounded;
pub use crate::extent::Extent;
pub use crate::narrow::{Hits, NONE};
pub use crate::phase::{BroadPhase, Indexed, Phased, PointIndex, box_of, indexed, list_finite};
pub use crate::scene::Scene;
pub use crate::search::walk::walk;
pub use crate::search::{Flood, Lost};
pub use crate::surface::{MovingSurface, distinct_rows};
