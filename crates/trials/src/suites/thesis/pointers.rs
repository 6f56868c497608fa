//! Where the sources do what the boxes of a drawing say: a pointer is looked up in every run.
//!
//! # Practice
//! A pointer counts if the file is there and holds the item's text. Where the sources are not
//! beside the program, no pointer can be followed, and its drawing has no counterpart.

use super::comparison::{Comparison, Rule};
use super::judgement::FOUND;
use crate::suites::Part;
use crate::suites::rigid::solid::RADIUS_MM;
use std::path::Path;
use trepan_evidence::suite::{Findings, Row};
use trepan_geometry::{Pointshell, Spread, Vec3};

/// A box of a drawing, and the item of the sources that does it.
struct Pointer {
    figure: &'static str,
    step: &'static str,
    file: &'static str,
    item: &'static str,
}

const fn pointer(figure: &'static str, step: &'static str, file: &'static str, item: &'static str) -> Pointer {
    Pointer { figure, step, file, item }
}

/// The part that follows all pointers and counts what two drawings show.
pub fn parts() -> Vec<Part> {
    vec![Part::new("drawings", |_, findings| {
        findings.rows.extend(POINTERS.iter().map(Pointer::row));
        points(findings);
        largest_triangle(findings);
    })]
}

impl Pointer {
    fn row(&self) -> Row {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let text = std::fs::read_to_string(root.join(self.file)).unwrap_or_default();
        let found = f64::from(u8::from(text.contains(self.item)));
        Row::new(self.figure, self.step).with("file", self.file).with("item", self.item).metric(FOUND, found)
    }
}

/// Figure 3.1: points by steps of 10 degrees, as printed.
fn points(findings: &mut Findings) {
    let count = |spread| Pointshell::sphere(RADIUS_MM, Pointshell::RIGID_COUNT, spread).points.len() as f64;
    let comparison = Comparison::new("Figure 3.1", "points on the burr", "").printed(Rule::Equal(0.0), 466.0);
    let counts = [count(Spread::LatitudeLongitude), count(Spread::Fibonacci), f64::NAN];
    findings.rows.push(comparison.measured(counts).why("put right: an even spread").row());
}

/// Figure 5.2: the largest triangle of a unit cell's corners.
fn largest_triangle(findings: &mut Findings) {
    let corners: [Vec3; 8] = std::array::from_fn(|n| Vec3::new((n & 1) as f32, (n >> 1 & 1) as f32, (n >> 2) as f32));
    let area = |a: usize, b: usize, c: usize| 0.5 * (corners[b] - corners[a]).cross(corners[c] - corners[a]).length();
    let all = (0..8).flat_map(|a| (0..8).flat_map(move |b| (0..8).map(move |c| (a, b, c))));
    let largest = all.map(|(a, b, c)| area(a, b, c)).fold(0.0, f32::max);
    let comparison = Comparison::new("Figure 5.2", "largest triangle of a unit cell's corners (Eq 5.5)", "");
    findings.rows.push(comparison.printed(Rule::Equal(1e-5), 0.75f64.sqrt()).ours(largest.into()).row());
}

