//! The god-object: where the tool would be if obstacles were perfectly hard.
//!
//! # Theory
//! Zilles and Salisbury 1995 place the proxy at the point nearest to the device that no active
//! plane forbids:
//! ```text
//! minimise ½|x - device|²   subject to   (x - pᵢ)·nᵢ ≥ 0 ,  i ≤ 3 planes
//! ```
//! With Lagrange multipliers λ ≥ 0: `x = device + Σ λᵢ nᵢ`, `(nᵢ·nⱼ) λⱼ = (pᵢ - device)·nᵢ`. There
//! are at most 2³ sets of active planes, so the sets are tried by size, and the nearest point that
//! satisfies all planes wins.
//!
//! ```text
//!      proxy ●───────── plane
//!            ┆ force
//!     device ○
//! ```
//!
//! # Practice
//! Closed form, at most 8 small systems; planes in world mm. Planes that are nearly parallel are
//! one constraint.
//!
//! # Sources
//! C. B. Zilles, J. K. Salisbury, *A constraint-based god-object method for haptic display*,
//! IROS 1995.
//!
//! # When not to use it
//! Alone against a curved surface: the planes hold only near the proxy, so the caller sweeps from
//! the old place to the new.

use trepan_geometry::Vec3;

/// Most planes that hold the proxy at once: three meet in a point.
pub const MAX_PLANES: usize = 3;

/// A plane that the proxy may not cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point on it, world mm.
    pub point: Vec3,
    /// Unit normal towards the free side.
    pub normal: Vec3,
}

impl Plane {
    /// Height of `x` over the plane, mm; negative where it is forbidden.
    pub fn height(&self, x: Vec3) -> f32 {
        (x - self.point).dot(self.normal)
    }
}

/// The proxy of one tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GodObject {
    /// Where the proxy is, world mm.
    pub position: Vec3,
}

impl GodObject {
    /// A proxy at `position`.
    pub fn new(position: Vec3) -> Self {
        Self { position }
    }

    /// Moves the proxy to the allowed point nearest to `device` and returns it. Planes past the
    /// third are ignored; without a solution (opposed planes) the proxy stays.
    pub fn follow(&mut self, device: Vec3, planes: &[Plane]) -> Vec3 {
        let planes = &planes[..planes.len().min(MAX_PLANES)];
        if let Some(goal) = nearest_allowed(device, planes) {
            self.position = goal;
        }
        self.position
    }
}

/// The point nearest to `device` over all `planes`; `None` when there is none or input is not
/// finite.
fn nearest_allowed(device: Vec3, planes: &[Plane]) -> Option<Vec3> {
    let allowed = |x: Vec3| x.is_finite() && planes.iter().all(|p| p.height(x) >= -1e-4);
    (0u32..1 << planes.len())
        .filter_map(|active| on_planes(device, planes, active).filter(|&x| allowed(x)))
        .min_by(|a, b| a.distance_squared(device).total_cmp(&b.distance_squared(device)))
}

/// The point nearest to `device` on the planes whose bit is set in `active`; `None` when they are
/// (nearly) dependent.
fn on_planes(device: Vec3, planes: &[Plane], active: u32) -> Option<Vec3> {
    let mut x = device;
    let mut basis = [Vec3::ZERO; MAX_PLANES];
    for (i, plane) in planes.iter().enumerate().filter(|(i, _)| active >> i & 1 == 1) {
        // Gram-Schmidt: the part of this normal along which x can still move without leaving the
        // planes before.
        let free = basis.iter().fold(plane.normal, |n, b| n - *b * n.dot(*b));
        let size = free.length();
        if size.is_nan() || size < 1e-3 {
            return None;
        }
        basis[i] = free / size;
        x -= basis[i] * (plane.height(x) / size);
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(normal: Vec3) -> Plane {
        Plane { point: Vec3::ZERO, normal: normal.normalize() }
    }

    #[test]
    fn one_plane_projects_two_give_an_edge_three_a_corner() {
        let device = Vec3::new(-1.0, -2.0, -3.0);
        let mut god = GodObject::new(Vec3::ONE);
        assert!((god.follow(device, &[plane(Vec3::Z)]) - Vec3::new(-1.0, -2.0, 0.0)).length() < 1e-6);
        assert!((god.follow(device, &[plane(Vec3::Z), plane(Vec3::Y)]) - Vec3::new(-1.0, 0.0, 0.0)).length() < 1e-6);
        let all = [plane(Vec3::Z), plane(Vec3::Y), plane(Vec3::X)];
        assert!(god.follow(device, &all).length() < 1e-6);
        assert_eq!(god.follow(Vec3::ONE, &all), Vec3::ONE);
    }

    #[test]
    fn opposed_planes_and_nan_leave_the_proxy_where_it_is() {
        let mut god = GodObject::new(Vec3::ONE);
        let slot = [Plane { point: Vec3::X, normal: Vec3::X }, Plane { point: Vec3::ZERO, normal: Vec3::NEG_X }];
        assert_eq!(god.follow(Vec3::X * 0.5, &slot), Vec3::ONE);
        assert_eq!(god.follow(Vec3::NAN, &[plane(Vec3::Z)]), Vec3::ONE);
        assert_eq!(god.follow(Vec3::NEG_Z, &[Plane { point: Vec3::ZERO, normal: Vec3::ZERO }]), Vec3::NEG_Z);
    }

    proptest! {
        /// No allowed point on a fine grid is nearer to the device than the one found.
        #[test]
        fn the_point_found_is_the_nearest(d in prop::array::uniform3(-2.0f32..2.0), n in prop::array::uniform9(-1.0f32..1.0)) {
            let normals = [Vec3::new(n[0], n[1], n[2]), Vec3::new(n[3], n[4], n[5]), Vec3::new(n[6], n[7], n[8])];
            prop_assume!(normals.iter().all(|n| n.length() > 0.2));
            let planes = normals.map(plane);
            let det = planes[0].normal.dot(planes[1].normal.cross(planes[2].normal)).abs();
            prop_assume!(det > 0.1);
            let device = Vec3::from(d);
            let found = GodObject::new(Vec3::ZERO).follow(device, &planes);
            prop_assert!(planes.iter().all(|p| p.height(found) > -2e-4));
            for i in 0..21 * 21 * 21 {
                let x = Vec3::new((i % 21) as f32, (i / 21 % 21) as f32, (i / 441) as f32) * 0.2 - 2.0;
                if planes.iter().all(|p| p.height(x) >= 0.0) {
                    prop_assert!(x.distance(device) >= found.distance(device) - 1e-3);
                }
            }
        }
    }
}
