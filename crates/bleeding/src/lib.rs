//! Blood on a wound in moving tetrahedra: where it comes from, where it flows, what stops it.
//!
//! # Theory
//! Where a tetrahedron is taken away, the faces that come to light bleed: capillaries by area, and
//! here and there a vessel. A source falls off linearly until it stops by itself; heat stops it
//! early. Blood and saline lie on border triangles and flow across their edges as a thin film
//! (lubrication, Reynolds 1886), downhill and from deep to shallow:
//!
//! ```text
//! H = height + V / A'        q = (ρ g / 3μ) h³ (H_i - H_j) / d · L      h = V / A' - residue
//! ```
//! with A' the triangle's area as seen from above, d the distance of the middles and L the edge.
//! What flows in a step is at most a third of what levels the pair out, so that no step overshoots
//! however deep the film.
//!
//! # Practice
//! Volumes are whole picolitres: what bled and rinsed is what lies there and what was sucked away,
//! to the last one ([`Account`]). Ten steps make a turn; a step costs some 20 ns a wet triangle. It
//! does not allocate, and the same calls give the same bytes. The film puts no force on the tissue.
//! Constants are rows of `fixtures/measurements/bleeding.csv`, most of them uncalibrated.
//!
//! # When not to use it
//! For jets, drops and clots; for fluid that fills a hollow to its roof.

mod border;
mod film;
mod wound;

pub use border::Border;
pub use film::{Account, Film};
pub use wound::{Act, Perfusion, Wound};

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct ReadmeExample;
