//! Bone, drilling, and hands that drill.
//!
//! # Theory
//! Chips and edges: the law's force on one tooth against the thickness of the chip, beside a saw
//! tooth and twist drills. Hands: the recommended method in a slab, pressed by a force or fed at a
//! speed, in newtons of the task. Plunge: an arm of mass m, damping b and stiffness k that presses
//! with F₀ and lets go a reaction time after the bone's force has fallen to half:
//! ```text
//! m ẍ = F₀ - k (x - x₀) - b ẋ - F_bone          x₀: where bone gave way
//! ```
//!
//! # Practice
//! Diameters and speeds that an abstract does not name are those of this project's tools, as the
//! rows say. How a group notices that the bone gave way, by touch, sound or sight, is assumed.

use super::comparison::{Comparison, How};
use glam::{DVec3, IVec3};
use trepan_bone::BoneVolume;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_measurements::{Row, drilling, hands, skull};
use trepan_rigid::removal::{Cutter, FORCE_SCALE, Pressed, RemovalLaw};
use trepan_rigid::{Method, RigidStep};
use trepan_trials_bone::rigid::bones::head;
use trepan_volume::VoxelVolume;

/// Edge of the slabs' voxels, mm.
const VOXEL_MM: f32 = 0.5;
/// Half the width of a slab, mm.
const HALF_MM: f32 = 10.0;
/// Speed that the abstracts on twist drills do not name, 1/min, and the lips of a drill.
const TWIST: (f64, f64) = (1000.0, 2.0);
/// Feed that the abstract on speed does not name, mm/s.
const FEED_MM_S: f64 = 1.0;
/// Step of a ray through the vault, mm.
const RAY_MM: f64 = 0.05;

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![
        Part::new("chips and edges", |_, findings| chips(findings)),
        Part::new("hands that drill", |_, findings| pressing(findings)),
        Part::new("layers of the vault", |_, findings| layers(findings)),
        Part::new("plunge", |_, findings| plunges(findings)),
        Part::new("vault of the built-in case", |_, findings| vault(findings)),
    ]
}

/// A cutter as blunt as a row says, µm.
fn blunt(edge: &Row) -> Cutter {
    Cutter { edge_mm: 1e-3 * edge.f32(), ..Cutter::BURR }
}

/// Chip of a twist drill at a feed, mm/s, and a speed, 1/min; µm.
fn twist_um(feed_mm_s: f64, rpm: f64) -> f64 {
    1e3 * feed_mm_s / (rpm / 60.0 * TWIST.1)
}

