//! Parameters of a synthetic head.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Smallest volume of a CT voxel, mm³: keeps a head under the voxel limit.
const LEAST_CT_VOXEL_MM3: f64 = 0.45;
/// Smallest volume of an MRI voxel, mm³.
const LEAST_MRI_VOXEL_MM3: f64 = 0.9;

/// Voxel edges, mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spacing {
    /// In-plane pixel size, mm.
    pub pixel_mm: f64,
    /// Slice spacing, mm.
    pub slice_mm: f64,
}

/// Ellipsoidal tumour in the brain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TumourRecipe {
    /// Semi-axes, mm.
    pub radii_mm: [f64; 3],
    /// MRI grey value over the brain's median.
    pub brightness: f64,
}

/// Differences of a head from the real head it is made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeadRecipe {
    /// Seed of the recipe and of noise, metal and tumour.
    pub seed: u64,
    /// Index of the base head.
    pub base: usize,
    /// Size along right, front and head, relative to the base.
    pub scale: [f64; 3],
    /// Shears xy, xz and yz.
    pub shear: [f64; 3],
    /// Rotation as axis times angle, degrees.
    pub turn_degrees: [f64; 3],
    /// Translation, mm.
    pub shift_mm: [f64; 3],
    /// Largest displacement of the spline along an axis, mm.
    pub warp_mm: f64,
    /// Thickness of the vault relative to the base.
    pub skull_thickness: f64,
    /// Outward growth of the ventricles, mm; negative for shrinking.
    pub ventricles_mm: f64,
    /// Retreat of the brain's surface, mm.
    pub atrophy_mm: f64,
    /// A tumour, if there is one.
    pub tumour: Option<TumourRecipe>,
    /// Voxel size of the CT.
    pub ct_spacing: Spacing,
    /// Gantry tilt, degrees.
    pub tilt_degrees: f64,
    /// Standard deviation of the CT's noise, HU.
    pub ct_noise_hu: f64,
    /// Number of dental fillings.
    pub fillings: usize,
    /// Number of clips in the brain.
    pub clips: usize,
    /// Voxel size of the MRI.
    pub mri_spacing: Spacing,
    /// Slice axis of the MRI: 0 right, 1 front, 2 head.
    pub mri_slice_axis: usize,
    /// Largest relative deviation of the MRI's bias field.
    pub mri_bias: f64,
}

impl HeadRecipe {
    /// A recipe close to the base: voxels of 1 mm, little noise, no pathology.
    pub fn mild(seed: u64, bases: usize) -> Self {
        Self {
            seed,
            base: (seed % bases.max(1) as u64) as usize,
            scale: [1.02, 0.98, 1.01],
            shear: [0.0; 3],
            turn_degrees: [2.0, 0.0, -1.0],
            shift_mm: [1.0, -2.0, 3.0],
            warp_mm: 1.0,
            skull_thickness: 1.0,
            ventricles_mm: 0.0,
            atrophy_mm: 0.0,
            tumour: None,
            ct_spacing: Spacing { pixel_mm: 0.8, slice_mm: 1.0 },
            tilt_degrees: 0.0,
            ct_noise_hu: 5.0,
            fillings: 0,
            clips: 0,
            mri_spacing: Spacing { pixel_mm: 1.0, slice_mm: 1.0 },
            mri_slice_axis: 2,
            mri_bias: 0.0,
        }
    }

    /// A random recipe: each factor is active in about half of the heads, a tumour in a third.
    pub fn drawn(seed: u64, bases: usize) -> Self {
        let mut random = Draws(random_of(seed, 1));
        let three = |random: &mut Draws, low: f64, high: f64| [0; 3].map(|_| random.between(low, high));
        let mut recipe = Self::mild(seed, bases);
        if random.chance(0.7) {
            recipe.scale = three(&mut random, 0.88, 1.12);
            recipe.shear = three(&mut random, -0.06, 0.06);
        }
        if random.chance(0.6) {
            let axis = random.direction();
            recipe.turn_degrees = (axis * random.between(2.0, 15.0)).to_array().map(rounded);
            recipe.shift_mm = three(&mut random, -40.0, 40.0);
        }
        recipe.warp_mm = random.maybe(0.6, 1.0, 2.0, 6.0);
        recipe.skull_thickness = random.maybe(0.5, 1.0, 0.6, 1.6);
        recipe.ventricles_mm = random.maybe(0.5, 0.0, -2.0, 6.0);
        recipe.atrophy_mm = random.maybe(0.5, 0.0, 0.5, 4.0);
        recipe.tumour = random.chance(1.0 / 3.0).then(|| TumourRecipe {
            radii_mm: three(&mut random, 5.0, 20.0),
            brightness: if random.chance(0.5) { random.between(1.35, 1.8) } else { random.between(0.3, 0.65) },
        });
        recipe.ct_spacing = random.spacing([0.5, 1.2], [0.5, 3.0], LEAST_CT_VOXEL_MM3);
        recipe.tilt_degrees = random.maybe(0.5, 0.0, 3.0, 20.0);
        recipe.ct_noise_hu = random.between(5.0, 60.0);
        recipe.fillings = random.maybe(0.35, 0.0, 1.0, 4.99) as usize;
        recipe.clips = usize::from(random.chance(0.2));
        recipe.mri_spacing = random.spacing([0.7, 1.2], [0.8, 3.0], LEAST_MRI_VOXEL_MM3);
        recipe.mri_slice_axis = if random.chance(0.5) { 2 } else { random.0.usize(0..3) };
        recipe.mri_bias = random.maybe(0.5, 0.0, 0.1, 0.4);
        recipe
    }

