//! Meshes that move by 30 % strain, and the ways along which a tool touches them.

use glam::DVec3;
use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh, lattice};

/// Radius of the tool, mm.
pub const RADIUS_MM: f32 = 2.0;
/// Edge of the cube, mm: the thesis's cell sizes over its cells for each axis.
const CUBE_MM: f32 = 145.0;
/// Largest shear of the moving mesh.
const STRAIN: f32 = 0.3;
/// How fast the wave runs through the mesh, per ms.
const WAVE_PER_MS: f32 = 0.01;

/// A mesh and its motion.
pub struct Scene {
    /// What it is, with its size.
    pub name: String,
    /// At rest.
    pub mesh: TetMesh,
    /// Mean edge, mm.
    pub edge_mm: f32,
    surface: Surface,
    /// Largest shear.
    strain: f32,
}

/// A way to move the tool.
pub struct Path {
    /// Its name.
    pub name: &'static str,
    /// Whether every step is somewhere else.
    pub jumps: bool,
    /// Direction from the mesh's middle, and depth along it, mm, at this step.
    pose: fn(f32) -> (Vec3, f32),
}

/// The thesis's three (Table 4.3), and jumps.
pub const PATHS: [Path; 4] = [
    Path { name: "light strokes", jumps: false, pose: light },
    Path { name: "random movements", jumps: false, pose: random },
    Path { name: "repeated contact", jumps: false, pose: repeated },
    Path { name: "jumps", jumps: true, pose: jumps },
];

fn light(t: f32) -> (Vec3, f32) {
    (Vec3::new(0.5 * (7e-4 * t).sin(), 0.4 * (11e-4 * t).sin(), 1.0), 0.4 + 0.2 * (0.01 * t).sin())
}

fn random(t: f32) -> (Vec3, f32) {
    let sway = |a: f32, b: f32| (a * t).sin() + (b * t + 1.0).sin();
    (Vec3::new(0.4 * sway(2e-3, 4.7e-3), 0.4 * sway(2.9e-3, 3.7e-3), 1.0), 1.0 + sway(0.013, 0.031))
}

fn repeated(t: f32) -> (Vec3, f32) {
    (Vec3::new(0.21, -0.17, 1.0), 0.5 + 1.5 * (0.025 * t).sin())
}

fn jumps(t: f32) -> (Vec3, f32) {
    let part = |k: f32| (t * k).fract() - 0.5;
    (Vec3::new(part(0.618_034), part(0.414_213), part(0.732_05)), 2.0 + 12.0 * part(0.302_77))
}

impl Scene {
    /// The thesis's cube of so many cells for each axis, five tetrahedra each, moving.
    pub fn cube(cells: usize) -> Self {
        Self { strain: STRAIN, ..Self::cube_at_rest(cells) }
    }

    /// The same, at rest.
    pub fn cube_at_rest(cells: usize) -> Self {
        let mesh = five_split(cells, CUBE_MM / cells as f32);
        Self::of(format!("cube, {} tetrahedra", mesh.tets.len()), mesh, 0.0)
    }

    /// The built-in case's brain, moving.
    pub fn brain(target_tets: usize) -> Self {
        Self { strain: STRAIN, ..Self::brain_at_rest(target_tets) }
    }

    /// The same, at rest.
    pub fn brain_at_rest(target_tets: usize) -> Self {
        let mask = trepan_volume::read(&trepan_fixtures::case_head().labels).expect("the built-in case is there");
        let config = lattice::Config { target_tets, ..Default::default() };
        let mesh = lattice::tetrahedra(&mask.map(|v| u8::from(v > 0.5)), &config).expect("the brain can be meshed");
        Self::of(format!("brain, {} tetrahedra", mesh.tets.len()), mesh, 0.0)
    }

    fn of(name: String, mesh: TetMesh, strain: f32) -> Self {
        Self { name, edge_mm: mean_edge_mm(&mesh), surface: Surface::of(&mesh), mesh, strain }
    }

