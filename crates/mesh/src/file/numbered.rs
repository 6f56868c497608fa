//! Maps a file's node numbers to indices: from 1, with gaps, in any order.

use crate::file::{FileError, Reader};
use trepan_geometry::Vec3;

/// Nodes in file order, with a map from number to index.
#[derive(Default)]
pub(crate) struct Numbered {
    pub(crate) positions: Vec<Vec3>,
    places: Vec<(u64, u32)>,
}

impl Numbered {
    pub(crate) fn push(&mut self, number: u64, position: Vec3) {
        self.places.push((number, self.positions.len() as u32));
        self.positions.push(position);
    }

    /// Call once after the last [`push`](Self::push).
    pub(crate) fn sort(&mut self, reader: &Reader) -> Result<(), FileError> {
        self.places.sort_unstable();
        let twice = self.places.windows(2).find(|w| w[0].0 == w[1].0);
        twice.map_or(Ok(()), |w| Err(reader.error(format!("node {}", w[0].0), "there twice", "there once")))
    }

    /// The indices of four node numbers.
    pub(crate) fn corners(&self, reader: &Reader, tet: usize, numbers: [u64; 4]) -> Result<[u32; 4], FileError> {
        let place = |number: u64| self.places.binary_search_by_key(&number, |p| p.0).ok().map(|at| self.places[at].1);
        let missing =
            || reader.error(format!("tetrahedron {tet}"), format!("{numbers:?}"), "of nodes that are in the file");
        let [a, b, c, d] = numbers.map(place);
        Ok([a.ok_or_else(missing)?, b.ok_or_else(missing)?, c.ok_or_else(missing)?, d.ok_or_else(missing)?])
    }
}
