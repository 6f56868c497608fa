//! Rays from the window into the scene: what lies under the pointer, and how a ball rests on it.

use glam::Vec3;
use trepan_render::Cut;

/// A ray into the scene; it meets surfaces from outside only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Its start, world mm.
    pub from: Vec3,
    /// Its unit direction.
    pub along: Vec3,
    /// Its length, mm.
    pub reach_mm: f32,
    /// Whether it meets bone.
    pub bone: bool,
    /// Whether it meets the brain.
    pub brain: bool,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Distance along the ray, mm.
    pub distance_mm: f32,
    /// Unit normal of the surface, towards the outside.
    pub normal: Vec3,
}

/// Rays per ring under a ball: numerical.
const RING: usize = 8;
/// Height above a place from which the surface below it is sought, mm.
const ABOVE_MM: f32 = 40.0;
/// Depth below a place down to which it is sought, mm.
const BELOW_MM: f32 = 40.0;
/// Depth below a place from which the inner table is sought upwards, mm.
const INSIDE_MM: f32 = 14.0;

/// The surfaces that a window's ray can meet.
#[derive(Clone, Copy)]
pub(crate) struct Surfaces<'a> {
    cast: &'a dyn Fn(&Ray) -> Option<SurfaceHit>,
    /// Whether bone and brain are shown.
    shown: [bool; 2],
    cut: Option<Cut>,
}

impl<'a> Surfaces<'a> {
    /// The surfaces of a session, of which bone and brain may be hidden or cut by a section.
    pub fn new(cast: &'a dyn Fn(&Ray) -> Option<SurfaceHit>, shown: [bool; 2], cut: Option<Cut>) -> Self {
        Self { cast, shown, cut }
    }

