//! Where ray casters and meshes fail: each condition by each drawer, as a map.
//!
//! # Practice
//! Bone counts as right where the rays hit what rays hit that walk every cell, to 0.01 voxel;
//! sparse rays to 0.25 voxel, 1 ray in 100 aside. A moved mesh counts as right where device and
//! processor show it alike (SSIM 0.99) and, where it has a silhouette, as large as it is.

use super::likeness::similarity;
use super::scenes::{ISO, frame};
use super::speed::{self, SETTINGS};
use super::{By, EXACT, Hits, Setting};
use glam::{DVec3, Vec3};
use std::sync::Arc;
use trepan_bone::{BoneError, BoneVolume};
use trepan_evidence::picture::{Map, Outcome};
use trepan_evidence::suite::{Findings, Gate};
use trepan_gpu::Gpu;
use trepan_mesh::TetMesh;
use trepan_render::{Camera, Casting, Cut, Frame, Image, SceneData};
use trepan_trials_scenes::conditions;
use trepan_volume::{AIR_HU, VoxelVolume};

const SIZE: [u32; 2] = [97, 61];

/// The map of bone and that of moved meshes.
pub fn run(gpu: Option<&Gpu>, findings: &mut Findings) {
    bone_map(gpu, findings);
    findings.maps.push(mesh_map(gpu));
    for map in &findings.maps {
        // Long steps and few pixels are in the map to show where they fail; what pictures are drawn
        // with must not.
        let used = |column: &str| !["steps", "no leaping", "of the pixels"].iter().any(|other| column.contains(other));
        let failed = map.named_cells().filter(|(_, column, cell)| used(column) && cell.grade() == 2).count();
        findings.gates.push(Gate::at_most(format!("{}: conditions that fail", map.title), failed as f64, 0.0));
    }
}

/// Bone of a rule in voxels of 1 mm around the origin.
fn made(edge: [usize; 3], hu: impl Fn(DVec3) -> f64) -> Arc<BoneVolume> {
    made_or_empty(edge, hu).expect("there is bone")
}

/// Bone of a rule in voxels of 1 mm around the origin; an error if no voxel holds any.
pub fn made_or_empty(edge: [usize; 3], hu: impl Fn(DVec3) -> f64) -> Result<Arc<BoneVolume>, BoneError> {
    let low = Vec3::from(edge.map(|n| 0.5 - 0.5 * n as f32));
    let mut ct = VoxelVolume::isotropic(edge, low, 1.0, AIR_HU);
    for at in 0..ct.data.len() {
        let p = ct.centre_of([at % edge[0], at / edge[0] % edge[1], at / (edge[0] * edge[1])]);
        ct.data[at] = hu(p).clamp(-1000.0, 3000.0) as i16;
    }
    BoneVolume::new(&ct, ISO).map(Arc::new)
}

/// Name, bone, camera, pixels.
type Condition = (&'static str, Arc<BoneVolume>, Frame<'static>, [u32; 2]);