    /// The border triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.surface.triangles
    }

    /// Where the nodes are at this step: two shear waves.
    pub fn move_to(&self, step: usize, positions: &mut [Vec3]) {
        if self.strain == 0.0 {
            return;
        }
        let wave_number = 4.0 * core::f32::consts::PI / CUBE_MM;
        let (height_mm, phase) = (self.strain / wave_number, WAVE_PER_MS * step as f32);
        for (moved, p) in positions.iter_mut().zip(&self.mesh.positions) {
            let shear = Vec3::new((wave_number * p.y - phase).sin(), 0.0, (wave_number * p.x + phase).sin());
            *moved = *p + height_mm * shear;
        }
    }

    /// Where the tip is at each step: on the ray of the path, so deep under the moved surface.
    pub fn tips(&self, path: &Path, steps: usize) -> Vec<Vec3> {
        let mut positions = self.mesh.positions.clone();
        let middle = self.mesh.bounds().centre();
        let mut reach_mm = 0.0;
        let mut tip = |step| {
            self.move_to(step, &mut positions);
            let (towards, depth_mm) = (path.pose)(step as f32);
            let towards = towards.normalize_or(Vec3::Z);
            reach_mm = self.furthest_hit(&positions, middle, towards).unwrap_or(reach_mm);
            middle + towards * (reach_mm + RADIUS_MM - depth_mm)
        };
        (0..steps).map(&mut tip).collect()
    }

    /// A stroke along the top of a mesh at rest: tips, and their depth, mm.
    pub fn stroke(&self, steps: usize) -> (Vec<Vec3>, f64) {
        let (bounds, depth_mm) = (self.mesh.bounds(), 0.5);
        let start = bounds.min + bounds.size() * Vec3::new(0.2, 0.31, 1.0) + Vec3::Z * (RADIUS_MM - depth_mm);
        let along = bounds.size() * Vec3::new(0.55, 0.33, 0.0);
        ((0..steps).map(|step| start + along * (step as f32 / steps as f32)).collect(), f64::from(depth_mm))
    }

    /// Straight down through the middle of the top of a mesh at rest, to this share of its
    /// thickness: tips, and the greatest depth, mm.
    pub fn push(&self, share: f32) -> (Vec<Vec3>, f32) {
        let bounds = self.mesh.bounds();
        let start = bounds.min + bounds.size() * Vec3::new(0.52, 0.47, 1.0) + Vec3::Z * RADIUS_MM;
        let deepest_mm = share * bounds.size().z;
        let steps = (deepest_mm / 0.25) as usize;
        ((0..=steps).map(|k| start - Vec3::Z * (deepest_mm * k as f32 / steps as f32)).collect(), deepest_mm)
    }

    fn furthest_hit(&self, positions: &[Vec3], from: Vec3, towards: Vec3) -> Option<f32> {
        let hits = self.surface.triangles.iter().filter_map(|t| hit(t.map(|n| positions[n as usize]), from, towards));
        hits.max_by(f32::total_cmp)
    }
}

/// Distance along a ray to a triangle (Möller and Trumbore 1997).
fn hit([a, b, c]: [Vec3; 3], from: Vec3, towards: Vec3) -> Option<f32> {
    let (ab, ac, aq): (DVec3, DVec3, DVec3) = ((b - a).as_dvec3(), (c - a).as_dvec3(), (from - a).as_dvec3());
    let (d, across) = (towards.as_dvec3(), aq.cross(ab));
    let normal = d.cross(ac);
    let det = ab.dot(normal);
    let (u, v, t) = (aq.dot(normal) / det, d.dot(across) / det, ac.dot(across) / det);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite()).then_some(t as f32)
}

/// A cube of `cells` cells for each axis, five tetrahedra in each, every second cell mirrored.
pub fn five_split(cells: usize, edge_mm: f32) -> TetMesh {
    let side = cells + 1;
    let mut mesh = TetMesh::default();
    for n in 0..side * side * side {
        mesh.positions.push(Vec3::new((n % side) as f32, (n / side % side) as f32, (n / side / side) as f32) * edge_mm);
    }
    for cell in 0..cells * cells * cells {
        let (x, y, z) = (cell % cells, cell / cells % cells, cell / cells / cells);
        let mirrored = usize::from((x + y + z) % 2 == 1);
        let node = |c: usize| {
            let at = c ^ mirrored;
            (((z + (at >> 2)) * side + y + (at >> 1 & 1)) * side + x + (at & 1)) as u32
        };
        for tet in [[0, 1, 2, 4], [3, 1, 7, 2], [5, 1, 4, 7], [6, 2, 7, 4], [1, 2, 4, 7]] {
            mesh.tets.push(tet.map(node));
            let last = mesh.tets.len() - 1;
            if mesh.volume_mm3(last) < 0.0 {
                mesh.tets[last].swap(2, 3);
            }
        }
    }
    mesh
}

fn mean_edge_mm(mesh: &TetMesh) -> f32 {
    const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let of =
        |t: usize| EDGES.map(|[a, b]| f64::from(mesh.corners(t)[a].distance(mesh.corners(t)[b]))).iter().sum::<f64>();
    ((0..mesh.tets.len()).map(of).sum::<f64>() / (6 * mesh.tets.len()) as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cubes_are_the_thesis_s_and_without_gaps() {
        for (cells, tets) in [(7, 1715), (13, 10_985)] {
            let mesh = five_split(cells, 2.0);
            assert_eq!(mesh.tets.len(), tets);
            mesh.check().expect("sound");
            assert!(Surface::of(&mesh).is_closed());
            assert!((mesh.total_mm3() - (2.0 * cells as f64).powi(3)).abs() < 1e-3);
        }
    }

    #[test]
    fn a_light_stroke_touches_a_moving_cube() {
        let scene = Scene::cube(4);
        let truth = super::super::truth::Truth::along(&scene, &scene.tips(&PATHS[0], 50));
        assert!(truth.iter().all(|t| t.depth_mm > 0.0 && t.depth_mm < 1.0 && t.surely_inside > 0));
    }
}