    /// The first visible surface along a line of sight, and the point there.
    pub fn seen(&self, eye: Vec3, along: Vec3) -> Option<(Vec3, SurfaceHit)> {
        let [bone, brain] = self.shown;
        let start = |cut: Option<Cut>| cut.map_or(0.0, |cut| behind(&cut, eye, along));
        let cast = |from_mm: f32, bone, brain| {
            let ray = Ray { from: eye + from_mm * along, along, reach_mm: 2000.0, bone, brain };
            (self.cast)(&ray).map(|hit| SurfaceHit { distance_mm: hit.distance_mm + from_mm, ..hit })
        };
        let of_bone = bone.then(|| cast(start(self.cut.filter(|cut| cut.bone)), true, false)).flatten();
        let of_brain = brain.then(|| cast(start(self.cut), false, true)).flatten();
        let hit = of_bone.into_iter().chain(of_brain).min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))?;
        Some((eye + hit.distance_mm * along, hit))
    }

    /// The first surface from a point along a unit direction, hidden or not.
    pub fn ahead(&self, from: Vec3, along: Vec3, reach_mm: f32) -> Option<SurfaceHit> {
        (self.cast)(&Ray { from, along, reach_mm, bone: true, brain: true })
    }

    /// Height along `up` over `place` at which a ball's centre rests on the surfaces, mm.
    pub fn rest(&self, place: Vec3, up: Vec3, radius_mm: f32) -> Option<f32> {
        let height = |aside: Vec3| {
            let hit = self.ahead(place + aside + ABOVE_MM * up, -up, ABOVE_MM + BELOW_MM)?;
            let rise = (radius_mm.powi(2) - aside.length_squared()).max(0.0).sqrt();
            Some(ABOVE_MM - hit.distance_mm + rise)
        };
        let rings = [0.5, 0.98].into_iter().flat_map(|share| ring(up, share * radius_mm));
        std::iter::once(Vec3::ZERO).chain(rings).filter_map(height).reduce(f32::max)
    }

    /// Height along `up` over `place` of the bone's inner surface around it, mm: the median of a
    /// ring of rays from inside. `None` where fewer than half of them meet bone.
    pub fn inner(&self, place: Vec3, up: Vec3, radius_mm: f32) -> Option<f32> {
        let from = |aside: Vec3| place + aside - INSIDE_MM * up;
        let ray = |aside| Ray { from: from(aside), along: up, reach_mm: 3.0 * INSIDE_MM, bone: true, brain: false };
        let heights = ring(up, radius_mm).filter_map(|aside| (self.cast)(&ray(aside)));
        let mut heights: Vec<f32> =
            heights.map(|hit| hit.distance_mm - INSIDE_MM).filter(|mm| *mm > -INSIDE_MM).collect();
        heights.sort_by(f32::total_cmp);
        (2 * heights.len() > RING).then(|| heights[heights.len() / 2])
    }

    /// Height along `up` over `place` of the brain's surface, mm.
    pub fn brain(&self, place: Vec3, up: Vec3) -> Option<f32> {
        let (from, reach_mm) = (place + ABOVE_MM * up, ABOVE_MM + BELOW_MM);
        let hit = (self.cast)(&Ray { from, along: -up, reach_mm, bone: false, brain: true })?;
        Some(ABOVE_MM - hit.distance_mm)
    }

    /// Whether bone lies on most of a ring around a line through a place.
    pub fn is_bone_around(&self, place: Vec3, up: Vec3, radius_mm: f32) -> bool {
        self.open_share(place + ABOVE_MM * up, up, (radius_mm, ABOVE_MM + BELOW_MM)) < 0.5
    }

    /// Depths of the bone's outer and inner surface below a place in the air, mm; `None` where no
    /// bone begins within `reach_mm`.
    pub fn tables(&self, place: Vec3, up: Vec3, reach_mm: f32) -> Option<[f32; 2]> {
        let cast = |from, along, reach_mm| (self.cast)(&Ray { from, along, reach_mm, bone: true, brain: false });
        let outer_mm = cast(place, -up, reach_mm)?.distance_mm;
        let deep_mm = outer_mm + INSIDE_MM;
        // Bone that is thicker has no inner surface within reach.
        let back = cast(place - deep_mm * up, up, INSIDE_MM + 1.0);
        Some([outer_mm, back.map_or(deep_mm, |hit| deep_mm - hit.distance_mm)])
    }

    /// Share of a circle around a place below which no bone lies, down to a depth, mm.
    pub fn open_share(&self, place: Vec3, up: Vec3, (radius_mm, reach_mm): (f32, f32)) -> f32 {
        let ray = |aside| Ray { from: place + aside, along: -up, reach_mm, bone: true, brain: false };
        let open = ring(up, radius_mm).filter(|aside| (self.cast)(&ray(*aside)).is_none());
        open.count() as f32 / RING as f32
    }

    /// A point and the normal of the surface around a point on a line of sight. They come from a
    /// ring of rays beside that line, so a hole at the point does not move them; `None` at an edge.
    pub fn smooth(&self, point: Vec3, along: Vec3, radius_mm: f32) -> Option<(Vec3, Vec3)> {
        let meet = |aside: Vec3| {
            let from = point + aside - ABOVE_MM * along;
            let hit = self.ahead(from, along, ABOVE_MM + BELOW_MM)?;
            Some(from + hit.distance_mm * along)
        };
        let around: Vec<Vec3> = ring(along, radius_mm).filter_map(meet).collect();
        if around.len() < RING {
            return None;
        }
        let middle = around.iter().sum::<Vec3>() / RING as f32;
        let next = around.iter().cycle().skip(1);
        let area: Vec3 = around.iter().zip(next).map(|(a, b)| (*a - middle).cross(*b - middle)).sum();
        let normal = area.try_normalize()?;
        let normal = if normal.dot(along) > 0.0 { -normal } else { normal };
        let is_flat = |at: &Vec3| (*at - middle).dot(normal).abs() < 0.5 * radius_mm;
        around.iter().all(is_flat).then_some((middle, normal))
    }
}

/// Distance along a line of sight up to which a section removes everything, mm.
fn behind(cut: &Cut, eye: Vec3, along: Vec3) -> f32 {
    let (height, fall) = ((eye - cut.point).dot(cut.normal), -along.dot(cut.normal));
    if height > 0.0 && fall > 1e-6 { height / fall } else { 0.0 }
}

