//! A camera that orbits a target.
//!
//! # Practice
//! World mm, z up. Elevation stops just short of the poles, so that up is always defined.
//! `viewed_from` places the eye along a direction: seen from the front, the patient's right is on
//! the left of the picture.

use glam::{Mat4, Vec2, Vec3, Vec4};

/// The position of the eye and its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The point at the centre of the picture, world mm.
    pub target: Vec3,
    /// Azimuth of the eye around z, from +x towards +y, rad.
    pub azimuth_rad: f32,
    /// Elevation of the eye over the target's horizon, rad.
    pub elevation_rad: f32,
    /// Distance from the target to the eye, mm.
    pub distance_mm: f32,
    /// Vertical field of view, rad.
    pub fov_rad: f32,
}

/// The camera as vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The eye, world mm.
    pub eye: Vec3,
    /// Unit, to the right in the picture.
    pub right: Vec3,
    /// Unit, upwards in the picture.
    pub up: Vec3,
    /// Unit, into the picture.
    pub forward: Vec3,
    /// Half the picture's width and height at distance 1.
    pub half: Vec2,
    /// Offset of the picture's centre to the left and down at distance 1. Nonzero for one eye of
    /// two, and within a pixel to smooth edges.
    pub shear: Vec2,
}

const STEEPEST_RAD: f32 = 1.55;

/// Samples of a pixel at rest.
pub(crate) const SAMPLES: usize = 16;

/// The 4 x 4 places of a pixel in the order in which they are taken. It is that of Bayer's matrix,
/// so that any first few lie far apart.
const ORDER: [u8; SAMPLES] = [0, 10, 2, 8, 5, 15, 7, 13, 1, 11, 3, 9, 4, 14, 6, 12];

impl Camera {
    /// An eye at `distance_mm` from `target` in the direction `towards_eye` (any length; zero means
    /// from the front).
    pub fn viewed_from(target: Vec3, towards_eye: Vec3, distance_mm: f32) -> Self {
        let d = towards_eye.try_normalize().unwrap_or(Vec3::Y);
        let azimuth_rad = if d.x.hypot(d.y) < 1e-4 { core::f32::consts::FRAC_PI_2 } else { d.y.atan2(d.x) };
        let elevation_rad = d.z.clamp(-1.0, 1.0).asin().clamp(-STEEPEST_RAD, STEEPEST_RAD);
        Self { target, azimuth_rad, elevation_rad, distance_mm, fov_rad: 0.6 }
    }

    /// Rotates around the target, rad; to the right and upwards.
    pub fn orbit(&mut self, azimuth_rad: f32, elevation_rad: f32) {
        self.azimuth_rad = (self.azimuth_rad + azimuth_rad) % core::f32::consts::TAU;
        self.elevation_rad = (self.elevation_rad + elevation_rad).clamp(-STEEPEST_RAD, STEEPEST_RAD);
    }

    /// Scales the distance by `factor`, limited to 2 mm and 5 m.
    pub fn zoom(&mut self, factor: f32) {
        self.distance_mm = (self.distance_mm * factor).clamp(2.0, 5000.0);
    }

    /// Scales the distance by `factor`; the point at the target's depth under `at` (picture
    /// coordinates from -1 to 1) keeps its place in the picture.
    pub fn zoom_at(&mut self, factor: f32, at: Vec2, aspect: f32) {
        let (view, before) = (self.view(aspect), self.distance_mm);
        self.zoom(factor);
        let off = at * view.half * (before - self.distance_mm);
        self.target += off.x * view.right + off.y * view.up;
    }

    /// Moves eye and target to the right and upwards in the picture, mm.
    pub fn pan(&mut self, right_mm: f32, up_mm: f32) {
        let view = self.view(1.0);
        self.target += right_mm * view.right + up_mm * view.up;
    }

    /// The camera as vectors, for an aspect ratio (width over height).
    pub fn view(&self, aspect: f32) -> View {
        let elevation = self.elevation_rad.clamp(-STEEPEST_RAD, STEEPEST_RAD);
        let ring = elevation.cos();
        let back = Vec3::new(ring * self.azimuth_rad.cos(), ring * self.azimuth_rad.sin(), elevation.sin());
        let right = Vec3::Z.cross(back).normalize();
        let half = (0.5 * self.fov_rad).tan();
        View {
            eye: self.target + self.distance_mm * back,
            right,
            up: back.cross(right),
            forward: -back,
            half: Vec2::new(half * aspect, half),
            shear: Vec2::ZERO,
        }
    }
}

impl View {
    /// Near clipping distance of triangles, mm.
    pub const NEAR_MM: f32 = 0.5;
    /// Far clipping distance of triangles, mm.
    pub const FAR_MM: f32 = 6000.0;

    /// The view from an eye `offset_mm` to the right, with zero parallax at `distance_mm`: an
    /// off-axis frustum without keystone distortion.
    pub fn from_aside(&self, offset_mm: f32, distance_mm: f32) -> Self {
        let shear = self.shear + Vec2::X * (offset_mm / distance_mm.max(Self::NEAR_MM));
        Self { eye: self.eye + offset_mm * self.right, shear, ..*self }
    }

    /// The view of the `n`th sample of the pixels of a picture of `size` pixels, of [`SAMPLES`].
    pub(crate) fn sample(&self, n: usize, size: [u32; 2]) -> Self {
        let place = ORDER[n % SAMPLES];
        self.moved(Vec2::new(f32::from(place % 4), f32::from(place / 4)) * 0.25 - 0.375, size)
    }

