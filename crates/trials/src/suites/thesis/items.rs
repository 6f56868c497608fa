//! Every numbered figure and table of chapters 3 to 6, in the order of the thesis.

/// A numbered figure or table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// Number, as in `Figure 3.11`.
    pub number: &'static str,
    /// What it shows, in this project's words.
    pub shows: &'static str,
}

const fn item(number: &'static str, shows: &'static str) -> Item {
    Item { number, shows }
}

/// All of them.
pub const ITEMS: [Item; 74] = [
    item("Figure 3.1", "points on the burr"),
    item("Figure 3.2", "flow of rigid collision detection"),
    item("Figure 3.3", "sweep stops at the first bone"),
    item("Figure 3.4", "proxy and device before a move"),
    item("Figure 3.5", "colliding box of tool and skull"),
    item("Figure 3.6", "proxy free while the device is in bone"),
    item("Figure 3.7", "sweep of the whole ball"),
    item("Figure 3.8", "flow of a rigid tick"),
    item("Figure 3.9", "depth under a voxel's tangent plane"),
    item("Figure 3.10", "adapted force: mean normal, largest depth"),
    item("Table 3.1", "cubes of voxels"),
    item("Figure 3.11", "cubes, touched: time and voxels by frame"),
    item("Figure 3.12", "cubes, drilled: time and voxels by frame"),
    item("Figure 3.13", "voxels in contact, touching and drilling"),
    item("Table 3.2", "skulls of voxels"),
    item("Figure 3.14", "skulls, touched: time and voxels by frame"),
    item("Figure 3.15", "skulls, drilled: time and voxels by frame"),
    item("Figure 3.16", "time of the sweep before moving"),
    item("Figure 3.17", "skull, touched: normal and depth"),
    item("Figure 3.18", "skull, drilled: normal and depth"),
    item("Figure 3.19", "skull, touched: change of force by frame"),
    item("Figure 3.20", "skull, drilled: change of force by frame"),
    item("Figure 3.21", "skull, touched: first and rectified depth"),
    item("Figure 3.22", "skull, drilled: first and rectified depth"),
    item("Figure 3.23", "skull, touched: viscoelastic force"),
    item("Figure 3.24", "skull, touched: change of the viscoelastic force"),
    item("Figure 3.25", "skull, drilled: viscoelastic force"),
    item("Figure 3.26", "skull, drilled: change of the viscoelastic force"),
    item("Figure 4.1", "flow of deformable collision detection"),
    item("Figure 4.2", "boxes of the tetrahedra, updated each frame"),
    item("Figure 4.3", "a tetrahedron and the points in its cells"),
    item("Figure 4.4", "neighbours that are searched"),
    item("Figure 4.5", "proxy on the brain's surface"),
    item("Figure 4.6", "flow of a deformable step"),
    item("Figure 4.7", "depth over a tetrahedron's surface faces"),
    item("Table 4.1", "cubes of tetrahedra and their cells"),
    item("Figure 4.8", "cubes: time by frame"),
    item("Figure 4.9", "Cube4, Cube5: first stage and the rest, stacked"),
    item("Figure 4.10", "Cube4, Cube5: first stage and the rest, apart"),
    item("Table 4.2", "brains of tetrahedra and their cells"),
    item("Figure 4.11", "cubes: time of the first stage"),
    item("Figure 4.12", "brains: time by frame"),
    item("Figure 4.13", "brains: time by frame, improved search"),
    item("Figure 4.14", "Brain3, Brain5: first stage, before and after"),
    item("Table 4.3", "three paths over the brain"),
    item("Figure 4.15", "Brain3, Path1: normal and depth"),
    item("Figure 4.16", "Brain3, Path2: normal and depth"),
    item("Figure 4.17", "Brain3, Path3: normal and depth"),
    item("Figure 4.18", "Brain2 to Brain4: depth on three paths"),
    item("Figure 4.19", "Brain3: change of force on three paths"),
    item("Figure 4.20", "Brain3: viscoelastic force"),
    item("Figure 4.21", "Brain3: change of the viscoelastic force"),
    item("Figure 5.1", "flow of the grid's collision detection"),
    item("Figure 5.2", "largest triangle in a cell"),
    item("Table 5.1", "spheres of tetrahedra"),
    item("Figure 5.3", "two Sphere01: time over cells for each axis, and its fit"),
    item("Table 5.2", "spheres: best, analytic and usual cells for each axis"),
    item("Table 5.3", "spheres: error of the analytic and the usual size"),
    item("Figure 5.4", "scanned models"),
    item("Table 5.4", "models: best, analytic and usual cells for each axis"),
    item("Table 5.5", "models: error of the analytic and the usual size"),
    item("Figure 6.1", "craniotomy simulator in use"),
    item("Figure 6.2", "modules of the craniotomy simulator"),
    item("Figure 6.3", "window of the craniotomy simulator: slices and 3-D view"),
    item("Figure 6.4", "modules of the brain simulator"),
    item("Figure 6.5", "brain of tetrahedra"),
    item("Figure 6.6", "brain that a ball presses in"),
    item("Table 6.1", "tissue and gravity"),
    item("Figure 6.7", "window of the integrated simulator"),
    item("Figure 6.8", "threads and when they start"),
    item("Figure 6.9", "drilled skull with the brain in it"),
    item("Figure 6.10", "which collision reaches the hand, by task"),
    item("Figure 6.11", "integrated simulator while drilling"),
    item("Figure 6.12", "integrated simulator as a whole"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_a_chapter_is_there_once_and_in_order() {
        let counts = [("Figure 3", 26), ("Table 3", 2), ("Figure 4", 21), ("Table 4", 3)];
        let more = [("Figure 5", 4), ("Table 5", 5), ("Figure 6", 12), ("Table 6", 1)];
        for (chapter, count) in counts.into_iter().chain(more) {
            let of_chapter = |item: &&Item| item.number.starts_with(&format!("{chapter}."));
            let numbers: Vec<&str> = ITEMS.iter().filter(of_chapter).map(|item| item.number).collect();
            let expected: Vec<String> = (1..=count).map(|n| format!("{chapter}.{n}")).collect();
            assert_eq!(numbers, expected);
        }
    }
}
