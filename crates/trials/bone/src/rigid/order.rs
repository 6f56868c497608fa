//! How fast the error of every method falls with the voxel: smooth closed forms, and a bore that
//! the method drilled itself.
//!
//! # Theory
//! An error `e = C h^p` on voxels of h, h/2 and h/4 gives the order p, the slope of ln e over ln h
//! by least squares. The density is the distance to the closed form, in voxels, times a slope:
//! there is no blur that could shrink with the voxel, but for the scanned ball. All that is left
//! is the method's own error, that of the interpolation between voxels, which is of order 2, and
//! that of whole HU: 1/1600 voxel.
//!
//! A burr fed at a steady speed settles where its law takes a cylinder of its width at that speed:
//! a closed form for the depth. Its bore is a cylinder in which a smaller ball is pressed against
//! the wall.
//!
//! # Practice
//! Errors are root mean squares over directions, each with another place of the grid; the shaft
//! stands along the normal or the bore. An order
//! means little once the error is a few micrometres: the error on the finest voxels stands beside
//! it.

use super::STIFFNESS;
use super::solid::directions;
use glam::DVec3;
use trepan_bone::BoneVolume;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pose, Quat, Tool, ToolState, Vec3};
use trepan_rigid::removal::{Pressed, RemovalLaw};
use trepan_rigid::{Method, RigidStep};
use trepan_rivals::Family;
use trepan_volume::VoxelVolume;

/// Voxels, mm: h, h/2, h/4.
const VOXELS_MM: [f64; 3] = [2.0, 1.0, 0.5];
/// Isovalue, HU, and the density's fall through a smooth surface, HU a voxel.
const ISO: f64 = 400.0;
const SMOOTH_HU: f64 = 800.0;
/// The same through the plane that is drilled.
const STEEP_HU: f64 = 1000.0;
/// Density of the bone that is drilled, HU.
const BONE_HU: f64 = 1500.0;
/// Radius of ball and burr, of the smooth forms, and of the ball in the bore, mm.
const BALL_MM: f64 = 3.0;
const FORM_MM: f64 = 6.0;
const SMALL_MM: f64 = 2.0;
/// Depth of a press, mm.
const PRESS_MM: f64 = 0.5;
/// Feed of the burr, mm a tick of 1 ms, and how far it goes, mm: its depth has settled by then.
const FEED_MM: f64 = 1e-3;
const DEEP_MM: f64 = 9.0;
/// Least orders, and the largest error on the finest voxels in the bore, mm.
const SMOOTH_ORDER: f64 = 1.8;
const BORE_ORDER: f64 = 1.5;
const BORE_MM: f64 = 0.01;

/// A form: its signed distance, mm, positive outside of the bone. For each direction it has a place
/// on its surface, mm, and the unit vector from bone to air there.
struct Form {
    name: &'static str,
    distance: fn(DVec3) -> f64,
    place: fn(DVec3) -> DVec3,
    outward: fn(DVec3) -> DVec3,
    /// How the density follows the distance.
    density: Density,
}

/// How a density follows the distance to the surface.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Density {
    /// [`SMOOTH_HU`] a voxel.
    Even,
    /// As a scanner sees an edge: blurred, with noise.
    Scanned,
}

impl Density {
    /// Over the isovalue, HU, at a place so far outside.
    fn over(self, place: DVec3, outside_mm: f64, voxel_mm: f64) -> f64 {
        let outside = outside_mm / voxel_mm;
        match self {
            Self::Even => -SMOOTH_HU * outside,
            // The logistic curve whose slope and shape are nearest to those of a blurred step.
            Self::Scanned => EDGE_HU * (1.702 * outside / BLUR_VOXELS / -2.0).tanh() + NOISE_HU * noise(place),
        }
    }
}

