//! Masks that no brain looks like: does the mesher fill them soundly, lose volume, or say no?

use super::PROVEN_DEG;
use super::scenes::voxels;
use trepan_evidence::picture::Outcome;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_mesh::lattice::{self, Config, Fine};
use trepan_mesh::{Quality, Surface};
use trepan_trials_scenes::conditions;
use trepan_volume::VoxelVolume;

/// Volume that may be lost, as a share, before a mesh is only usable.
const LOST: f64 = 0.02;

type Condition = (&'static str, fn() -> VoxelVolume<u16>);

const CONDITIONS: [Condition; 11] = [
    ("a ball", || voxels(|p| u16::from(p.length() < 20.0))),
    ("one voxel", || voxels(|p| u16::from(p.abs().max_element() < 0.6))),
    ("a plate one voxel thick", || voxels(|p| u16::from(p.z.abs() < 0.6 && p.length() < 25.0))),
    ("a hollow shell two voxels thick", || voxels(|p| u16::from((p.length() - 20.0).abs() < 1.0))),
    ("two balls joined by a thread", || {
        voxels(|p| u16::from((p.abs() - Vec3::X * 15.0).length() < 10.0 || p.y.hypot(p.z) < 1.0 && p.x.abs() < 15.0))
    }),
    ("two balls apart", || voxels(|p| u16::from((p.abs() - Vec3::X * 15.0).length() < 10.0))),
    ("a checkerboard", || voxels(|p| u16::from((p.x + p.y + p.z).floor().rem_euclid(2.0) < 0.5 && p.length() < 15.0))),
    ("every second voxel at random", || {
        voxels(|p| {
            u16::from((p.dot(Vec3::new(12.99, 78.23, 37.72)).sin() * 43758.5).fract().abs() < 0.5 && p.length() < 15.0)
        })
    }),
    ("all of the volume", || voxels(|_| 1)),
    ("nothing", || voxels(|_| 0)),
    ("eight labels in a corner", || {
        voxels(|p| {
            if p.length() < 20.0 {
                1 + u16::from(p.x > 0.0) + 2 * u16::from(p.y > 0.0) + 4 * u16::from(p.z > 0.0)
            } else {
                0
            }
        })
    }),
];

/// The map of all ways of laying out the cubes.
pub fn run(findings: &mut Findings) {
    let base = Config { target_tets: 6000, ..Config::default() };
    let fine = Some(Fine { centre: Vec3::ZERO, radius_mm: 8.0, halvings: 2 });
    let ways = [
        ("one size", base),
        ("coarse inside", Config { coarsening: 2, ..base }),
        ("fine at a place", Config { coarsening: 1, fine, ..base }),
    ];
    let names = CONDITIONS.map(|(name, _)| name);
    conditions::judge("Odd masks", &names, &ways, |at, config| verdict(&CONDITIONS[at].1(), config), findings);
    let map = findings.maps.last().expect("it was just drawn");
    let failed = map.named_cells().filter(|(.., cell)| cell.grade() == 2).count();
    findings.gates.push(Gate::at_most("odd masks: meshes that are not sound", failed as f64, 0.0));
    for (way, config) in ways {
        let meshes = CONDITIONS.iter().filter_map(|(_, mask)| lattice::labelled(&mask(), &config).ok());
        let angles = meshes.map(|labelled| Quality::of(&labelled.mesh));
        let (least, most) = angles.fold((f64::INFINITY, 0.0f64), |(least, most), quality| {
            (least.min(quality.min_dihedral_deg), most.max(quality.max_dihedral_deg))
        });
        let [proven_least, proven_most] = PROVEN_DEG[usize::from(config.fine.is_some())];
        findings
            .rows
            .push(Row::new("odd masks", way).metric("min_dihedral_deg", least).metric("max_dihedral_deg", most));
        findings.gates.extend([
            Gate::at_least(format!("odd masks, {way}: smallest dihedral angle, degrees"), least, proven_least),
            Gate::at_most(format!("odd masks, {way}: largest dihedral angle, degrees"), most, proven_most),
        ]);
    }
}

fn verdict(labels: &VoxelVolume<u16>, config: &Config) -> Outcome {
    let labelled = match lattice::labelled(labels, config) {
        Ok(labelled) => labelled,
        Err(fault) => return Outcome::Refused(fault.to_string()),
    };
    let mesh = &labelled.mesh;
    let filled = labels.data.iter().filter(|label| **label != 0).count() as f64 * labels.voxel_mm3();
    let lost = 1.0 - mesh.total_mm3() / filled;
    if mesh.check().is_err() {
        Outcome::Fails("elements are not sound".into())
    } else if !Surface::of(mesh).is_closed() {
        Outcome::Fails("the surface is open".into())
    } else if lost.abs() > LOST {
        Outcome::Degrades("over a fiftieth of the volume is lost or won".into())
    } else {
        Outcome::Works
    }
}