    /// The view whose pixels have their centres `by` pixels further right and down, in a picture of
    /// `size` pixels.
    fn moved(&self, by: Vec2, size: [u32; 2]) -> Self {
        let pixel = 2.0 * self.half / Vec2::from(size.map(|n| n as f32));
        Self { shear: self.shear + by * Vec2::new(-1.0, 1.0) * pixel, ..*self }
    }

    /// Direction of the picture's centre; length 1 along `forward`.
    pub(crate) fn middle(&self) -> Vec3 {
        self.forward - self.shear.x * self.right - self.shear.y * self.up
    }

    /// Unit direction of the ray through a point of the picture, each coordinate from -1 (left,
    /// bottom) to 1 (right, top).
    pub fn ray(&self, at: Vec2) -> Vec3 {
        (self.middle() + at.x * self.half.x * self.right + at.y * self.half.y * self.up).normalize()
    }

    /// Picture coordinates of a world point, from -1 to 1, and its depth along `forward`, mm.
    pub fn project(&self, point: Vec3) -> (Vec2, f32) {
        let from = point - self.eye;
        let depth = from.dot(self.forward);
        let across = Vec2::new(from.dot(self.right), from.dot(self.up)) + self.shear * depth;
        (across / (self.half * depth), depth)
    }

    /// The projection matrix for triangles.
    pub fn clip_from_world(&self) -> Mat4 {
        let aspect = self.half.x / self.half.y;
        let clip_from_eye =
            glam::camera::rh::proj::directx::perspective(2.0 * self.half.y.atan(), aspect, Self::NEAR_MM, Self::FAR_MM);
        let sheared = Mat4::from_cols(Vec4::X, Vec4::Y, Vec4::Z, (self.shear / self.half).extend(0.0).extend(1.0));
        sheared * clip_from_eye * glam::camera::rh::view::look_to_mat4(self.eye, self.forward, self.up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn seen_from_in_front_the_patients_right_is_on_the_left() {
        let view = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 400.0).view(1.0);
        assert!((view.eye - Vec3::new(0.0, 400.0, 0.0)).length() < 1e-3);
        assert!((view.right - Vec3::NEG_X).length() < 1e-5 && (view.up - Vec3::Z).length() < 1e-5);
    }

    #[test]
    fn over_a_pole_up_is_still_defined() {
        let mut camera = Camera::viewed_from(Vec3::ONE, Vec3::Z, 100.0);
        camera.orbit(1.0, 9.0);
        let view = camera.view(2.0);
        assert!(view.right.is_normalized() && view.up.is_normalized() && view.up.dot(view.forward).abs() < 1e-5);
    }

    #[test]
    fn a_zoom_keeps_what_is_under_the_pointer_and_a_pan_moves_it() {
        let mut camera = Camera::viewed_from(Vec3::ONE, Vec3::new(0.4, 1.0, 0.2), 200.0);
        let at = Vec2::new(0.6, -0.3);
        let view = camera.view(1.5);
        let point = view.eye + 200.0 / view.ray(at).dot(view.forward) * view.ray(at);
        camera.zoom_at(0.5, at, 1.5);
        assert!(camera.distance_mm == 100.0 && (camera.view(1.5).project(point).0 - at).length() < 1e-3);
        camera.pan(10.0, 0.0);
        assert!(camera.view(1.5).project(point).0.x < at.x - 0.1);
    }

    #[test]
    fn every_sample_is_taken_once_within_its_pixel() {
        let mut places: Vec<u8> = ORDER.into();
        places.sort_unstable();
        assert!(places.into_iter().eq(0..16));
        let view = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 100.0).view(1.0);
        let mut middle = Vec2::ZERO;
        for n in 0..SAMPLES {
            // Where the middle of the moved picture is in the picture, in pixels.
            let at = view.project(view.eye + 50.0 * view.sample(n, [10, 10]).ray(Vec2::ZERO)).0 * 5.0;
            assert!(at.abs().max_element() < 0.38, "{at}");
            middle += at / SAMPLES as f32;
        }
        assert!(middle.length() < 1e-3, "{middle}");
    }

    proptest! {
        #[test]
        fn matrix_projection_and_ray_agree(azimuth in -3.0f32..3.0, elevation in -1.5f32..1.5, aside in -9.0f32..9.0, x in -40.0f32..40.0, y in -40.0f32..40.0, z in -40.0f32..40.0) {
            let camera = Camera { target: Vec3::new(3.0, -8.0, 5.0), azimuth_rad: azimuth, elevation_rad: elevation, distance_mm: 200.0, fov_rad: 0.7 };
            let view = camera.view(1.4).from_aside(aside, camera.distance_mm);
            prop_assert!(view.project(camera.target).0.length() < 1e-4);
            let view = view.moved(Vec2::new(0.4, -0.3), [14, 10]);
            prop_assert!((view.project(camera.target).0 - Vec2::new(-0.8 / 14.0, -0.06)).length() < 1e-4);
            let point = Vec3::new(x, y, z);
            let (at, depth) = view.project(point);
            let clip = view.clip_from_world() * point.extend(1.0);
            prop_assert!((at - Vec2::new(clip.x, clip.y) / clip.w).length() < 1e-3);
            prop_assert!((depth - clip.w).abs() < 1e-2);
            let along = view.ray(at);
            prop_assert!((point - view.eye).cross(along).length() < 0.02);
            prop_assert!((view.project(view.eye + 99.0 * along).0 - at).length() < 1e-3);
        }
    }
}