/// A number of about a standard normal distribution for each place.
fn noise(place: DVec3) -> f64 {
    let bits = place.to_array().map(|x| (x * 1024.0).round() as i64 as u64);
    let seed = bits.into_iter().fold(0, |seed: u64, bits| (seed ^ bits).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let mut random = fastrand::Rng::with_seed(seed);
    (0..12).map(|_| random.f64()).sum::<f64>() - 6.0
}

/// Half the step of the density at a scanned edge, HU.
const EDGE_HU: f64 = 1000.0;
/// Standard deviation of a scanner's blur, voxels: full width at half maximum of 1.25.
const BLUR_VOXELS: f64 = 0.53;
/// That of its noise, HU.
const NOISE_HU: f64 = 20.0;

const BALL: Form = Form {
    name: "ball",
    distance: |p| p.length() - FORM_MM,
    place: |d| FORM_MM * d,
    outward: |d| d,
    density: Density::Even,
};

const FORMS: [Form; 7] = [
    BALL,
    Form { name: HOLLOW, distance: |p| FORM_MM - p.length(), outward: |d| -d, ..BALL },
    Form {
        name: "cylinder",
        distance: |p| p.reject_from_normalized(AXIS).length() - FORM_MM,
        place: |d| FORM_MM * across(d),
        outward: across,
        ..BALL
    },
    Form {
        name: "torus",
        distance: |p| p.distance(RING_MM * across(p)) - TUBE_MM,
        place: |d| RING_MM * across(d) + TUBE_MM * on_tube(d),
        outward: on_tube,
        ..BALL
    },
    Form { name: "gyroid", distance: gyroid_mm, place: on_gyroid, outward: |d| gyroid_rise(on_gyroid(d)), ..BALL },
    Form { name: "wedge", distance: wedge_mm, place: |d| 2.0 * d.dot(EDGE) * EDGE, outward: |_| WEDGE, ..BALL },
    Form { name: "scanned ball", density: Density::Scanned, ..BALL },
];
/// Forms without limits: a wedge is not smooth, and a scanner's blur moves what is bent.
const UNBOUND: [&str; 2] = ["order: wedge", "order: scanned ball"];

/// Period of the gyroid, mm: it bends with a radius of 6 mm at least.
const PERIOD_MM: f64 = 40.0;

/// 0 on the gyroid and like a distance near it, mm.
fn gyroid_mm(p: DVec3) -> f64 {
    let (sin, cos) = gyroid_angles(p);
    (sin.x * cos.y + sin.y * cos.z + sin.z * cos.x) * PERIOD_MM / (std::f64::consts::TAU * 1.4)
}

fn gyroid_angles(p: DVec3) -> (DVec3, DVec3) {
    let angle = p * std::f64::consts::TAU / PERIOD_MM;
    (angle.map(f64::sin), angle.map(f64::cos))
}

/// The unit vector along which [`gyroid_mm`] rises.
fn gyroid_rise(p: DVec3) -> DVec3 {
    let (sin, cos) = gyroid_angles(p);
    DVec3::new(cos.x * cos.y - sin.z * sin.x, cos.y * cos.z - sin.x * sin.y, cos.z * cos.x - sin.y * sin.z).normalize()
}

/// The place on the gyroid by Newton's steps from 6 mm off the origin in a direction.
fn on_gyroid(direction: DVec3) -> DVec3 {
    let step = |p: DVec3, _| p - gyroid_mm(p) * gyroid_rise(p);
    (0..60).fold(FORM_MM * direction, step)
}

/// Half the angle of the wedge: 80 degrees in all.
const SLANT: f64 = 0.698;
/// Unit vector along the wedge's edge, and the one that halves its angle, out of the bone.
const EDGE: DVec3 = DVec3::new(0.8, 0.36, -0.48);
const WEDGE: DVec3 = DVec3::new(-0.48, 0.864, -0.152);

/// Signed distance from a wedge, mm.
fn wedge_mm(p: DVec3) -> f64 {
    let (up, side) = (p.dot(WEDGE), p.dot(WEDGE.cross(EDGE)).abs());
    let (sin, cos) = SLANT.sin_cos();
    let (over, along) = (sin * up + cos * side, cos * up - sin * side);
    // Beyond the edge it is the edge itself that is nearest.
    if along > 0.0 && over > 0.0 { over.hypot(along) } else { over }
}
/// Radius of the torus's middle line and of its tube, mm: it is a saddle on its inner side.
const RING_MM: f64 = 8.5;
const TUBE_MM: f64 = 4.0;

/// Unit vector across [`AXIS`] towards a direction.
fn across(direction: DVec3) -> DVec3 {
    direction.reject_from_normalized(AXIS).normalize_or_zero()
}

/// Unit vector out of the torus's tube: all around it as the direction goes along the axis.
fn on_tube(direction: DVec3) -> DVec3 {
    let (sin, cos) = (std::f64::consts::PI * direction.dot(AXIS)).sin_cos();
    cos * across(direction) + sin * AXIS
}
const HOLLOW: &str = "hollow ball";
/// A direction askew to the grid.
const AXIS: DVec3 = DVec3::new(0.36, 0.48, 0.8);

/// One part for each form and one for the bore.
pub fn parts() -> Vec<Part> {
    let smooth = FORMS.iter().map(|form| {
        Part::new(format!("order on a {}", form.name), move |scope, findings: &mut Findings| {
            let count = scope.pick(6, 24);
            findings.rows.extend(row_of_all(form.name, scope, |method, voxel_mm| {
                let errors = places(count).map(|(n, direction)| press(form, method, voxel_mm, direction, n));
                Errors::over(errors)
            }));
        })
    });
    let bore = Part::new("order in a bore", |scope, findings: &mut Findings| {
        let count = scope.pick(6, 24);
        findings.rows.extend(row_of_all("bore", scope, |method, voxel_mm| drill(method, voxel_mm, count)));
    });
    smooth.chain([bore]).collect()
}

/// Errors of one setting.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Vector of force, N.
    force_n: f64,
    /// Along the true normal, mm.
    depth_mm: f64,
    /// Degrees.
    normal_deg: f64,
    /// Across the true normal, mm.
    tangent_mm: f64,
}