fn chips(findings: &mut Findings) {
    let ratio =
        |cutter: &Cutter, um: f64, other: f64| f64::from(cutter.force_ratio(1e-3 * um as f32, 1e-3 * other as f32));
    let (tooth, drill) = (blunt(&drilling::SAW_TOOTH_EDGE), blunt(&drilling::TWIST_EDGE));
    let slow = twist_um(FEED_MM_S, TWIST.0);
    let speed = ratio(&drill, slow / 1.5, slow);
    let one_edge = "the law has one bluntness for thrust and cutting force; at 2 to 10 um the measured tooth cuts with \
                    its edge alone, while its thrust still grows with the chip";
    let clogs = "torque of a drill 6 mm deep also turns the chips in its flutes, which falls with their volume; the law \
                 has no flutes";
    let compared = [
        Comparison::of(&drilling::SAW_TOOTH_THRUST_RATIO, How::Fitted, ratio(&tooth, 10.0, 2.0)),
        Comparison::of(&drilling::SAW_TOOTH_RESULTANT_RATIO, How::Predicted, ratio(&tooth, 10.0, 2.5)),
        Comparison::of(&drilling::SAW_TOOTH_CUTTING_RATIO, How::Predicted, ratio(&tooth, 10.0, 2.0)).why(one_edge),
        Comparison::of(&drilling::SAW_TOOTH_SPEED_RATIO, How::Predicted, speed_ratio(1.7, 7.0)),
        Comparison::of(
            &drilling::TWIST_FEED_RATIO,
            How::Fitted,
            ratio(&drill, twist_um(3.0, TWIST.0), twist_um(0.5, TWIST.0)),
        ),
        Comparison::of(&drilling::TWIST_SPEED_RATIO_COW, How::Predicted, speed)
            .why("the feed, which the abstract does not name, decides: thicker chips come nearer to 1/1.5"),
        Comparison::of(&drilling::TWIST_SPEED_RATIO_PIG, How::Predicted, speed),
        Comparison::of(&drilling::TWIST_TORQUE_RATIO_COW, How::Predicted, speed).why(clogs),
        Comparison::of(&drilling::TWIST_TORQUE_RATIO_PIG, How::Predicted, speed).why(clogs),
    ];
    findings.rows.extend(compared.iter().map(Comparison::row));
    let curve = |cutter: Cutter, from: f64, to: f64| {
        let at = |n: i32| from * (to / from).powf(f64::from(n) / 40.0);
        (0..=40).map(|n| (at(n), ratio(&cutter, at(n), from))).collect::<Vec<_>>()
    };
    let twist = [twist_um(0.5, TWIST.0), twist_um(3.0, TWIST.0)];
    let lines = [
        ("saw tooth, law", curve(tooth, 2.0, 10.0)),
        ("saw tooth, thrust measured", vec![(2.0, 1.0), (10.0, drilling::SAW_TOOTH_THRUST_RATIO.value)]),
        ("saw tooth, resultant measured", vec![(2.5, 1.0), (10.0, drilling::SAW_TOOTH_RESULTANT_RATIO.value)]),
        ("twist drill, law", curve(drill, twist[0], twist[1])),
        ("twist drill, thrust measured", vec![(twist[0], 1.0), (twist[1], drilling::TWIST_FEED_RATIO.value)]),
    ];
    let named = lines.map(|(name, points)| (name.to_string(), points));
    findings.series.push(Series::over("Force against chip", ["chip, um", "force over that of the thinnest"], named));
    let energy = |cutter: Cutter, from: f64, to: f64| {
        let at = |n: i32| from * (to / from).powf(f64::from(n) / 40.0);
        (0..=40).map(|n| (at(n), 1e-3 * f64::from(cutter.energy_mpa(1e-3 * at(n) as f32)))).collect::<Vec<_>>()
    };
    let range = |end: &Row| vec![(20.0, 1e-3 * end.value), (100.0, 1e-3 * end.value)];
    let lines = [
        ("burr, fitted to hands", energy(Cutter::BURR, 0.1, 3.0)),
        ("perforator", energy(Cutter::PERFORATOR, 10.0, 100.0)),
        ("cortical bone, lower end (from memory)", range(&drilling::ENERGY_LEAST)),
        ("cortical bone, upper end (from memory)", range(&drilling::ENERGY_GREATEST)),
    ];
    let named = lines.map(|(name, points)| (name.to_string(), points));
    findings.series.push(Series::over("Energy against chip", ["chip, um", "energy, J/mm3"], named));
}

/// Force of the law on a tooth at a fast speed over that at a slow one, m/s, with the same chip.
///
/// The spindle turns as fast as both need, and volume goes with the speed.
fn speed_ratio(slow: f64, fast: f64) -> f64 {
    let radius_mm = 3.0;
    let force = |speed: f64| {
        let rpm = (speed / (f64::from(Cutter::BURR.pole_share) * radius_mm) * 60_000.0 / std::f64::consts::TAU) as f32;
        let spindle = trepan_rigid::spindle::Spindle { free_rpm: rpm, power_w: 1e6, stall_rpm: 1.0 };
        let law = with_cutter(Cutter { spindle, ..Cutter::BURR });
        // The chip is volume over speed: as much for each metre at both.
        force_n(&law, radius_mm as f32, (1e-3 * speed) as f32)
    };
    force(fast) / force(slow)
}

fn with_cutter(cutter: Cutter) -> RemovalLaw {
    let RemovalLaw::Rate { perforator, cancellous_share, stiffness, max_load_n, .. } = RemovalLaw::RATE else {
        unreachable!("the default is a rate")
    };
    RemovalLaw::Rate { cutter, perforator, cancellous_share, stiffness, max_load_n }
}

/// Stiffness of the task, N/mm.
fn stiffness() -> f32 {
    drilling::CONTACT_STIFFNESS.f32() / FORCE_SCALE
}

