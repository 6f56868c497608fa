//! Conversion between the f32 types of the loops and the f64 nalgebra types of references and
//! offline work.
//!
//! # Practice
//! f32 to f64 is exact. f64 to f32 rounds once, to nearest. Rotations are renormalised in f64, so
//! that a round trip moves a point at 300 mm by less than 1e-4 mm.

use crate::{Pose, Quat, Vec3};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// A point in f64.
pub fn point(p: Vec3) -> Point3<f64> {
    Point3::new(p.x.into(), p.y.into(), p.z.into())
}

/// A direction or displacement in f64.
pub fn vector(v: Vec3) -> Vector3<f64> {
    Vector3::new(v.x.into(), v.y.into(), v.z.into())
}

/// An f64 vector rounded to f32.
pub fn vec3(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// A pose in f64.
pub fn isometry(pose: &Pose) -> Isometry3<f64> {
    let q = pose.rotation;
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(q.w.into(), q.x.into(), q.y.into(), q.z.into()));
    Isometry3::from_parts(Translation3::from(vector(pose.translation)), rotation)
}

/// An f64 pose rounded to f32.
pub fn pose(isometry: &Isometry3<f64>) -> Pose {
    let q = isometry.rotation.quaternion();
    let rotation = Quat::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32);
    Pose::from_parts(vec3(&isometry.translation.vector), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pose_round_trip_agrees_with_nalgebra(t in prop::array::uniform3(-200.0f32..200.0), axis in prop::array::uniform3(-1.0f32..1.0),
                                                angle in -3.0f32..3.0, p in prop::array::uniform3(-300.0f32..300.0)) {
            let axis = Vec3::from(axis);
            prop_assume!(axis.length() > 0.1);
            let world_from_tool = Pose::from_parts(t.into(), Quat::from_axis_angle(axis.normalize(), angle));
            let p = Vec3::from(p);
            let exact = isometry(&world_from_tool) * point(p);
            let back = pose(&isometry(&world_from_tool));
            prop_assert!((world_from_tool * p - vec3(&exact.coords)).length() < 2e-4);
            prop_assert!((back * p - vec3(&exact.coords)).length() < 2e-4);
        }
    }
}
