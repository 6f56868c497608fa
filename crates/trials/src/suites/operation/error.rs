//! How far one run of the operation is from the finest one.

use super::ride::{LOOK_MS, PLACE_MM, Ride};
use trepan_geometry::{Vec3, quantile};

/// A force under this is no contact, N.
const FELT_N: f32 = 0.02;

/// What differs.
pub struct Errors {
    /// Error of the force while the probe touches no bone, root mean square, N. It counts where one
    /// of the two feels something.
    pub tissue_rms_n: f64,
    /// The same: what 95 of 100 ticks stay under.
    pub tissue_p95_n: f64,
    /// Error of the brain's surface at the opening, mm, while the probe is in the hand. It is the
    /// distance from where the finest run shows it to the nearest place of this run's brain.
    pub shown_mean_mm: f64,
    /// See above: what 95 of 100 places and looks stay under.
    pub shown_p95_mm: f64,
    /// The same before anything has touched the brain: what the coarser shape alone does.
    pub rest_p95_mm: f64,
    /// From this run's brain at rest at the opening to the surface of the mask that both were made
    /// of, mm.
    pub mask_p95_mm: f64,
    /// Bone that is gone in one run only, mm³.
    pub bone_mm3: f64,
    /// Overlap of the bone that is gone (Dice 1945).
    pub bone_dice: f64,
}

impl Errors {
    /// Of a run from the finest one along the same path.
    pub fn between(ride: &Ride, truth: &Ride) -> Self {
        let on_tissue = |tick: &usize| truth.probing[*tick] && !ride.on_bone[*tick] && !truth.on_bone[*tick];
        let apart_n = |tick: usize| {
            let (a, b) = (ride.forces[tick], truth.forces[tick]);
            (a.length() > FELT_N || b.length() > FELT_N).then(|| f64::from(a.distance(b)))
        };
        let mut tissue: Vec<f64> = (0..truth.forces.len()).filter(on_tissue).filter_map(apart_n).collect();
        let (mut rest, mut shown) = surfaces(ride, truth);
        let both = ride.removed.iter().zip(&truth.removed);
        let count = |wanted: fn(bool, bool) -> bool| both.clone().filter(|(a, b)| wanted(**a, **b)).count() as f64;
        let (common, apart) = (count(|a, b| a && b), count(|a, b| a != b));
        Self {
            tissue_rms_n: rms(&tissue),
            tissue_p95_n: quantile(&mut tissue, 0.95),
            shown_mean_mm: shown.iter().sum::<f64>() / shown.len() as f64,
            shown_p95_mm: quantile(&mut shown, 0.95),
            rest_p95_mm: quantile(&mut rest, 0.95),
            mask_p95_mm: quantile(&mut ride.from_mask_mm.iter().copied().map(f64::from).collect::<Vec<_>>(), 0.95),
            bone_mm3: apart * f64::from(PLACE_MM.powi(3)),
            bone_dice: 2.0 * common / (2.0 * common + apart),
        }
    }

