//! All springs that press on one body at once: tip, shaft, walls, its own folds.
//!
//! # Practice
//! Holds at most [`MAX_SPRINGS`]; what does not fit is counted. Memory is taken once, for all of them, so that after
//! [`with_room`](NodalContacts::with_room) neither [`push`](NodalContacts::push) nor [`copy_from`](NodalContacts::copy_from) allocates, and a copy costs what is in use.

use crate::NodalContact;
use core::ops::{Deref, DerefMut};

/// Most springs on one body: the places under a tool's tip, its shaft, and the patches that touch a wall or a fold.
pub const MAX_SPRINGS: usize = 256;

/// A list of springs, read as a slice.
#[derive(Debug, Default, PartialEq)]
pub struct NodalContacts {
    springs: Vec<NodalContact>,
    /// Springs that did not fit.
    pub overflow: u32,
}

impl NodalContacts {
    /// No spring, and no memory yet.
    pub fn none() -> Self {
        Self::default()
    }

    /// No spring, and memory for all that may come.
    pub fn with_room() -> Self {
        Self { springs: Vec::with_capacity(MAX_SPRINGS), overflow: 0 }
    }

    /// Adds a spring that presses on a node; counts one that does not fit.
    pub fn push(&mut self, spring: NodalContact) {
        if spring.is_empty() {
            return;
        }
        match self.springs.len() < MAX_SPRINGS {
            true => {
                self.springs.reserve_exact(MAX_SPRINGS - self.springs.len());
                self.springs.push(spring);
            }
            false => self.overflow += 1,
        }
    }

    /// Back to no spring, counter included.
    pub fn clear(&mut self) {
        self.springs.clear();
        self.overflow = 0;
    }

    /// Becomes what `other` is.
    pub fn copy_from(&mut self, other: &Self) {
        self.clear();
        self.springs.reserve_exact(MAX_SPRINGS);
        self.springs.extend_from_slice(&other.springs);
        self.overflow = other.overflow;
    }
}

impl Clone for NodalContacts {
    fn clone(&self) -> Self {
        let mut springs = Vec::with_capacity(self.springs.capacity());
        springs.extend_from_slice(&self.springs);
        Self { springs, overflow: self.overflow }
    }

    fn clone_from(&mut self, other: &Self) {
        self.copy_from(other);
    }
}

impl From<NodalContact> for NodalContacts {
    fn from(spring: NodalContact) -> Self {
        Self { springs: vec![spring], overflow: 0 }
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
        assert_eq!(NodalContacts::from(spring)[0], spring);
    }
}