impl Errors {
    /// Of a lift, mm, that should be `truth`.
    fn of(lift: DVec3, truth: DVec3) -> Self {
        let (normal, off) = (truth.normalize(), lift - truth);
        let angle = lift.angle_between(truth).to_degrees();
        Self {
            force_n: f64::from(STIFFNESS) * off.length(),
            depth_mm: off.dot(normal).abs(),
            normal_deg: if angle.is_finite() { angle } else { 180.0 },
            tangent_mm: off.reject_from_normalized(normal).length(),
        }
    }

    /// Root mean squares.
    fn over(all: impl Iterator<Item = Self>) -> Self {
        let all: Vec<Self> = all.collect();
        let rms =
            |of: fn(&Self) -> f64| (all.iter().map(|e| of(e).powi(2)).sum::<f64>() / all.len().max(1) as f64).sqrt();
        Self {
            force_n: rms(|e| e.force_n),
            depth_mm: rms(|e| e.depth_mm),
            normal_deg: rms(|e| e.normal_deg),
            tangent_mm: rms(|e| e.tangent_mm),
        }
    }

    fn named(self) -> [(&'static str, f64); 4] {
        [
            ("force_error_n", self.force_n),
            ("depth_error_mm", self.depth_mm),
            ("normal_error_deg", self.normal_deg),
            ("tangent_error_mm", self.tangent_mm),
        ]
    }
}

/// The order by which `errors` fall with [`VOXELS_MM`]: the slope of their logarithms.
fn order(errors: [f64; 3]) -> f64 {
    let (x, y) = (VOXELS_MM.map(f64::ln), errors.map(|e| e.max(1e-9).ln()));
    let mean = |of: [f64; 3]| of.iter().sum::<f64>() / 3.0;
    let (mx, my) = (mean(x), mean(y));
    let both = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    both / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
}

/// The row of every method in a scene. Quick runs leave the oracle out, which is slow.
fn row_of_all(scene: &str, scope: Scope, errors: impl Fn(&Method, f64) -> Errors) -> Vec<Row> {
    // A shaft would stand in the far wall of a cavity or ring.
    let fits = |method: &Method| ![HOLLOW, "torus", "gyroid"].contains(&scene) || !method.has_shaft();
    let in_scope = |method: &Method| scope.pick(false, true) || !method.descriptor().is_oracle;
    let all = Method::all().into_iter().filter(|method| fits(method) && in_scope(method));
    let row = |method: Method| {
        let found = VOXELS_MM.map(|voxel_mm| errors(&method, voxel_mm));
        let mut row = Row::new(format!("order: {scene}"), method.name()).with("voxels_mm", VOXELS_MM.to_vec());
        for (n, (name, finest)) in found[2].named().into_iter().enumerate() {
            let each = found.map(|errors| errors.named()[n].1);
            row = row.with(name, each.to_vec()).metric(&format!("{name}_at_the_finest"), finest);
            row = row.metric(&format!("{name}_order"), order(each));
        }
        row
    };
    all.map(row).collect()
}

/// Bone of a density over the isovalue, HU, in a cube around `middle`.
fn bone(voxel_mm: f64, half_mm: f64, middle: DVec3, over: impl Fn(DVec3) -> f64) -> BoneVolume {
    let edge = (2.0 * half_mm / voxel_mm) as usize + 1;
    let mut ct = VoxelVolume::isotropic([edge; 3], (middle - half_mm).as_vec3(), voxel_mm as f32, 0i16);
    for at in 0..ct.data.len() {
        let place = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]);
        ct.data[at] = (ISO + over(place)).clamp(-1000.0, BONE_HU).round() as i16;
    }
    BoneVolume::new(&ct, ISO as i16).expect("there is bone")
}

