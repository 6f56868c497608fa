//! What one collision test found: a fixed-capacity list of contacts and the one contact that stands
//! for them all.

use trepan_geometry::Vec3;

/// Most contacts that one manifold holds; the rest is counted in [`ContactManifold::overflow`].
pub const MAX_CONTACTS: usize = 64;

/// One place where a tool point is inside an obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Where, world mm.
    pub point: Vec3,
    /// Unit vector out of the obstacle, towards the free side.
    pub normal: Vec3,
    /// How deep, mm; positive inside.
    pub depth_mm: f32,
}

/// The contacts of one tool with one obstacle.
///
/// `normal`, `depth_mm` and `point` are the aggregate that force models use; the list behind
/// [`contacts`](Self::contacts) is what it was made of. An empty manifold has depth 0 and a zero
/// normal. Copying costs 1.8 kB; nothing is allocated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactManifold {
    /// Unit vector out of the obstacle, towards the free side; zero when there is no contact.
    pub normal: Vec3,
    /// Penetration along `normal`, mm; 0 when there is no contact.
    pub depth_mm: f32,
    /// Point of application, world mm.
    pub point: Vec3,
    /// Moment about `point` for each newton, mm: what is left when a tool touches in several
    /// places, tip and shaft. Zero for one place.
    pub couple_mm: Vec3,
    /// Contacts that did not fit.
    pub overflow: u32,
    count: usize,
    contacts: [Contact; MAX_CONTACTS],
}

impl Default for ContactManifold {
    fn default() -> Self {
        Self {
            normal: Vec3::ZERO,
            depth_mm: 0.0,
            point: Vec3::ZERO,
            couple_mm: Vec3::ZERO,
            overflow: 0,
            count: 0,
            contacts: [Contact::default(); MAX_CONTACTS],
        }
    }
}

impl ContactManifold {
    /// A manifold of one contact, which is its aggregate too.
    pub fn single(contact: Contact) -> Self {
        let mut manifold = Self::default();
        manifold.set_single(contact);
        manifold
    }

    /// Makes this a manifold of one contact, without touching the whole list.
    pub fn set_single(&mut self, contact: Contact) {
        self.clear();
        self.push(contact);
        (self.normal, self.depth_mm, self.point) = (contact.normal, contact.depth_mm, contact.point);
    }

    /// Forgets everything, without touching the whole list.
    pub fn clear(&mut self) {
        (self.normal, self.depth_mm, self.point) = (Vec3::ZERO, 0.0, Vec3::ZERO);
        self.couple_mm = Vec3::ZERO;
        (self.overflow, self.count) = (0, 0);
    }

    /// Adds a contact, or counts it as overflow when the list is full.
    pub fn push(&mut self, contact: Contact) {
        match self.contacts.get_mut(self.count) {
            Some(slot) => {
                *slot = contact;
                self.count += 1;
            }
            None => self.overflow += 1,
        }
    }

    /// The contacts found, in the order in which they were found.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts[..self.count]
    }

    /// Whether the tool touches.
    pub fn touches(&self) -> bool {
        self.depth_mm > 0.0
    }

    /// Whether every number that a force model reads is finite.
    pub fn is_finite(&self) -> bool {
        self.normal.is_finite() && self.depth_mm.is_finite() && self.point.is_finite() && self.couple_mm.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_list_counts_what_it_drops() {
        let mut manifold = ContactManifold::default();
        for i in 0..MAX_CONTACTS + 3 {
            manifold.push(Contact { depth_mm: i as f32, ..Contact::default() });
        }
        assert_eq!((manifold.contacts().len(), manifold.overflow), (MAX_CONTACTS, 3));
        manifold.clear();
        assert!(manifold.contacts().is_empty() && !manifold.touches());
    }
}