/// Force at which the law takes a volume of dense bone per ms, mm³, N of the task.
fn force_n(law: &RemovalLaw, radius_mm: f32, mm3_per_ms: f32) -> f64 {
    let (mut low, mut high) = (0.0f32, hands::DRILLING_PEAK_GREATEST.f32() / stiffness());
    for _ in 0..60 {
        let depth_mm = 0.5 * (low + high);
        let less = law.volume_mm3(&Pressed { radius_mm, depth_mm, cosine: 1.0, dt_ms: 1.0 }) < mm3_per_ms;
        (low, high) = if less { (depth_mm, high) } else { (low, depth_mm) };
    }
    f64::from(low * stiffness())
}

/// A slab from z = 0 down to a depth, mm, with a density, HU, by the depth.
fn slab(thick_mm: f32, hu: impl Fn(f32) -> f32) -> BoneVolume {
    let dims = [2.0 * HALF_MM, 2.0 * HALF_MM, thick_mm + 12.0].map(|mm| (mm / VOXEL_MM) as usize);
    let origin = Vec3::new(-HALF_MM, -HALF_MM, -thick_mm - 4.0);
    let mut ct = VoxelVolume::isotropic(dims, origin, VOXEL_MM, 0i16);
    let isovalue = 400.0;
    for at in 0..ct.data.len() {
        let z = origin.z + VOXEL_MM * (at / (dims[0] * dims[1])) as f32;
        let inside = (-z).min(z + thick_mm);
        ct.data[at] = (isovalue + 2200.0 * inside).clamp(-1000.0, hu(-z)) as i16;
    }
    BoneVolume::new(&ct, isovalue as i16).expect("a slab has bone")
}

/// Time that a tool pressed by a force, N of the task, takes through so much dense bone, s.
///
/// In its own bore; NaN if it does not get through in a minute.
fn through_s(tool: &Tool, newtons: f64, thick_mm: f32) -> f64 {
    let bone = slab(thick_mm + tool.tip_radius_mm + 1.0, |_| skull::DENSITY_OF_REFERENCE.f32());
    let mut contact = Method::RECOMMENDED.build(tool);
    contact.reset(Pose::from_translation(Vec3::Z * tool.tip_radius_mm));
    let (mut out, press_mm, mut begins) = (RigidStep::default(), newtons as f32 / stiffness(), None);
    for ms in 0..60_000u16 {
        let device = contact.proxy().translation - press_mm * Vec3::Z;
        contact.step(&bone, &ToolState::at(Pose::from_translation(device)), true, 1.0, &mut out);
        // The bore is as wide as the tool from where its centre lies at the surface.
        let depth_mm = -contact.proxy().translation.z;
        begins = begins.or((depth_mm >= 0.0).then_some(ms));
        if let Some(from) = begins.filter(|_| depth_mm >= thick_mm) {
            return 1e-3 * f64::from(ms - from);
        }
    }
    f64::NAN
}

fn pressing(findings: &mut Findings) {
    let thick_mm = skull::THICKNESS_PARIETAL.f32();
    let mean_n = hands::DRILLING_FORCE.value;
    let speed = thick_mm / (1e3 * drilling::TIME_PERFORATOR.f32());
    let law = RemovalLaw::RATE;
    let fed =
        |radius_mm: f32, speed: f32| force_n(&law, radius_mm, std::f32::consts::PI * radius_mm * radius_mm * speed);
    let compared = [
        Comparison::of(&drilling::TIME_PERFORATOR, How::Fitted, through_s(&Tool::burr(3.0), mean_n, thick_mm)),
        Comparison::of(&drilling::TIME_PERFORATOR, How::Fitted, through_s(&Tool::perforator(), mean_n, thick_mm)),
        Comparison::of(&hands::DRILLING_FORCE, How::Fitted, fed(3.0, speed)),
        Comparison::of(&hands::DRILLING_FORCE_LEAST, How::Fitted, f64::from(Cutter::BURR.rubbing_n(3.0))),
        Comparison::of(&hands::DRILLING_FORCE_MEAN, How::Predicted, fed(2.0, speed)),
    ];
    findings.rows.extend(compared.iter().map(Comparison::row));
    let speeds = || (0..=30).map(|n| 0.08 * f64::from(n));
    let line = |radius_mm: f32| speeds().map(|mm_s| (mm_s, fed(radius_mm, 1e-3 * mm_s as f32))).collect::<Vec<_>>();
    let across = |row: &Row| vec![(0.0, row.value), (2.4, row.value)];
    let lines = [
        ("6 mm burr", line(3.0)),
        ("4 mm burr", line(2.0)),
        ("hands: least mean", across(&hands::DRILLING_FORCE_LEAST)),
        ("hands: mean", across(&hands::DRILLING_FORCE_MEAN)),
        ("hands: greatest mean", across(&hands::DRILLING_FORCE_GREATEST)),
    ];
    let named = lines.map(|(name, points)| (name.to_string(), points));
    let axes = ["feed, mm/s", "force of the task, N"];
    findings.series.push(Series::over("Force against feed, dense bone", axes, named));
    let time = |newtons: f64| through_s(&Tool::burr(3.0), newtons, thick_mm);
    let forces = [6.0, 8.0, 10.0, 14.0, 18.0];
    let times = vec![("6 mm burr".to_string(), forces.map(|n| (n, time(n))).to_vec())];
    let axes = ["force of the task, N", "time, s"];
    findings.series.push(Series::over("Time through the mean parietal bone, dense", axes, times));
}