fn conditions() -> Vec<Condition> {
    let shell = || made([53; 3], |p| f64::from(ISO) + 250.0 * (2.5 - (p.length() - 20.0).abs()));
    let noise = |p: DVec3| {
        let mixed = (p.x * 12.9898 + p.y * 78.233 + p.z * 37.719).sin() * 43758.5453;
        3000.0 * (mixed - mixed.floor()) - 1000.0
    };
    let drilled = made([30; 3], |p| if p.length() < 9.0 { 1000.0 } else { -1000.0 });
    (0..27_000).for_each(|at| drilled.set_hu(glam::IVec3::new(at % 30, at / 30 % 30, at / 900), AIR_HU));
    let one_layer = made([40; 3], |p| if (p.y - 0.5).abs() < 0.1 { f64::from(ISO) + 1.0 } else { -1000.0 });
    let step_mm = |towards: Vec3, mm: f32| frame(Vec3::ZERO, towards, mm, 0.6);
    let oblique = Vec3::new(0.3, 1.0, 0.2);
    let in_a_face = Camera { target: Vec3::new(-11.5, 0.0, -11.5), fov_rad: 1e-3, ..step_mm(Vec3::Y, 90.0).camera };
    vec![
        ("along an axis", shell(), step_mm(Vec3::Y, 90.0), SIZE),
        ("almost along an axis", shell(), step_mm(Vec3::new(1e-6, 1.0, -1e-6), 90.0), SIZE),
        ("in the faces of bricks", shell(), Frame { camera: in_a_face, ..step_mm(Vec3::Y, 90.0) }, [3, 3]),
        ("the eye inside", shell(), step_mm(oblique, 3.0), SIZE),
        ("the eye in bone", shell(), step_mm(Vec3::Y, 20.0), SIZE),
        ("grazing rays", one_layer.clone(), step_mm(Vec3::new(1.0, 0.03, 0.0), 60.0), SIZE),
        ("a wall of one voxel", one_layer, frame(Vec3::ZERO, oblique, 90.0, 0.2), SIZE),
        ("noise", made([41, 33, 37], noise), step_mm(oblique, 70.0), SIZE),
        ("bone everywhere", made([29, 31, 30], |_| 1500.0), step_mm(oblique, 70.0), SIZE),
        (
            "a plateau at the isovalue",
            made([24; 3], |p| if p.z < 0.0 { ISO.into() } else { 0.0 }),
            step_mm(oblique, 60.0),
            SIZE,
        ),
        ("one voxel", made([1; 3], |_| 1000.0), step_mm(oblique, 20.0), SIZE),
        ("all drilled away", drilled, step_mm(oblique, 60.0), SIZE),
        ("one pixel", shell(), step_mm(oblique, 90.0), [1, 1]),
        ("8192 pixels wide", shell(), step_mm(oblique, 90.0), [8192, 8]),
    ]
}

/// A setting, and the number of the drawer that draws with it: 0 the processor, 1 the device.
pub type Drawer = (usize, Setting);

/// All settings of pictures by whoever knows them, named as in the chart.
pub fn drawers(has_device: bool) -> Vec<(String, Drawer)> {
    let settings = SETTINGS.iter().map(|setting| (format!("processor: {}", setting.name), (0, *setting)));
    let on_device = SETTINGS.iter().filter(|setting| has_device && speed::known_to_device(setting));
    settings.chain(on_device.map(|setting| (format!("device: {}", setting.name), (1, *setting)))).collect()
}

/// Every condition by every drawer.
fn bone_map(gpu: Option<&Gpu>, findings: &mut Findings) {
    let conditions = conditions();
    let names: Vec<&str> = conditions.iter().map(|(name, ..)| *name).collect();
    let drawers = drawers(gpu.is_some());
    let drawers: Vec<(&str, Drawer)> = drawers.iter().map(|(name, by)| (name.as_str(), *by)).collect();
    let mut open: Option<(usize, Vec<By>)> = None;
    let verdict = |at: usize, &(by, setting): &Drawer| {
        let (_, bone, frame, size) = &conditions[at];
        // Conditions come one after the other: their drawers are made once.
        let (_, drawers) = match &mut open {
            Some(drawers) if drawers.0 == at => drawers,
            closed => closed.insert((at, By::all(bone, gpu, *size))),
        };
        let mut hits = |by: usize, setting: &Setting| {
            drawers[by].set(setting, *size);
            drawers[by].draw(frame);
            drawers[by].hits()
        };
        let walked = Setting { casting: Casting { leap: false, ..EXACT.casting }, ..setting };
        let walked = Setting { casting: Casting { step_voxel: None, sparse: false, ..walked.casting }, ..walked };
        // Fewer pixels are other rays, and the device places them otherwise: their truth has as
        // few, by whoever draws.
        let truth = hits(if setting.detail < 1.0 { by } else { 0 }, &walked);
        let (most_mm, share) = match setting.casting {
            Casting { step_voxel: Some(step), .. } => (step.max(0.25), 0.01),
            Casting { sparse: true, .. } => (0.25, 0.01),
            _ => (0.01, 1e-3),
        };
        judged(&hits(by, &setting), &truth, most_mm, share)
    };
    conditions::judge("bone", &names, &drawers, verdict, findings);
}

/// Whether hits are those of the truth, but for a share of the rays.
fn judged(hits: &Hits, truth: &Hits, most_mm: f32, share: f64) -> Outcome {
    let wrong = hits.iter().zip(truth).filter(|(a, b)| match (a, b) {
        (Some(a), Some(b)) => (a.distance_mm - b.distance_mm).abs() > most_mm,
        (a, b) => a.is_some() != b.is_some(),
    });
    let wrong = wrong.count();
    let reason = format!("{wrong} of {} rays differ", hits.len());
    match wrong as f64 / hits.len() as f64 {
        _ if hits.len() != truth.len() => Outcome::Fails("another number of rays".into()),
        part if part <= share => Outcome::Works,
        part if part <= 10.0 * share => Outcome::Degrades(reason),
        _ => Outcome::Fails(reason),
    }
}

