//! Tetrahedral and triangle meshes: validity, topology, quality, generation from a mask, and file
//! formats.
//!
//! # Theory
//! A [`TetMesh`] is two arrays: vertices and corner indices. Everything else is derived when
//! needed: [`Topology`] (face neighbours, tetrahedra of a node), [`Surface`] (boundary triangles),
//! [`Quality`] (angles, volumes, edges). [`lattice`] fills a binary mask or a label volume with
//! tetrahedra by isosurface stuffing (Labelle and Shewchuk 2007), with bounded angles for cubes of
//! one size.
//!
//! # Practice
//! World mm, patient RAS+. Everything here runs when a case is loaded, never in a tick. Equal input
//! gives bit-identical results on any machine.
//!
//! ```
//! use trepan_geometry::Vec3;
//! use trepan_mesh::{Surface, lattice};
//! use trepan_volume::VoxelVolume;
//!
//! let mut ball = VoxelVolume::isotropic([24, 24, 24], Vec3::splat(-11.5), 1.0, 0u8);
//! for at in 0..ball.data.len() {
//!     let centre = ball.centre_of([at % 24, at / 24 % 24, at / 576]);
//!     ball.data[at] = u8::from(centre.length() < 9.0);
//! }
//! let config = lattice::Config { target_tets: 2000, ..Default::default() };
//! let mesh = lattice::tetrahedra(&ball, &config)?;
//! assert!(mesh.check().is_ok() && Surface::of(&mesh).is_closed());
//! # Ok::<(), trepan_mesh::MeshError>(())
//! ```

mod check;
mod file;
mod isosurface;
pub mod lattice;
pub mod materials;
mod nets;
mod quality;
mod split;
mod surface;
mod tets;
mod topology;
mod triangles;

pub use check::MeshError;
pub use file::{
    FileError, Format, Import, Note, SURFACE_FORMATS, VOLUME_FORMATS, abaqus, gmsh, import, import_among,
    import_surface, medit, obj, ply, read, read_among, read_surface, stl, tetgen, vtk, vtu, write, write_among,
    write_surface,
};
pub use isosurface::isosurface;
pub use nets::surface_nets;
pub use quality::Quality;
pub use split::{Split, Splitter};
pub use surface::Surface;
pub use tets::{FACES, OPPOSITE, TetMesh};
pub use topology::{Csr, NONE, Topology};
pub use triangles::TriMesh;

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