    /// By their names with units.
    pub fn named(&self) -> [(&'static str, f64); 8] {
        [
            ("tissue_force_error_rms_n", self.tissue_rms_n),
            ("tissue_force_error_p95_n", self.tissue_p95_n),
            ("shown_error_mean_mm", self.shown_mean_mm),
            ("shown_error_p95_mm", self.shown_p95_mm),
            ("rest_error_p95_mm", self.rest_p95_mm),
            ("rest_from_mask_p95_mm", self.mask_p95_mm),
            ("bone_error_mm3", self.bone_mm3),
            ("bone_dice", self.bone_dice),
        ]
    }
}

/// Distances of the surfaces in the first look, and in every look while the brain is probed.
fn surfaces(ride: &Ride, truth: &Ride) -> (Vec<f64>, Vec<f64>) {
    let probing = |look: usize| truth.probing[(look + 1) * LOOK_MS as usize - 1];
    let apart = |look: usize| {
        let (is, was) = (&ride.looks[look].triangles, &truth.looks[look].seen);
        was.iter().map(|seen| is.iter().map(|corners| distance_mm(*seen, corners)).fold(f64::INFINITY, f64::min))
    };
    (apart(0).collect(), (0..truth.looks.len()).filter(|&look| probing(look)).flat_map(apart).collect())
}

/// From a point to a triangle, mm: to its plane where the foot lies inside, else to the nearest
/// edge.
fn distance_mm(point: Vec3, &[a, b, c]: &[Vec3; 3]) -> f64 {
    let to_edge = |(from, to): (Vec3, Vec3)| {
        let share = (point - from).dot(to - from) / (to - from).length_squared().max(f32::MIN_POSITIVE);
        point.distance(from + share.clamp(0.0, 1.0) * (to - from))
    };
    let edges = [(a, b), (b, c), (c, a)];
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let inside = |(from, to): &(Vec3, Vec3)| (to - from).cross(point - from).dot(normal) >= 0.0;
    let mm = match normal != Vec3::ZERO && edges.iter().all(inside) {
        true => (point - a).dot(normal).abs(),
        false => edges.map(to_edge).into_iter().fold(f32::INFINITY, f32::min),
    };
    f64::from(mm)
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::ride::Look;
    use super::*;
    use trepan_haptics::script::Site;

    fn ride(newtons: f32, depth_mm: f32, dip_mm: f32, gone: usize) -> Ride {
        let ticks = 4 * LOOK_MS as usize;
        let look = |dip_mm: f32| {
            let at = |x: f32, y: f32| Vec3::new(x, y, -depth_mm - dip_mm);
            Look {
                seen: vec![at(0.0, 0.0), at(1.0, 1.0)],
                triangles: vec![[at(-9.0, -9.0), at(20.0, -9.0), at(-9.0, 20.0)]],
            }
        };
        Ride {
            setup: String::new(),
            site: Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 },
            forces: vec![Vec3::X * newtons; ticks],
            lifted: vec![Vec3::ZERO; ticks],
            probing: (0..ticks).map(|tick| tick >= ticks / 2).collect(),
            on_bone: (0..ticks).map(|tick| tick < ticks / 2).collect(),
            looks: [0.0, 0.0, dip_mm, dip_mm].map(look).into(),
            from_mask_mm: vec![0.25],
            removed: (0..100).map(|place| place < gone).collect(),
            cpu_s: [0.0; 3],
            steps: 0,
            seconds: 1.0,
            memory_mb: 0.0,
        }
    }

    /// By hand: 0.3 N everywhere; surface off by 0.5 mm at rest and 0.7 mm when it is pressed; 60
    /// against 80 places gone.
    #[test]
    fn errors_are_those_of_hand_made_runs() {
        let errors = Errors::between(&ride(1.3, 8.5, 1.2, 60), &ride(1.0, 8.0, 1.0, 80));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} and {b}");
        [errors.tissue_rms_n, errors.tissue_p95_n].into_iter().for_each(|e| near(e, 0.3));
        near(errors.shown_p95_mm, 0.7);
        near(errors.shown_mean_mm, 0.7);
        near(errors.rest_p95_mm, 0.5);
        near(errors.mask_p95_mm, 0.25);
        near(errors.bone_mm3, 20.0 * 0.125);
        near(errors.bone_dice, 120.0 / 140.0);
        let same = Errors::between(&ride(1.0, 8.0, 1.0, 80), &ride(1.0, 8.0, 1.0, 80));
        assert_eq!((same.tissue_rms_n, same.shown_p95_mm, same.bone_dice), (0.0, 0.0, 1.0));
    }

    #[test]
    fn distances_to_a_triangle_are_to_its_face_edges_and_corners() {
        let triangle = [Vec3::ZERO, 4.0 * Vec3::X, 4.0 * Vec3::Y];
        let at = |x: f32, y: f32, z: f32| distance_mm(Vec3::new(x, y, z), &triangle);
        assert_eq!((at(1.0, 1.0, 2.0), at(1.0, -3.0, 0.0), at(-3.0, -4.0, 0.0)), (2.0, 3.0, 5.0));
        assert!((at(4.0, 4.0, 0.0) - 8.0f64.sqrt()).abs() < 1e-6);
    }
}
