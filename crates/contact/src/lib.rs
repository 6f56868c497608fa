//! Contact as plain data, what force it makes, and the guard that stands before every hand.
//!
//! # Theory
//! A collision method fills a [`ContactManifold`]; a [`ForceModel`] turns it into the wrench that
//! the scene wants; the [`ForceGuard`] turns that into the wrench that a hand may get. Only the
//! guard makes a non-zero [`GuardedWrench`] and devices take nothing else, so that no path of the
//! program can go round it.
//!
//! ```text
//! pose → collision → ContactManifold → ForceModel → Wrench → ForceGuard → GuardedWrench → device
//! ```
//!
//! # Practice
//! Everything here is plain data of fixed size: no allocation, lock or clock, well under a
//! microsecond a tick. Units are mm, ms, g, hence N, N/mm and N ms/mm.
//!
//! ```
//! use trepan_contact::{Contact, ContactManifold, ForceGuard, ForceModel};
//! use trepan_contact::{GuardConfig, Viscoelastic};
//! use trepan_geometry::{Pose, ToolState, Vec3};
//!
//! let mut model = Viscoelastic { stiffness: 2.0, damping: 1.0 };
//! let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..GuardConfig::default() });
//! let contact = Contact { normal: Vec3::Z, depth_mm: 0.5, point: Vec3::ZERO };
//! let manifold = ContactManifold::single(contact);
//! let tool = ToolState::at(Pose::IDENTITY);
//! for _ in 0..5 {
//!     guard.guard(model.wrench(&tool, &manifold, 1.0), &tool, 1.0);
//! }
//! let wrench = guard.guard(model.wrench(&tool, &manifold, 1.0), &tool, 1.0);
//! assert!((wrench.force() - Vec3::Z).length() < 1e-6);
//! ```
//!
//! # When not to use it
//! For multibody dynamics: there is one tool, and one wrench at its tip.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

mod force;
mod friction;
mod god_object;
mod guard;
mod hooke;
mod manifold;
mod nodal;
mod nodal_list;
mod passivity;
mod patch;
mod plane;
mod shading;
mod vibration;
mod viscoelastic;

pub use force::ForceModel;
pub use friction::Friction;
pub use god_object::{GodObject, Plane};
pub use guard::{ForceGuard, GuardConfig, GuardCounters, GuardedWrench};
pub use hooke::Hooke;
pub use manifold::{Contact, ContactManifold, MAX_CONTACTS};
pub use nodal::{MAX_NODES, NodalContact};
pub use nodal_list::{MAX_PLANES, MAX_SPRINGS, NodalContacts};
pub use passivity::{PassivityConfig, PassivityObserver};
pub use patch::SurfacePatch;
pub use plane::PlaneContact;
pub use shading::ForceShading;
pub use vibration::Vibration;
pub use viscoelastic::Viscoelastic;
