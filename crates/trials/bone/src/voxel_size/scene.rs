//! The scenes: meshes, and particles that touch them in several ways.

use trepan_geometry::{Aabb, Pointshell, Spread, Vec3};
use trepan_mesh::{TetMesh, TriMesh, lattice};
use trepan_volume::{Grid, Interpolation, VoxelVolume, resample};
use trepan_voxel_size::{Measures, counts};

/// Radius of the balls, mm.
const RADIUS_MM: f32 = 22.0;

/// Boxes of a mesh and what is tested against them.
pub struct Scene {
    /// Name.
    pub name: String,
    /// Measures of its elements, from which a voxel size follows.
    pub measures: Measures,
    /// Size of the mesh, mm.
    pub size_mm: Vec3,
    /// Box of every element.
    pub boxes: Vec<Aabb>,
    /// Points that are tested against them, mm.
    pub particles: Vec<Vec3>,
    /// Row of the thesis's Table 5.2, where it is one of its scenes.
    pub table_row: Option<usize>,
}

/// What a scene needs of a mesh of tetrahedra or triangles.
pub struct Elements {
    name: String,
    positions: Vec<Vec3>,
    boxes: Vec<Aabb>,
    measures: Measures,
}

/// What touches a mesh.
#[derive(Clone, Copy, Debug)]
pub enum Touch {
    /// The nodes of an equal mesh beside it, pressed in until this share of the tetrahedra collide.
    Twin(f64),
    /// A ball tool's points at its surface.
    Tool,
    /// Points anywhere in its box.
    Cloud,
}

/// What is meshed.
#[derive(Clone, Copy, Debug)]
pub enum Body {
    /// A ball of that many tetrahedra.
    Ball(usize),
    /// A ball whose elements get smaller towards its middle.
    Graded(usize),
    /// A torus of that many.
    Torus(usize),
    /// The built-in brain of that many.
    Brain(usize),
    /// Triangles of a scanned model, which the folder that `TREPAN_DATA` names may hold.
    Model(&'static str),
}

impl Scene {
    /// A scene of a mesh that is there.
    pub fn new(of: &Elements, touch: Touch, table_row: Option<usize>) -> Self {
        let bounds = Aabb::of_points(&of.positions);
        let particles = match touch {
            Touch::Twin(share) => twin(of, share),
            Touch::Tool => tool(&of.positions),
            Touch::Cloud => cloud(bounds),
        };
        let name = format!("{}, {touch:?}", of.name).to_lowercase();
        Self { name, measures: of.measures, size_mm: bounds.size(), boxes: of.boxes.clone(), particles, table_row }
    }
}

impl Elements {
    /// Of a body; `None` for a model that is not there.
    pub fn of(body: Body) -> Option<Self> {
        let name = format!("{body:?}");
        if let Body::Model(file) = body {
            return of_triangles(name, model(file)?);
        }
        let mesh = mesh(body);
        let measures = Measures::of(&mesh).expect("the mesh is sound");
        Some(Self { name, boxes: counts::boxes(&mesh), positions: mesh.positions, measures })
    }
}

fn of_triangles(name: String, mut mesh: TriMesh) -> Option<Elements> {
    let bounds = Aabb::of_points(&mesh.positions);
    let scale = 2.0 * RADIUS_MM / bounds.size().max_element();
    mesh.positions.iter_mut().for_each(|p| *p = (*p - bounds.centre()) * scale);
    let positions = mesh.positions;
    let boxes = mesh.triangles.iter().map(|t| Aabb::of_points(&t.map(|n| positions[n as usize]))).collect();
    let measures = Measures::of_triangles(&positions, &mesh.triangles).ok()?;
    Some(Elements { name, positions, boxes, measures })
}

/// A model's triangles, when the folder of real data is named and holds it.
fn model(file: &str) -> Option<TriMesh> {
    let folder = std::env::var_os("TREPAN_DATA").map(std::path::PathBuf::from)?.join("meshes-collision");
    let read = trepan_mesh::read_surface(&folder.join(file));
    read.map_err(|fault| eprintln!("voxel-size: {file} is left out: {fault}")).ok()
}

/// The tetrahedra of a body.
pub fn mesh(body: Body) -> TetMesh {
    let ball = |p: Vec3| p.length() < RADIUS_MM;
    match body {
        Body::Ball(tets) => filled(&mask(ball), tets),
        Body::Graded(tets) => {
            let mut mesh = filled(&mask(ball), tets);
            mesh.positions.iter_mut().for_each(|p| *p *= 0.1 + 0.9 * p.length() / RADIUS_MM);
            mesh
        }
        Body::Torus(tets) => filled(&mask(|p| (p.x.hypot(p.y) - 15.0).hypot(p.z) < 7.0), tets),
        Body::Brain(tets) => {
            let file = trepan_fixtures::case_head().labels;
            let brain = trepan_volume::read(&file).expect("the built-in case can be read").map(|v| u8::from(v > 0.5));
            filled(&resample(&brain, &Grid::isotropic_over(&brain, 4.0), Interpolation::Majority, 0), tets)
        }
        Body::Model(_) => TetMesh::default(),
    }
}

fn filled(mask: &VoxelVolume<u8>, target_tets: usize) -> TetMesh {
    lattice::tetrahedra(mask, &lattice::Config { target_tets, ..Default::default() }).expect("it can be meshed")
}

fn mask(inside: impl Fn(Vec3) -> bool) -> VoxelVolume<u8> {
    let n = 48;
    let mut mask = VoxelVolume::isotropic([n; 3], Vec3::splat(-23.5), 1.0, 0u8);
    for at in 0..mask.data.len() {
        mask.data[at] = u8::from(inside(mask.centre_of([at % n, at / n % n, at / (n * n)]).as_vec3()));
    }
    mask
}

fn twin(of: &Elements, share: f64) -> Vec<Vec3> {
    let moved = |by: f32| of.positions.iter().map(|p| *p + Vec3::X * by).collect::<Vec<Vec3>>();
    let width = Aabb::of_points(&of.positions).size().x;
    let usual = of.measures.traditional_mm();
    let (mut near, mut far) = (0.3 * width, width + 1.0);
    for _ in 0..18 {
        let middle = 0.5 * (near + far);
        let hit = |c: counts::Counts| c.busy_boxes as f64;
        if counts::grid(&of.boxes, &moved(middle), usual).map_or(0.0, hit) > share * of.boxes.len() as f64 {
            near = middle;
        } else {
            far = middle;
        }
    }
    moved(near)
}

fn tool(positions: &[Vec3]) -> Vec<Vec3> {
    let right = positions.iter().copied().max_by(|a, b| a.x.total_cmp(&b.x)).unwrap_or_default();
    Pointshell::sphere(5.0, 500, Spread::Fibonacci).points.iter().map(|p| *p + right + Vec3::X * 2.0).collect()
}

fn cloud(bounds: Aabb) -> Vec<Vec3> {
    let mut random = fastrand::Rng::with_seed(11);
    (0..2000).map(|_| bounds.min + bounds.size() * Vec3::new(random.f32(), random.f32(), random.f32())).collect()
}