/// Force through outer table, diploe and inner table at a steady feed, by the angle of the tool.
fn layers(findings: &mut Findings) {
    let dense = skull::DENSITY_OF_REFERENCE.f32();
    let hu = move |depth: f32| if (2.0..5.0).contains(&depth) { 700.0 } else { dense };
    let at = |axis: Vec3| {
        let bone = slab(7.0, hu);
        let mut contact = Method::RECOMMENDED.build(&Tool::burr(2.0));
        let rotation = trepan_geometry::Quat::from_rotation_arc(Vec3::Z, axis);
        contact.reset(Pose::from_parts(Vec3::Z * 2.1, rotation));
        let mut out = RigidStep::default();
        let tick = |ms: u16| {
            let depth_mm = 1e-3 * f32::from(ms) - 2.1;
            let pose = Pose::from_parts(-depth_mm * Vec3::Z, rotation);
            contact.step(&bone, &ToolState::at(pose), true, 1.0, &mut out);
            (f64::from(depth_mm + 2.0), f64::from(stiffness() * out.manifold.depth_mm))
        };
        (0..12_000).map(tick).collect::<Vec<_>>()
    };
    let lines = [("along its axis", Vec3::Z), ("tilted by 60 degrees", Vec3::new(0.866, 0.0, 0.5))];
    let named = lines.map(|(name, axis)| (name.to_string(), at(axis)));
    let axes = ["depth of the tool's pole, mm", "force of the task, N"];
    let title = "4 mm burr at 1 mm/s through outer table (2 mm), diploe (3 mm, 700 HU), inner table (2 mm)";
    findings.series.push(Series::over(title, axes, named));
}

/// How far past the far side a drill goes that is let go after a reaction time, mm.
///
/// The time begins where a hand notices that the bone's force falls.
fn plunge_mm(reaction_ms: f64) -> f64 {
    let (thick_mm, radius_mm) = (2.0f32, 1.5f32);
    let bone = slab(thick_mm, |_| skull::DENSITY_OF_REFERENCE.f32());
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(radius_mm));
    contact.reset(Pose::from_translation(Vec3::Z * radius_mm));
    let (mut out, mut through, mut noticed) = (RigidStep::default(), false, None);
    let pressed_n = hands::DRILLING_FORCE.value;
    let [mass, damping, spring] =
        [hands::DRILLING_ARM_MASS, hands::DRILLING_ARM_DAMPING, hands::DRILLING_ARM_STIFFNESS].map(|row| row.value);
    let (mut depth, mut speed) = (-f64::from(radius_mm) + pressed_n / f64::from(stiffness()), 0.0);
    for ms in 0..30_000 {
        let device = Vec3::NEG_Z * depth as f32;
        contact.step(&bone, &ToolState::at(Pose::from_translation(device)), true, 1.0, &mut out);
        let bone_n = f64::from(stiffness() * out.manifold.depth_mm * out.manifold.normal.z);
        through |= out.broke_through;
        let falls = through && bone_n < hands::DRILLING_NOTICE_SHARE.value * pressed_n;
        noticed = noticed.or(falls.then_some((f64::from(ms), depth)));
        let push_n = match noticed {
            Some((since, _)) if f64::from(ms) - since > reaction_ms => {
                return f64::from(radius_mm - thick_mm - contact.proxy().translation.z);
            }
            Some((_, from)) => pressed_n - spring * (depth - from),
            None => pressed_n,
        };
        speed += (push_n - bone_n - damping * speed) / mass;
        depth += speed;
    }
    f64::NAN
}