    /// Recipes of a run: the first is mild, the others are drawn from consecutive seeds.
    pub fn of_run(seed: u64, heads: usize, bases: usize) -> Vec<Self> {
        let of = |number: u64| match number {
            0 => Self::mild(seed, bases),
            _ => Self::drawn(seed.wrapping_add(number), bases),
        };
        (0..heads as u64).map(of).collect()
    }

    /// Describes the differences from the base in one line.
    pub fn describe(&self) -> String {
        let [x, y, z] = self.scale;
        let turn = DVec3::from_array(self.turn_degrees).length();
        let shear = self.shear.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let (ct, mri) = (self.ct_spacing, self.mri_spacing);
        let mut line = format!("head {} (base {}): size {x:.2} {y:.2} {z:.2}, turn {turn:.0}°", self.seed, self.base);
        let mut say = |on: bool, text: std::fmt::Arguments| {
            if on {
                _ = line.write_fmt(text);
            }
        };
        say(shear > 0.0, format_args!(", shear {shear:.2}"));
        say(self.warp_mm > 0.0, format_args!(", warp {:.1} mm", self.warp_mm));
        say(self.skull_thickness != 1.0, format_args!(", skull x{:.2}", self.skull_thickness));
        say(self.ventricles_mm != 0.0, format_args!(", ventricles {:+.1} mm", self.ventricles_mm));
        say(self.atrophy_mm > 0.0, format_args!(", atrophy {:.1} mm", self.atrophy_mm));
        if let Some(TumourRecipe { radii_mm: [a, b, c], brightness }) = self.tumour {
            say(true, format_args!(", tumour {a:.0}x{b:.0}x{c:.0} mm x{brightness:.1}"));
        }
        say(true, format_args!("; CT {:.2}/{:.1} mm, {:.0} HU", ct.pixel_mm, ct.slice_mm, self.ct_noise_hu));
        say(self.tilt_degrees != 0.0, format_args!(", tilt {:.0}°", self.tilt_degrees));
        say(self.fillings > 0, format_args!(", fillings {}", self.fillings));
        say(self.clips > 0, format_args!(", clips {}", self.clips));
        let slices = ["sagittal", "coronal", "axial"].get(self.mri_slice_axis).unwrap_or(&"?");
        say(true, format_args!("; MRI {:.2}/{:.1} mm {slices}", mri.pixel_mm, mri.slice_mm));
        say(self.mri_bias > 0.0, format_args!(", bias {:.2}", self.mri_bias));
        line
    }
}

/// Generator for one purpose, so that draws for one never shift those for another.
pub(super) fn random_of(seed: u64, purpose: u64) -> fastrand::Rng {
    let mut random = fastrand::Rng::with_seed(seed ^ purpose.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    // Seeds that differ by one bit start with similar values.
    fastrand::Rng::with_seed(random.u64(..))
}

/// Rounds to four decimals, so that a recipe survives JSON bit for bit.
fn rounded(value: f64) -> f64 {
    (1e4 * value).round() / 1e4
}

/// Random draws of a recipe.
struct Draws(fastrand::Rng);

impl Draws {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        rounded(low + (high - low) * self.0.f64())
    }

    fn chance(&mut self, share: f64) -> bool {
        self.0.f64() < share
    }

    /// A value of the range in a given share of the draws, else `off`.
    fn maybe(&mut self, share: f64, off: f64, low: f64, high: f64) -> f64 {
        let value = self.between(low, high);
        if self.chance(share) { value } else { off }
    }

    fn direction(&mut self) -> DVec3 {
        let (z, turn) = (self.between(-1.0, 1.0), self.between(0.0, core::f64::consts::TAU));
        let ring = (1.0 - z * z).sqrt();
        DVec3::new(ring * turn.cos(), ring * turn.sin(), z)
    }

    /// Spacing with log-uniform slices and pixels that keep the voxel above its smallest volume.
    fn spacing(&mut self, pixel: [f64; 2], slice: [f64; 2], least_mm3: f64) -> Spacing {
        let slice_mm = rounded(slice[0] * (slice[1] / slice[0]).powf(self.0.f64()));
        let least = (least_mm3 / slice_mm).sqrt().clamp(pixel[0], pixel[1]);
        Spacing { pixel_mm: self.between(least, pixel[1]), slice_mm }
    }
}