/// A block of 6·4³ tetrahedra.
fn block() -> TetMesh {
    let corner = |cell: usize, c: usize| {
        let [x, y, z] = [cell % 4 + (c & 1), cell / 4 % 4 + (c >> 1 & 1), cell / 16 + (c >> 2)];
        (x + 5 * (y + 5 * z)) as u32
    };
    let split = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
    let place = |i: usize| 6.0 * Vec3::new((i % 5) as f32, (i / 5 % 5) as f32, (i / 25) as f32) - 12.0;
    TetMesh {
        positions: (0..125).map(place).collect(),
        tets: (0..64).flat_map(|cell| split.map(|tet| tet.map(|c| corner(cell, c)))).collect(),
    }
}

fn mesh_map(gpu: Option<&Gpu>) -> Map {
    let mesh = block();
    let moved = |f: &dyn Fn(Vec3) -> Vec3| mesh.positions.iter().map(|&p| f(p)).collect::<Vec<_>>();
    let mut broken = mesh.positions.clone();
    (broken[62], broken[3]) = (Vec3::NAN, Vec3::INFINITY);
    let shear =
        |p: Vec3| if p.abs().max_element() < 11.0 { p + 1.5 * Vec3::new(p.y.sin(), p.z.sin(), p.x.sin()) } else { p };
    // What moves, and the least and most share of the sound block's pixels.
    let cases: [(&str, Vec<Vec3>, [f64; 2]); 8] = [
        ("sound", mesh.positions.clone(), [1.0, 1.0]),
        ("moved inside only", moved(&shear), [0.999, 1.001]),
        ("turned inside out", moved(&|p| Vec3::new(-p.x, p.y, p.z)), [0.9, 1.1]),
        ("folded on itself", moved(&|p| Vec3::new(p.x.abs(), p.y, p.z)), [0.3, 0.8]),
        ("slivers", moved(&|p| Vec3::new(p.x, 1e-4 * p.y, p.z)), [0.5, 1.1]),
        ("one plane", moved(&|p| Vec3::new(p.x, 0.0, p.z)), [0.0, 1.1]),
        ("one point", moved(&|_| Vec3::ZERO), [0.0, 0.01]),
        ("places that are no numbers", broken, [0.3, 9.0]),
    ];
    let mut map = Map {
        title: "moved tetrahedra".into(),
        x: "what is shown".into(),
        y: "condition".into(),
        columns: ["surface", "cut"].map(String::from).to_vec(),
        ..Map::default()
    };
    let cut = Cut { point: Vec3::new(0.3, 4.1, 0.0), normal: Vec3::new(0.2, 1.0, 0.1), bone: false };
    let data = SceneData { bone: None, brain: Some(&mesh), mri: None, tint: None, cortex: None };
    let mut drawers = By::of(&data, gpu, SIZE);
    let mut sound = 0;
    for (name, now, [least, most]) in &cases {
        let cells = [None, Some(cut)].map(|cut| {
            let frame =
                Frame { brain_positions: Some(now), cut, ..frame(Vec3::ZERO, Vec3::new(0.3, 1.0, 0.2), 90.0, 0.6) };
            let images: Vec<Image> = drawers.iter_mut().map(|by| (by.draw(&frame), by.image()).1).collect();
            let seen = images[0].rgba.chunks_exact(4).filter(|p| p[0] > p[1].saturating_add(8)).count();
            if *name == "sound" && cut.is_none() {
                sound = seen;
            }
            let share = seen as f64 / sound.max(1) as f64;
            let like = images.get(1).map_or(1.0, |device| similarity(device, &images[0]));
            match cut.is_some() || (*least..=*most).contains(&share) {
                true if like >= 0.99 => Outcome::Works,
                true => Outcome::Degrades(format!("device and processor are alike to {like:.3} only")),
                false => Outcome::Fails(format!("{share:.2} of the sound block's pixels")),
            }
        });
        map.rows.push((*name).into());
        map.cells.push(cells.to_vec());
    }
    map
}