fn plunges(findings: &mut Findings) {
    let [touch, sound, sight] =
        [hands::REACTION_TOUCH, hands::REACTION_SOUND, hands::REACTION_SIGHT].map(|row| plunge_mm(row.value));
    let late = "novices press harder and go on pressing; 14 N and a reaction to sight explain two thirds of it";
    let harder = "six people with a 4.5 mm bit, which needs more force than the 14 N of the mean; the force was not \
                  measured";
    let compared = [
        Comparison::of(&hands::PLUNGE_SPECIALIST, How::Fitted, touch),
        Comparison::of(&hands::PLUNGE_SENIOR, How::Predicted, sound),
        Comparison::of(&hands::PLUNGE_JUNIOR, How::Predicted, sight),
        Comparison::of(&hands::PLUNGE_SHARP_EXPERIENCED, How::Predicted, touch),
        Comparison::of(&hands::PLUNGE_SHARP_INEXPERIENCED, How::Predicted, sight),
        Comparison::of(&hands::PLUNGE_EXPERIENCED, How::Predicted, touch),
        Comparison::of(&hands::PLUNGE_NOVICES, How::Predicted, sight).why(late),
        Comparison::of(&hands::PLUNGE_TWO_HANDS, How::Predicted, sight).why(harder),
        Comparison::of(&hands::PLUNGE_ONE_HAND, How::Predicted, sight).why(harder),
    ];
    findings.rows.extend(compared.iter().map(Comparison::row));
    let curve = (0..=6).map(|n| 50.0 * f64::from(n)).map(|ms| (ms, plunge_mm(ms))).collect();
    let measured = vec![
        (hands::REACTION_TOUCH.value, hands::PLUNGE_SPECIALIST.value),
        (hands::REACTION_SOUND.value, hands::PLUNGE_SENIOR.value),
        (hands::REACTION_SIGHT.value, hands::PLUNGE_JUNIOR.value),
    ];
    let lines = [("arm that presses with 14 N", curve), ("specialist, senior, junior, measured", measured)];
    let named = lines.map(|(name, points)| (name.to_string(), points));
    findings.series.push(Series::over("Plunge against reaction time", ["reaction time, ms", "plunge, mm"], named));
}

/// What a line through the vault meets.
#[derive(Clone, Copy)]
struct Chord {
    thick_mm: f64,
    mean_hu: f64,
    greatest_hu: f64,
}

/// Sites by their direction from the middle of the head, right, anterior and superior.
///
/// Midway from nasion to coronal suture, parietal eminence, anterior temporal bone, midway from
/// mastoid to occipital protuberance, temporal squama.
const SITES: [[f64; 3]; 5] =
    [[0.0, 1.0, 0.5], [0.8, -0.35, 0.6], [1.0, 0.35, -0.2], [0.5, -1.0, -0.4], [1.0, 0.1, -0.2]];
/// How far the middle of the head lies under its top, mm.
const MIDDLE_MM: f64 = 70.0;

fn vault(findings: &mut Findings) {
    let (ct, isovalue) = head();
    let ct = Scan { ct: &ct, isovalue: isovalue.into() };
    let (low, high) = ct.ct.world_corners();
    let top = ct.outermost(0.5 * (low + high), DVec3::Z).map_or(f64::NAN, |top| top.z);
    let middle = (0.5 * (low + high)).with_z(top - MIDDLE_MM);
    let [frontal, parietal, temporal, occipital, squama] = SITES.map(|site| ct.site(middle, DVec3::from(site)));
    let one_head = "one head, whose CT documents only the ratio of its voxels' sides, so that lengths are nominal; the \
                    site is that of a direction from the middle of the head";
    let oblique = "the axial plane cuts the parietal bone obliquely here: across, it is 8.5 mm thick in this one head, \
                   whose lengths are nominal";
    let uncalibrated = "the built-in CT's densities are stored values less 1024, never calibrated, and slices of 2 mm \
                        blur thin tables";
    let compared = [
        Comparison::of(&skull::THICKNESS_FRONTAL, How::Predicted, frontal.thick_mm).why(one_head),
        Comparison::of(&skull::THICKNESS_PARIETAL, How::Predicted, parietal.thick_mm).why(oblique),
        Comparison::of(&skull::THICKNESS_TEMPORAL, How::Predicted, temporal.thick_mm).why(one_head),
        Comparison::of(&skull::THICKNESS_OCCIPITAL, How::Predicted, occipital.thick_mm).why(one_head),
        Comparison::of(&skull::DENSITY_TEMPORAL_CORTEX, How::Predicted, squama.greatest_hu).why(uncalibrated),
        Comparison::of(&skull::DENSITY_DENSEST_SITE, How::Predicted, squama.mean_hu).why(uncalibrated),
    ];
    findings.rows.extend(compared.iter().map(Comparison::row));
}