/// Directions spread evenly, with their numbers.
fn places(count: usize) -> impl Iterator<Item = (usize, DVec3)> {
    directions(count).into_iter().map(|direction| direction.as_dvec3().normalize()).enumerate()
}

/// Another place of the grid for each direction, as a share of the largest voxel.
fn shift(n: usize) -> DVec3 {
    let share = |step: f64| (step * (n + 1) as f64).fract() - 0.5;
    VOXELS_MM[0] * DVec3::new(share(0.6180), share(0.4142), share(0.7320))
}

/// A tool whose shaft stands along `axis`.
fn at(place: DVec3, axis: DVec3) -> ToolState {
    ToolState::at(Pose::from_parts(place.as_vec3(), Quat::from_rotation_arc(Vec3::Z, axis.as_vec3().normalize())))
}

/// Presses a ball against a form, straight in, and gives its errors there.
fn press(form: &Form, method: &Method, voxel_mm: f64, direction: DVec3, n: usize) -> Errors {
    let (place, outward) = ((form.place)(direction), (form.outward)(direction));
    let half_mm = place.length() + 8.0;
    let bone = bone(voxel_mm, half_mm, shift(n), |p| form.density.over(p, (form.distance)(p), voxel_mm));
    let held = |over_mm: f64| at(place + (BALL_MM + over_mm) * outward, outward);
    let mut contact = method.build(&Tool::burr(BALL_MM as f32));
    contact.reset(held(1.0).world_from_tool);
    let mut out = RigidStep::default();
    for tick in 0..40 {
        contact.step(&bone, &held(1.0 - (0.05 * f64::from(tick)).min(1.0 + PRESS_MM)), false, 1.0, &mut out);
    }
    Errors::of((out.manifold.depth_mm * out.manifold.normal).as_dvec3(), PRESS_MM * outward)
}