/// All of them, in the order of the thesis.
const POINTERS: [Pointer; 65] = [
    pointer("Figure 3.1", "points on the ball", "crates/geometry/src/shell.rs", "pub fn sphere("),
    pointer("Figure 3.2", "sweep the proxy", "crates/rivals/src/rigid/thesis.rs", "fn sweep("),
    pointer("Figure 3.2", "colliding box", "crates/rivals/src/rigid/thesis.rs", "let colliding ="),
    pointer("Figure 3.2", "voxels that hold points", "crates/rivals/src/rigid/thesis.rs", "fn touch("),
    pointer("Figure 3.2", "none: sweep once more", "crates/rivals/src/rigid/thesis.rs", "fn sweep_decides("),
    pointer("Figure 3.2", "drill", "crates/rivals/src/rigid/thesis.rs", "fn drill("),
    pointer("Figure 3.3", "stop at the first bone", "crates/rivals/src/rigid/sweep.rs", "pub fn sweep("),
    pointer("Figure 3.3", "every voxel of the way", "crates/rivals/src/rigid/traverse.rs", "fn first_bone("),
    pointer("Figure 3.4", "proxy beside the device", "crates/rigid/src/seam.rs", "fn proxy(&self) -> Pose"),
    pointer("Figure 3.5", "box of tool and skull", "crates/geometry/src/aabb.rs", "pub fn intersection("),
    pointer("Figure 3.6", "proxy free, device in bone", "crates/rivals/src/rigid/thesis.rs", "fn sweep_decides("),
    pointer("Figure 3.7", "sweep of the whole ball", "crates/rivals/src/rigid/sweep.rs", "fn whole("),
    pointer("Figure 3.8", "read the device", "crates/haptics/src/device.rs", "fn read("),
    pointer("Figure 3.8", "collision", "crates/rigid/src/seam.rs", "fn step("),
    pointer("Figure 3.8", "god-object", "crates/rivals/src/rigid/thesis.rs", "fn rectify("),
    pointer("Figure 3.8", "force model", "crates/contact/src/force.rs", "fn wrench("),
    pointer("Figure 3.8", "limit of the device", "crates/contact/src/guard/mod.rs", "pub fn guard("),
    pointer("Figure 3.8", "send the force", "crates/haptics/src/device.rs", "fn apply("),
    pointer(
        "Figure 3.9",
        "depth under the tangent plane",
        "crates/rivals/src/rigid/thesis.rs",
        "(bone.centre_of(voxel) - point).dot(inward)",
    ),
    pointer("Figure 3.10", "mean normal, largest depth", "crates/rivals/src/rigid/thesis.rs", "fn respond("),
    pointer("Figure 4.1", "move the points", "crates/deformable/src/step.rs", "fn place_points("),
    pointer("Figure 4.1", "sort them into cells", "crates/deformable/src/search/uniform_grid.rs", "fn count_and_sort("),
    pointer("Figure 4.1", "boxes of the tetrahedra", "crates/rivals/src/deformable/thesis.rs", "fn update_boxes("),
    pointer(
        "Figure 4.1",
        "first colliding tetrahedron",
        "crates/rivals/src/deformable/thesis.rs",
        "fn first_colliding(",
    ),
    pointer("Figure 4.1", "neighbours", "crates/rivals/src/deformable/thesis.rs", "fn two_rings("),
    pointer("Figure 4.2", "boxes in a vector", "crates/rivals/src/deformable/thesis.rs", "boxes: Vec<Extent>"),
    pointer("Figure 4.3", "points in the cells of a box", "crates/deformable/src/search/uniform_grid.rs", "fn visit("),
    pointer("Figure 4.3", "barycentric test", "crates/deformable/src/narrow.rs", "fn test("),
    pointer("Figure 4.4", "two rings of neighbours", "crates/rivals/src/deformable/thesis.rs", "fn two_rings("),
    pointer("Figure 4.5", "god-object on a plane", "crates/contact/src/god_object.rs", "pub fn follow("),
    pointer("Figure 4.5", "plane of the tissue at the hand", "crates/contact/src/patch.rs", "pub fn depth_at("),
    pointer("Figure 4.6", "collision step", "crates/deformable/src/step.rs", "pub fn step("),
    pointer("Figure 4.6", "normal and depth", "crates/deformable/src/response/printed.rs", "fn respond("),
    pointer("Figure 4.6", "force on the hand", "crates/contact/src/force.rs", "fn wrench("),
    pointer("Figure 4.6", "force on the nodes", "crates/deformable/src/outcome.rs", "pub fn springs("),
    pointer(
        "Figure 4.7",
        "distance to surface faces",
        "crates/deformable/src/response/printed.rs",
        "fn surface_faces(",
    ),
    pointer("Figure 5.1", "divide the space", "crates/deformable/src/search/hashed_grid.rs", "pub fn new("),
    pointer("Figure 5.1", "sort the particles", "crates/trials/bone/src/voxel_size/pass.rs", "pub fn place("),
    pointer("Figure 5.1", "boxes", "crates/voxel-size/src/counts.rs", "pub fn boxes("),
    pointer("Figure 5.1", "broad phase", "crates/trials/bone/src/voxel_size/pass.rs", "pub fn look("),
    pointer("Figure 5.1", "narrow phase", "crates/deformable/src/narrow.rs", "fn test("),
    pointer("Figure 5.1", "response", "crates/deformable/src/bodies.rs", "pub fn push_apart("),
    pointer("Figure 5.1", "integration", "crates/tled/src/tled.rs", "fn step("),
    pointer("Figure 5.2", "largest triangle in a cell", "crates/voxel-size/src/cost.rs", "fn particle_density("),
    pointer("Figure 6.2", "main thread", "apps/craniotomy/src/main.rs", "fn main("),
    pointer("Figure 6.2", "picture", "crates/render/src/painter.rs", "pub fn picture("),
    pointer("Figure 6.2", "window", "crates/simulator/src/show/window.rs", "pub(crate) fn show("),
    pointer("Figure 6.2", "haptic thread", "crates/runtime/src/threads.rs", "fn haptic_loop("),
    pointer("Figure 6.2", "rigid collision", "crates/stages/src/haptic_tick/mod.rs", "pub fn tick("),
    pointer("Figure 6.4", "main thread", "apps/brain/src/main.rs", "fn main("),
    pointer("Figure 6.4", "haptic thread", "crates/runtime/src/threads.rs", "fn haptic_loop("),
    pointer("Figure 6.4", "collision thread", "crates/runtime/src/threads.rs", "fn collision_loop("),
    pointer("Figure 6.4", "simulation thread", "crates/runtime/src/threads.rs", "fn solver_loop("),
    pointer("Figure 6.8", "main thread", "apps/integrated/src/main.rs", "fn main("),
    pointer("Figure 6.8", "start of the haptic thread", "crates/runtime/src/threads.rs", "haptic_loop(hands"),
    pointer(
        "Figure 6.8",
        "start of the collision thread",
        "crates/runtime/src/threads.rs",
        "collision_loop(tissue.collision",
    ),
    pointer(
        "Figure 6.8",
        "start of the simulation thread",
        "crates/runtime/src/threads.rs",
        "solver_loop(tissue.solver",
    ),
    pointer(
        "Figure 6.10",
        "skull or brain by task",
        "crates/stages/src/haptic_tick/mod.rs",
        "pub fn phase(&self) -> Phase",
    ),
    pointer(
        "Figure 6.10",
        "the drill touches the brain: a warning",
        "crates/stages/src/notice.rs",
        "the drill touches the brain",
    ),
    pointer("Figure 6.10", "tissue as a plane for the hand", "crates/contact/src/patch.rs", "pub struct SurfacePatch"),
    pointer("Figure 6.12", "skull", "crates/rigid/src/seam.rs", "pub trait RigidContact"),
    pointer("Figure 6.12", "brain", "crates/deformable/src/step.rs", "pub struct TissueCollision"),
    pointer("Figure 6.12", "simulation", "crates/soft/src/solver.rs", "pub trait SoftSolver"),
    pointer("Figure 6.12", "haptics", "crates/haptics/src/device.rs", "pub trait HapticDevice"),
    pointer("Figure 6.12", "picture", "crates/render/src/painter.rs", "pub struct Painter"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pointer_leads_to_its_item_and_a_wrong_one_does_not() {
        for pointer in &POINTERS {
            let Pointer { figure, step, file, item } = pointer;
            assert_eq!(pointer.row().metrics[FOUND], 1.0, "{figure}, {step}: {item} is not in {file}");
        }
        let lost = Pointer { figure: "Figure 3.2", step: "s", file: "no/such.rs", item: "fn" };
        assert_eq!(lost.row().metrics[FOUND], 0.0);
        assert_eq!(Pointer { item: "fn no_such(", ..POINTERS[0] }.row().metrics[FOUND], 0.0);
    }
}
