//! Tumour in the brain: its place and its image contrast.

use super::base::BaseHead;
use super::recipe::{TumourRecipe, random_of};
use super::warp::Warp;
use glam::DVec3;

/// Number of places tried.
const TRIES: usize = 4000;
/// Required depth of the centre over the largest radius.
const DEPTH: f64 = 0.85;
/// Largest depth of a tumour's centre below the brain's centre, mm: keeps it in the cerebrum.
const BELOW_MM: f64 = 15.0;
/// Width of the border in the image, mm.
const BORDER_MM: f64 = 1.5;

/// Ellipsoidal tumour in the new head.
pub struct Tumour {
    middle: DVec3,
    radii: DVec3,
    /// MRI grey value over the brain's median.
    pub brightness: f64,
}

impl Tumour {
    /// Places a tumour deep enough in the brain, shrunk if no place is deep enough.
    pub fn placed(recipe: &TumourRecipe, seed: u64, warp: &Warp, base: &BaseHead) -> Self {
        let mut random = random_of(seed, 3);
        let (low, high) = warp.corners();
        let mut radii = DVec3::from_array(recipe.radii_mm);
        let wanted = DEPTH * radii.max_element();
        let (mut middle, mut deepest) = (0.5 * (low + high), f64::MIN);
        for _ in 0..TRIES {
            let point = low + (high - low) * DVec3::new(random.f64(), random.f64(), random.f64());
            let place = warp.place(point).base;
            if f64::from(place.z) < base.anatomy.middle.z - BELOW_MM {
                continue;
            }
            let depth = -f64::from(base.anatomy.truth.sample(place));
            if depth > deepest {
                (middle, deepest) = (point, depth);
            }
            if depth >= wanted {
                break;
            }
        }
        radii *= (deepest / wanted).clamp(0.0, 1.0);
        Self { middle, radii, brightness: recipe.brightness }
    }

    /// Share of a voxel that is tumour, 0 to 1; above 0.5 inside.
    pub fn share(&self, point: DVec3) -> f64 {
        let level = ((point - self.middle) / self.radii).length();
        ((1.0 - level) * self.radii.min_element() / BORDER_MM + 0.5).clamp(0.0, 1.0)
    }
}