/// Drills a bore and presses a smaller ball against its wall. The depth is the worse of the two.
fn drill(method: &Method, voxel_mm: f64, count: usize) -> Errors {
    let bone = bone(voxel_mm, 14.0, shift(3), |p| -STEEP_HU * (p.dot(AXIS) - 4.0));
    let mut contact = method.build(&Tool::burr(BALL_MM as f32));
    let device = |tick: usize| AXIS * (4.0 + BALL_MM + 0.1 - FEED_MM * tick as f64);
    contact.reset(at(device(0), AXIS).world_from_tool);
    let (mut out, mut errors) = (RigidStep::default(), Vec::new());
    let (ticks, whole) = ((DEEP_MM / FEED_MM) as usize, ((DEEP_MM - 1.0) / FEED_MM) as usize);
    let steady = steady_mm() * AXIS;
    for tick in 0..ticks {
        contact.step(&bone, &at(device(tick), AXIS), true, 1.0, &mut out);
        if tick > whole {
            errors.push(Errors::of((out.manifold.depth_mm * out.manifold.normal).as_dvec3(), steady));
        }
    }
    let fed = Errors::over(errors.into_iter());
    let bottom = device(ticks) + steady;
    let (right, up) = AXIS.any_orthonormal_pair();
    let wall = (0..count).map(|n| {
        let (sin, cos) = (std::f64::consts::TAU * (n as f64 + 0.3) / count as f64).sin_cos();
        let (aside, mut small) = (cos * right + sin * up, method.build(&Tool::burr(SMALL_MM as f32)));
        let held = |aside_mm: f64| at(bottom + AXIS + aside_mm * aside, AXIS);
        small.reset(held(0.0).world_from_tool);
        let mut out = RigidStep::default();
        for tick in 0..40 {
            let most = BALL_MM - SMALL_MM + PRESS_MM;
            small.step(&bone, &held((0.05 * f64::from(tick)).min(most)), false, 1.0, &mut out);
        }
        Errors::of((out.manifold.depth_mm * out.manifold.normal).as_dvec3(), -PRESS_MM * aside)
    });
    let wall = Errors::over(wall);
    Errors {
        force_n: fed.force_n.max(wall.force_n),
        depth_mm: fed.depth_mm.max(wall.depth_mm),
        normal_deg: fed.normal_deg.max(wall.normal_deg),
        tangent_mm: fed.tangent_mm.max(wall.tangent_mm),
    }
}

/// The depth at which the law takes a cylinder of the burr's width at the speed of the feed, mm.
/// The bone has the density at which the law's energy is given.
fn steady_mm() -> f64 {
    let wanted = (std::f64::consts::PI * BALL_MM * BALL_MM * FEED_MM) as f32;
    let (mut low, mut high) = (0.0f32, 3.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        let pressed = Pressed { radius_mm: BALL_MM as f32, depth_mm: middle, cosine: 1.0, dt_ms: 1.0 };
        let less = RemovalLaw::RATE.volume_mm3(&pressed) < wanted;
        (low, high) = if less { (middle, high) } else { (low, middle) };
    }
    low.into()
}

/// The orders that the recommended method reaches.
pub fn judge(findings: &mut Findings) {
    let own = findings.rows.iter().filter(|row| row.method == Method::RECOMMENDED.name());
    let bound = |row: &&Row| row.scene.starts_with("order: ") && !UNBOUND.contains(&row.scene.as_str());
    for row in own.filter(bound) {
        let in_bore = row.scene.ends_with("bore");
        for (what, metric) in [("force", "force_error_n_order"), ("depth", "depth_error_mm_order")] {
            let least = if in_bore { BORE_ORDER } else { SMOOTH_ORDER };
            let name = format!("{}: order of the error of {what}", row.scene);
            findings.gates.push(Gate::at_least(name, row.metrics[metric], least));
        }
        if in_bore {
            let name = "order: bore: error of depth on the finest voxels, mm";
            let finest = row.metrics["depth_error_mm_at_the_finest"];
            findings.gates.push(Gate::at_most(name, finest, BORE_MM));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_the_power_of_the_voxel() {
        assert!((order(VOXELS_MM.map(|h| 0.3 * h * h)) - 2.0).abs() < 1e-12);
        assert!(order([0.1, 0.1, 0.1]).abs() < 1e-12);
    }

    #[test]
    fn an_error_is_split_along_and_across_the_normal() {
        let errors = Errors::of(DVec3::new(0.03, 0.0, 0.54), DVec3::new(0.0, 0.0, 0.5));
        assert!((errors.depth_mm - 0.04).abs() < 1e-12 && (errors.tangent_mm - 0.03).abs() < 1e-12);
        assert!((errors.force_n - 0.1).abs() < 1e-9 && (errors.normal_deg - 3.18).abs() < 0.01);
    }
}
