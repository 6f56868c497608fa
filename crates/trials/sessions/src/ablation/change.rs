//! What differs between one run and the default: force at the hand, tissue, picture.

use super::Filmed;
use super::pictures::difference_percent;
use crate::scripted::{FELT_N, LOOK_MS, LOOK_RADIUS_MM, Ride, surfaces, worst};
use trepan_geometry::{Vec3, quantile};

/// Tolerance of a force on bone, N.
pub const BONE_N: f64 = 0.1;
/// Tolerance of a force on tissue: N, or a share of the peak if that is more.
const TISSUE_N: f64 = 0.02;
const TISSUE_SHARE: f64 = 0.1;
/// Tolerance of the shown surface, mm.
pub const SHOWN_MM: f64 = 0.4;
/// Tolerance of a picture, percent of white.
pub const PICTURE_PERCENT: f64 = 1.0;

/// Tolerance of a force on tissue, N, by the default's peak.
pub fn tissue_tolerance_n(peak_n: f64) -> f64 {
    TISSUE_N.max(TISSUE_SHARE * peak_n)
}

/// Change of the force at the hand over some ticks, N. A tick counts where one of the two runs
/// feels something.
#[derive(Clone, Copy, Debug)]
struct ForceChange {
    p95_n: f64,
    max_n: f64,
    /// Largest force of the default.
    peak_n: f64,
}

impl ForceChange {
    fn over(ride: &Ride, usual: &Ride, counts: impl Fn(usize) -> bool) -> Self {
        let pairs = || {
            let all = ride.forces.iter().zip(&usual.forces).enumerate().filter(|(tick, _)| counts(*tick));
            all.map(|(_, pair)| pair).filter(|(a, b)| a.is_nan() || a.length().max(b.length()) > FELT_N)
        };
        let mut all: Vec<f64> = pairs().map(|(a, b)| f64::from(a.distance(*b))).collect();
        Self {
            p95_n: quantile(&mut all, 0.95),
            max_n: quantile(&mut all, 1.0),
            peak_n: pairs().map(|(_, b)| f64::from(b.length())).fold(f64::NAN, f64::max),
        }
    }

    fn percent(&self, newtons: f64) -> f64 {
        100.0 * newtons / self.peak_n
    }
}

/// What differs between one run and the default.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    bone: ForceChange,
    tissue: ForceChange,
    /// Change of the shown surface while the probe is in the hand, p95, mm. It is the distance from
    /// where the default shows it to the nearest place of this run's.
    shown_mm: f64,
    /// The same before anything has touched the brain.
    rest_mm: f64,
    /// Of the nodes under the opening while the probe is in the hand, p95, mm: motion along the
    /// surface, too.
    nodes_mm: f64,
    picture_percent: f64,
    /// Ticks with another force and looks with another node, by any bit.
    unequal: usize,
}

impl Change {
    /// Of a run from the default along the same path.
    pub(super) fn between(run: &Filmed, usual: &Filmed) -> Self {
        let picture_percent = difference_percent(&run.pictures, &usual.pictures);
        Self { picture_percent, ..Self::of_rides(&run.ride, &usual.ride) }
    }

    /// The same without pictures.
    fn of_rides(ride: &Ride, usual: &Ride) -> Self {
        let on_bone = |tick: usize| ride.on_bone[tick] || usual.on_bone[tick];
        let on_tissue = |tick: usize| ride.probing[tick] && usual.probing[tick] && !on_bone(tick);
        let (mut rest, mut shown) = surfaces(ride, usual);
        let bits = |v: &Vec3| v.to_array().map(f32::to_bits);
        let ticks = ride.forces.iter().zip(&usual.forces).filter(|(a, b)| bits(a) != bits(b)).count();
        let nodes = |ride: &Ride, look: usize| -> Vec<[u32; 3]> {
            ride.looks[look].triangles.iter().flatten().map(bits).collect()
        };
        let looks = (0..usual.looks.len()).filter(|&look| nodes(ride, look) != nodes(usual, look)).count();
        Self {
            bone: ForceChange::over(ride, usual, on_bone),
            tissue: ForceChange::over(ride, usual, on_tissue),
            shown_mm: quantile(&mut shown, 0.95),
            rest_mm: quantile(&mut rest, 0.95),
            nodes_mm: quantile(&mut node_distances(ride, usual), 0.95),
            picture_percent: f64::NAN,
            unequal: ticks + looks,
        }
    }

    /// Change of the force over its tolerance, the worse of bone and tissue.
    fn hand_over_tolerance(&self) -> f64 {
        worst([self.bone.p95_n / BONE_N, self.tissue.p95_n / tissue_tolerance_n(self.tissue.peak_n)])
    }

