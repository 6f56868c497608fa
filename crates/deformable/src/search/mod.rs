//! The searches behind [`Method`](crate::Method): each fills, for every tool point, the tetrahedron
//! that holds it.

mod brute;
mod degenerate;
mod flood;
mod lost;
mod phased;
mod thesis;
mod walk;

pub(crate) use walk::Walk;

use crate::broad::*;
use crate::{Method, narrow::Hits, scene::Scene, surface::MovingSurface};
use trepan_mesh::TetMesh;

/// One search with its memory.
pub(crate) enum Search {
    Brute(brute::Brute),
    Phased(phased::Phased),
    Thesis(thesis::Thesis),
    Walk(Walk),
}

impl Search {
    pub(crate) fn new(method: Method, mesh: &TetMesh, points: usize, cell_mm: f32) -> Self {
        let tets = mesh.tets.len();
        match method {
            Method::Brute => Self::Brute(brute::Brute),
            Method::Scan => phased(UniformGrid::new(f32::MAX, points, tets), points),
            Method::UniformGrid => phased(UniformGrid::new(cell_mm, points, tets), points),
            Method::HashedGrid => phased(HashedGrid::new(cell_mm, points, tets), points),
            Method::Octree => phased(Octree::new(points, tets), points),
            Method::KdTree => phased(KdTree::new(points, tets), points),
            Method::AabbTree => phased(tree::<Aabox>(mesh), points),
            Method::SphereTree => phased(tree::<Sphere>(mesh), points),
            Method::KDopTree => phased(tree::<KDop>(mesh), points),
            Method::ObbTree => phased(tree::<Obb>(mesh), points),
            Method::HybridTree => phased(HybridTree::new(&mesh.positions, &mesh.tets), points),
            #[cfg(feature = "parry")]
            Method::ParryTree => phased(ParryTree::new(&mesh.positions, &mesh.tets), points),
            Method::Thesis => Self::Thesis(thesis::Thesis::new(cell_mm, points, tets)),
            Method::Walk => Self::Walk(Walk::new(points, tets)),
        }
    }

    /// Fills `hits` for the scene's points.
    pub(crate) fn find(&mut self, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits) {
        match self {
            Self::Brute(search) => search.find(scene, hits),
            Self::Phased(search) => search.find(scene, hits),
            Self::Thesis(search) => search.find(scene, hits),
            Self::Walk(search) => search.find(scene, surface, hits),
        }
    }

    /// Forgets where the tool was.
    pub(crate) fn reset(&mut self) {
        match self {
            Self::Brute(_) | Self::Phased(_) => {}
            Self::Thesis(search) => search.reset(),
            Self::Walk(search) => search.reset(),
        }
    }
}

fn tree<V: Volume>(mesh: &TetMesh) -> VolumeTree<V> {
    VolumeTree::new(&mesh.positions, &mesh.tets)
}

fn phased(phase: impl BroadPhase + 'static, points: usize) -> Search {
    Search::Phased(phased::Phased::new(phase, points))
}
