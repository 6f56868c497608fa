//! Notes of a reader about a file that it could read.

/// A mesh with its reader's notes.
#[derive(Clone, Debug)]
pub struct Import<M> {
    /// The mesh.
    pub mesh: M,
    /// Notes for the user; empty for an ordinary file.
    pub notes: Vec<Note>,
}

/// A property of a file that is not an error but matters to the user.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Note {
    /// Tetrahedra of second or higher order.
    #[error("{0} tetrahedra have more than 4 nodes: their corners are read")]
    Corners(usize),
    /// Elements that are no tetrahedra.
    #[error("{0} elements of other kinds were passed over")]
    Others(usize),
    /// The same four nodes more than once.
    #[error("{0} tetrahedra are listed again, as in several groups: each counts once")]
    Repeated(usize),
    /// Nodes without a tetrahedron.
    #[error("{0} nodes that no tetrahedron uses were dropped")]
    Orphans(usize),
    /// The file is in the other patient space.
    #[error("the file says SPACE=LPS: x and y change sign")]
    Lps,
}