/// A CT with the density at which bone begins, HU.
struct Scan<'a> {
    ct: &'a VoxelVolume<i16>,
    isovalue: f64,
}

impl Scan<'_> {
    /// Medians over a patch of the vault: thickness in the axial plane as in the published
    /// measurements, and densities along it.
    fn site(&self, middle: DVec3, towards: DVec3) -> Chord {
        let towards = towards.normalize();
        let (a, b) = towards.any_orthonormal_pair();
        let offsets = (-2..=2).flat_map(|i| (-2..=2).map(move |j| (0.05 * f64::from(i), 0.05 * f64::from(j))));
        let chord = |(i, j): (f64, f64)| {
            let outer = self.outermost(middle, (towards + i * a + j * b).normalize())?;
            let inward = (middle - outer).with_z(0.0).normalize();
            let turned = (-8..=8).map(|n| glam::DQuat::from_rotation_z(0.1 * f64::from(n)) * inward);
            turned.map(|way| self.chord(outer, way)).min_by(|p, q| p.thick_mm.total_cmp(&q.thick_mm))
        };
        let chords: Vec<Chord> = offsets.filter_map(chord).collect();
        let median = |of: fn(&Chord) -> f64| {
            let mut values: Vec<f64> = chords.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
        };
        Chord {
            thick_mm: median(|chord| chord.thick_mm),
            mean_hu: median(|chord| chord.mean_hu),
            greatest_hu: median(|chord| chord.greatest_hu),
        }
    }

    /// Where a ray outwards leaves the last bone.
    fn outermost(&self, from: DVec3, towards: DVec3) -> Option<DVec3> {
        let places = (0..2600).rev().map(|n| from + RAY_MM * f64::from(n) * towards);
        places.into_iter().find(|place| density(self.ct, *place) >= self.isovalue)
    }

    /// The bone along a way inwards, up to 3 mm without any.
    fn chord(&self, outer: DVec3, inward: DVec3) -> Chord {
        let along: Vec<f64> = (0..700).map(|n| density(self.ct, outer + RAY_MM * f64::from(n) * inward)).collect();
        let ends = |n: &usize| along[*n..*n + 60].iter().all(|hu| *hu < self.isovalue);
        let bone = &along[..(1..640).find(ends).unwrap_or(640)];
        Chord {
            thick_mm: RAY_MM * bone.len() as f64,
            mean_hu: bone.iter().sum::<f64>() / bone.len() as f64,
            greatest_hu: bone.iter().copied().fold(f64::MIN, f64::max),
        }
    }
}

/// Trilinear density, HU; air outside.
fn density(ct: &VoxelVolume<i16>, place: DVec3) -> f64 {
    let grid = ct.world_from_voxel.inverse().transform_point3(place);
    let (low, t) = (grid.floor().as_ivec3(), grid - grid.floor());
    let dims = IVec3::from_array(ct.dims.map(|n| n as i32));
    let at = |corner: IVec3| {
        let voxel = low + corner;
        let held = voxel.cmpge(IVec3::ZERO).all() && voxel.cmplt(dims).all();
        let index = (voxel.z * dims.y + voxel.y) * dims.x + voxel.x;
        if held { f64::from(ct.data[index as usize]) } else { f64::from(trepan_volume::AIR_HU) }
    };
    let corners = (0..8).map(|n| IVec3::new(n & 1, n >> 1 & 1, n >> 2));
    let weight = |corner: IVec3| {
        let share = corner.as_dvec3() * t + (1 - corner).as_dvec3() * (1.0 - t);
        share.x * share.y * share.z
    };
    corners.map(|corner| weight(corner) * at(corner)).sum()
}