    /// By their names with units.
    pub fn named(&self) -> [(&'static str, f64); 17] {
        let Self { bone, tissue, .. } = self;
        let hand = self.hand_over_tolerance();
        let all = worst([hand, self.shown_mm / SHOWN_MM, self.picture_percent / PICTURE_PERCENT]);
        [
            ("bone_force_change_p95_n", bone.p95_n),
            ("bone_force_change_max_n", bone.max_n),
            ("bone_force_peak_n", bone.peak_n),
            ("bone_force_change_p95_percent", bone.percent(bone.p95_n)),
            ("bone_force_change_max_percent", bone.percent(bone.max_n)),
            ("tissue_force_change_p95_n", tissue.p95_n),
            ("tissue_force_change_max_n", tissue.max_n),
            ("tissue_force_peak_n", tissue.peak_n),
            ("tissue_force_change_p95_percent", tissue.percent(tissue.p95_n)),
            ("tissue_force_change_max_percent", tissue.percent(tissue.max_n)),
            ("shown_change_p95_mm", self.shown_mm),
            ("rest_change_p95_mm", self.rest_mm),
            ("node_change_p95_mm", self.nodes_mm),
            ("picture_change_percent", self.picture_percent),
            ("ticks_and_looks_unequal", self.unequal as f64),
            ("hand_change_over_tolerance", hand),
            ("change_over_tolerance", all),
        ]
    }
}

/// Distances of the nodes under the opening in every look while the default probes; none where the
/// two have other meshes.
fn node_distances(ride: &Ride, usual: &Ride) -> Vec<f64> {
    let site = usual.site;
    let is_under = |node: &Vec3| {
        let from = *node - site.entry;
        (from - from.dot(site.inward) * site.inward).length() <= LOOK_RADIUS_MM
    };
    let Some(first) = usual.looks.first().map(|look| &look.triangles) else { return Vec::new() };
    let corners = || (0..first.len()).flat_map(|triangle| (0..3).map(move |corner| (triangle, corner)));
    let under: Vec<_> = corners().filter(|&(triangle, corner)| is_under(&first[triangle][corner])).collect();
    let probing = (0..usual.looks.len()).filter(|look| usual.probing[(look + 1) * LOOK_MS as usize - 1]);
    let pairs = probing.map(|look| (&ride.looks[look].triangles, &usual.looks[look].triangles));
    let alike = pairs.filter(|(is, was)| is.len() == was.len());
    alike.flat_map(|(is, was)| under.iter().map(|&(t, c)| f64::from(is[t][c].distance(was[t][c])))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scripted::surface::Look;
    use crate::scripted::tests::hand_made;

    fn named(change: &Change, name: &str) -> f64 {
        change.named().into_iter().find(|(of, _)| *of == name).unwrap().1
    }

    /// By hand: 0.3 N everywhere, of 1 N; the plane lies 0.5 mm deeper at rest and 0.7 mm deeper
    /// under the probe. A last tick on tissue differs by 2 N.
    #[test]
    fn changes_are_those_of_hand_made_runs() {
        let usual = hand_made(1.0, 8.0, 1.0, 80);
        let mut ride = hand_made(1.3, 8.5, 1.2, 80);
        let ticks = ride.forces.len();
        ride.forces[ticks - 1] = Vec3::X * 3.0;
        let change = Change { picture_percent: 0.5, ..Change::of_rides(&ride, &usual) };
        let near = |name: &str, value: f64| {
            let is = named(&change, name);
            assert!((is - value).abs() < 1e-4, "{name}: {is}");
        };
        near("bone_force_change_p95_n", 0.3);
        near("bone_force_change_max_percent", 30.0);
        near("tissue_force_change_p95_percent", 30.0);
        near("tissue_force_change_max_n", 2.0);
        near("tissue_force_peak_n", 1.0);
        near("shown_change_p95_mm", 0.7);
        near("rest_change_p95_mm", 0.5);
        near("hand_change_over_tolerance", 3.0);
        near("change_over_tolerance", 3.0);
        near("ticks_and_looks_unequal", ticks as f64 + 4.0);
        assert_eq!(named(&Change::of_rides(&usual, &usual), "ticks_and_looks_unequal"), 0.0);
        let torn = Change { picture_percent: 4.0, ..change };
        assert!((named(&torn, "change_over_tolerance") - 4.0).abs() < 1e-9);
        assert!(named(&Change::of_rides(&ride, &usual), "change_over_tolerance").is_nan(), "no picture is no zero");
    }

    #[test]
    fn nodes_that_slide_along_the_surface_are_seen_and_other_meshes_are_not_compared() {
        let usual = hand_made(1.0, 8.0, 1.0, 80);
        let mut ride = hand_made(1.0, 8.0, 1.0, 80);
        let near = |look: &mut Look, x: f32| look.triangles[0][0] = Vec3::new(x, 0.0, -9.0);
        let mut default = usual;
        default.looks.iter_mut().for_each(|look| near(look, 0.0));
        ride.looks.iter_mut().for_each(|look| near(look, 0.25));
        assert_eq!(Change::of_rides(&ride, &default).nodes_mm, 0.25);
        ride.looks.iter_mut().for_each(|look| look.triangles.clear());
        assert!(Change::of_rides(&ride, &default).nodes_mm.is_nan());
    }

    #[test]
    fn a_force_that_is_no_number_is_a_change_and_small_peaks_have_a_floor() {
        let usual = hand_made(1.0, 8.0, 1.0, 80);
        let mut ride = hand_made(1.0, 8.0, 1.0, 80);
        ride.forces.iter_mut().for_each(|force| force.x = f32::NAN);
        assert!(Change::of_rides(&ride, &usual).hand_over_tolerance().is_nan());
        assert_eq!((tissue_tolerance_n(0.05), tissue_tolerance_n(1.0)), (0.02, 0.1));
    }
}
