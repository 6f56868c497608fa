//! Metal in a CT: fillings, clips and the streaks they cast in their slices.

use super::base::BaseHead;
use super::recipe::{HeadRecipe, random_of};
use super::warp::Warp;
use glam::{DAffine3, DVec3};

/// Decay length of streaks, mm.
const FADE_MM: f64 = 60.0;
/// Reach of streaks beyond the metal's slices, mm.
const BEYOND_MM: f64 = 1.0;
/// Highest value of a scanner's usual range, HU.
pub const USUAL_HU: f32 = 3071.0;

/// Capsule of metal.
pub struct Metal {
    ends: [DVec3; 2],
    radius_mm: f64,
    hu: f32,
    streak_hu: f64,
    /// Streaks per turn and phase of each wave.
    waves: [(f64, f64); 4],
}

impl Metal {
    /// Metal of a recipe: fillings at teeth, clips near the base of the brain.
    pub fn of(recipe: &HeadRecipe, warp: &Warp, base: &BaseHead) -> Vec<Self> {
        let mut random = random_of(recipe.seed, 4);
        let mut pieces = Vec::new();
        let teeth = &base.anatomy.teeth;
        for _ in 0..recipe.fillings.min(teeth.len()) {
            let tooth = warp.nearest_to(teeth[random.usize(0..teeth.len())]);
            pieces.push(Self::drawn([tooth; 2], 1.5 + 2.0 * random.f64(), &mut random));
        }
        for _ in 0..recipe.clips {
            let mut off = || 2.0 * random.f64() - 1.0;
            let place = base.anatomy.middle + DVec3::new(25.0 * off(), 15.0 + 10.0 * off(), -15.0 + 10.0 * off());
            let half = 5.0 * DVec3::new(off(), off(), off()).normalize_or(DVec3::X);
            let middle = warp.nearest_to(place);
            pieces.push(Self::drawn([middle - half, middle + half], 1.2, &mut random));
        }
        pieces
    }

    fn drawn(ends: [DVec3; 2], radius_mm: f64, random: &mut fastrand::Rng) -> Self {
        let hu = 3000.0 + 5000.0 * random.f32();
        let streak_hu = 150.0 + 450.0 * random.f64();
        let waves = [(); 4].map(|()| (f64::from(random.u32(5..30)), core::f64::consts::TAU * random.f64()));
        Self { ends, radius_mm, hu, streak_hu, waves }
    }

    /// Adds metal and streaks to a row of a slice whose first voxel has the index `[0, j, k]`.
    pub fn cast(&self, world: &DAffine3, [j, k]: [usize; 2], row: &mut [f32]) {
        let middle = 0.5 * (self.ends[0] + self.ends[1]);
        let reach = 0.5 * self.ends[0].distance(self.ends[1]) + self.radius_mm + BEYOND_MM;
        let normal = world.x_axis.cross(world.y_axis).normalize();
        let start = world.transform_point3(DVec3::new(0.0, j as f64, k as f64));
        if (start - middle).dot(normal).abs() > reach {
            return;
        }
        let (right, front) = (world.x_axis.normalize(), world.y_axis.normalize());
        for (i, value) in row.iter_mut().enumerate() {
            let point = start + i as f64 * world.x_axis;
            if self.distance_mm(point) < self.radius_mm {
                *value = value.max(self.hu);
                continue;
            }
            let off = point - middle;
            let (x, y) = (off.dot(right), off.dot(front));
            let turn = y.atan2(x);
            let wave: f64 = self.waves.iter().map(|(rays, phase)| (rays * turn + phase).cos()).sum();
            let streak = 0.5 * wave * wave.abs() * self.streak_hu * (-x.hypot(y) / FADE_MM).exp();
            *value = (*value + streak as f32).min(USUAL_HU.max(*value));
        }
    }

    fn distance_mm(&self, point: DVec3) -> f64 {
        let [from, to] = self.ends;
        let way = to - from;
        let share = ((point - from).dot(way) / way.length_squared().max(1e-12)).clamp(0.0, 1.0);
        point.distance(from + share * way)
    }
}