/// Points on a circle around the origin, across an axis.
fn ring(axis: Vec3, radius_mm: f32) -> impl Iterator<Item = Vec3> {
    let (right, up) = axis.normalize_or(Vec3::Z).any_orthonormal_pair();
    (0..RING).map(move |n| {
        let (sin, cos) = (n as f32 / RING as f32 * std::f32::consts::TAU).sin_cos();
        radius_mm * (cos * right + sin * up)
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A slab of bone from z = -6 to 0 mm with a hole of 3 mm radius. The brain lies below -7 mm.
    pub fn slab(ray: &Ray) -> Option<SurfaceHit> {
        let plane = |z: f32, normal: Vec3, holds: &dyn Fn(Vec3) -> bool| {
            let distance_mm = (z - ray.from.z) / ray.along.z;
            let meets = distance_mm > 0.0 && distance_mm <= ray.reach_mm && ray.along.dot(normal) < 0.0;
            let meets = meets && holds(ray.from + distance_mm * ray.along);
            meets.then_some(SurfaceHit { distance_mm, normal })
        };
        let beside = |at: Vec3| at.truncate().length() > 3.0;
        let bone = [plane(0.0, Vec3::Z, &beside), plane(-6.0, Vec3::NEG_Z, &beside)];
        let all = bone.into_iter().flatten().filter(|_| ray.bone);
        let all = all.chain(plane(-7.0, Vec3::Z, &|_| true).filter(|_| ray.brain));
        all.min_by(|a, b| a.distance_mm.total_cmp(&b.distance_mm))
    }

    #[test]
    fn a_hidden_or_cut_surface_is_not_under_the_pointer() {
        let eye = Vec3::new(10.0, 0.0, 50.0);
        let seen = |shown, cut| {
            let found = Surfaces::new(&slab, shown, cut).seen(eye, Vec3::NEG_Z);
            found.map(|(point, _)| point.z.round())
        };
        assert_eq!(seen([true, true], None), Some(0.0));
        assert_eq!(seen([false, true], None), Some(-7.0));
        assert_eq!(seen([false, false], None), None);
        let cut = Cut { point: Vec3::new(0.0, 0.0, -3.0), normal: Vec3::Z, bone: true };
        assert_eq!(seen([true, true], Some(cut)), Some(-7.0), "the bone above the section is gone");
        assert_eq!(seen([true, true], Some(Cut { bone: false, ..cut })), Some(0.0));
    }

    #[test]
    fn a_ball_rests_on_bone_beside_the_hole_and_on_the_brain_in_it() {
        let surfaces = Surfaces::new(&slab, [true; 2], None);
        let rest = |x: f32, radius_mm| surfaces.rest(Vec3::new(x, 0.0, 1.0), Vec3::Z, radius_mm).unwrap();
        assert!((rest(20.0, 2.0) - 1.0).abs() < 1e-3, "centre 2 mm over the bone, 1 mm over the place");
        assert!((rest(0.0, 2.0) + 6.0).abs() < 1e-3);
        assert!((-6.0..0.5).contains(&rest(2.0, 2.0)), "its side on the rim");
        let inner = surfaces.inner(Vec3::new(20.0, 0.0, -6.0), Vec3::Z, 2.0).unwrap();
        assert!(inner.abs() < 1e-3);
        assert_eq!(surfaces.inner(Vec3::new(0.0, 0.0, -6.0), Vec3::Z, 2.0), None, "no bone around it");
        let along = Vec3::new(0.3, 0.0, -1.0).normalize();
        let normal = |x: f32, z: f32| surfaces.smooth(Vec3::new(x, 0.0, z), along, 6.0).unwrap().1;
        assert!((normal(20.0, 0.0) - Vec3::Z).length() < 1e-3);
        assert!((normal(0.0, -3.0) - Vec3::Z).length() < 0.05, "over the wall of the hole: {}", normal(0.0, -3.0));
    }
}
