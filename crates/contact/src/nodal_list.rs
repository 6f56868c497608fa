//! All springs that press on one body at once: tip, shaft, walls, its own folds.
//!
//! # Practice
//! Holds at most [`MAX_SPRINGS`] springs and [`MAX_PLANES`] planes; what does not fit is counted.
//! Memory is taken once, for all of them, so that after [`with_room`](NodalContacts::with_room)
//! neither [`push`](NodalContacts::push) nor [`copy_from`](NodalContacts::copy_from) allocates, and
//! a copy costs what is in use.

use crate::{NodalContact, PlaneContact};
use core::ops::{Deref, DerefMut};
use trepan_geometry::Vec3;

/// Most springs on one body: the places under a tool's tip, its shaft, and what touches a fold.
pub const MAX_SPRINGS: usize = 512;
/// Most planes on one body: one for each border node near a wall.
pub const MAX_PLANES: usize = 8192;

/// A list of springs, read as a slice, and of planes beside them.
#[derive(Debug, Default, PartialEq)]
pub struct NodalContacts {
    springs: Vec<NodalContact>,
    planes: Vec<PlaneContact>,
    /// Springs and planes that did not fit.
    pub overflow: u32,
}

impl NodalContacts {
    /// No spring, and no memory yet.
    pub fn none() -> Self {
        Self::default()
    }

    /// No spring, and memory for all that may come.
    pub fn with_room() -> Self {
        let planes = Vec::with_capacity(MAX_PLANES);
        Self { springs: Vec::with_capacity(MAX_SPRINGS), planes, overflow: 0 }
    }

    /// Adds a spring that presses on a node; counts one that does not fit.
    pub fn push(&mut self, spring: NodalContact) {
        if !spring.is_empty() {
            self.overflow += push_bounded(&mut self.springs, MAX_SPRINGS, spring);
        }
    }

    /// Adds the plane of a node that has none yet; counts one that does not fit.
    pub fn push_plane(&mut self, plane: PlaneContact) {
        self.overflow += push_bounded(&mut self.planes, MAX_PLANES, plane);
    }

    /// The planes, each of another node.
    pub fn planes(&self) -> &[PlaneContact] {
        &self.planes
    }

    /// Springs, then planes in the form of springs: for solvers without a way of their own for
    /// planes.
    pub fn all(&self) -> impl Iterator<Item = NodalContact> + '_ {
        self.springs.iter().copied().chain(self.planes.iter().map(|plane| (*plane).into()))
    }

    /// Back to no spring, counter included.
    pub fn clear(&mut self) {
        self.springs.clear();
        self.planes.clear();
        self.overflow = 0;
    }

    /// Moves each spring with its tool by a time, ms: tools go on between two collision results.
    pub fn follow_tool(&mut self, dt_ms: f32) {
        self.springs.iter_mut().for_each(|spring| spring.offset_mm -= dt_ms * spring.tool_normal_velocity);
    }

    /// Stops the tools where they are now.
    pub fn stop_tool(&mut self) {
        self.springs.iter_mut().for_each(|spring| {
            (spring.tool_normal_velocity, spring.lateral_velocity) = (0.0, Vec3::ZERO);
        });
    }

    /// Becomes what `other` is.
    pub fn copy_from(&mut self, other: &Self) {
        self.clear();
        self.springs.reserve_exact(MAX_SPRINGS);
        self.springs.extend_from_slice(&other.springs);
        if !other.planes.is_empty() {
            self.planes.reserve_exact(MAX_PLANES);
            self.planes.extend_from_slice(&other.planes);
        }
        self.overflow = other.overflow;
    }
}

/// Adds an item to a list of at most `most`, whose memory is taken once; returns 1 when it does not
/// fit.
fn push_bounded<T>(list: &mut Vec<T>, most: usize, item: T) -> u32 {
    if list.len() >= most {
        return 1;
    }
    list.reserve_exact(most - list.len());
    list.push(item);
    0
}

impl Clone for NodalContacts {
    fn clone(&self) -> Self {
        let mut springs = Vec::with_capacity(self.springs.capacity());
        springs.extend_from_slice(&self.springs);
        let mut planes = Vec::with_capacity(self.planes.capacity());
        planes.extend_from_slice(&self.planes);
        Self { springs, planes, overflow: self.overflow }
    }

    fn clone_from(&mut self, other: &Self) {
        self.copy_from(other);
    }
}

impl From<NodalContact> for NodalContacts {
    fn from(spring: NodalContact) -> Self {
        Self { springs: vec![spring], ..Self::none() }
    }
}

impl Deref for NodalContacts {
    type Target = [NodalContact];

    fn deref(&self) -> &[NodalContact] {
        &self.springs
    }
}

impl DerefMut for NodalContacts {
    fn deref_mut(&mut self) -> &mut [NodalContact] {
        &mut self.springs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_holds_so_many_counts_the_rest_and_moves_no_memory() {
        let mut spring = NodalContact::none();
        let mut list = NodalContacts::with_room();
        list.push(spring);
        assert!(list.is_empty());
        spring.add(3, 1.0);
        let place = list.as_ptr();
        (0..MAX_SPRINGS + 5).for_each(|_| list.push(spring));
        assert_eq!((list.len(), list.overflow, list.as_ptr()), (MAX_SPRINGS, 5, place));
        let mut copy = NodalContacts::with_room();
        let place = copy.as_ptr();
        copy.clone_from(&list);
        assert_eq!((&copy, copy.overflow, copy.as_ptr()), (&list, 5, place));
        copy.clear();
        assert_eq!((copy.len(), copy.overflow), (0, 0));
        let place = copy.planes.as_ptr();
        let plane = |node| PlaneContact { node, ..PlaneContact::default() };
        (0..MAX_PLANES as u32 + 3).for_each(|node| copy.push_plane(plane(node)));
        assert_eq!((copy.planes().len(), copy.overflow, copy.planes.as_ptr()), (MAX_PLANES, 3, place));
        copy.push(spring);
        assert_eq!((copy.len(), copy.all().count()), (1, 1 + MAX_PLANES));
        list.copy_from(&copy);
        assert_eq!(list, copy);
        list.copy_from(&NodalContacts::none());
        assert!(list.planes().is_empty());
        assert_eq!(NodalContacts::from(spring)[0], spring);
    }
}
