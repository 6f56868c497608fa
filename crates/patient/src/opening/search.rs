//! Searches for an opening: intersects lines with bone and brain, and rates the places for a hole.
//!
//! # Theory
//! Bone begins and ends where the trilinear density crosses the isovalue. On each line within
//! [`HOLE_MM`] of a suitable place, the bone is 3 to 12 mm thick, the brain begins at most 8 mm
//! below it, and no air (a sinus, mastoid cells) lies between. The suitable place with the smallest
//! sum of squares is taken: deviation of the thickness from 6 mm and its spread, deviation of the
//! gap from 2 mm, slope of the outer table, and thickness at a flap's rim. Ties go to the first
//! ray.

use super::{BELOW_BONE_MM, Vec3};
use crate::PatientError;
use trepan_bone::BoneVolume;
use trepan_haptics::script::Site;
use trepan_volume::DistanceField;

/// Start of the rays, mm from the centre of the head.
pub(crate) const FAR_MM: f32 = 160.0;
/// Rays over the whole sphere.
const RAYS: usize = 3200;
/// Step along a line, mm; surfaces are interpolated between steps.
const STEP_MM: f32 = 0.25;
/// Radius around an entry that must be suitable, mm: a burr hole and a margin.
const HOLE_MM: f32 = 5.0;
/// Radius of a flap whose whole rim should lie on bone, mm.
const FLAP_MM: f32 = 14.0;
/// Lines on a circle.
const LINES: usize = 8;
/// Suitable thickness of bone, mm.
const BONE_MM: [f32; 2] = [3.0, 12.0];
/// Suitable gap between bone and brain, mm.
const GAP_MM: [f32; 2] = [0.0, 8.0];
/// Ideal thickness and gap, mm.
const BEST_MM: [f32; 2] = [6.0, 2.0];
/// Largest thickness of the vault if there is no brain to limit the search, mm.
const WALL_MM: f32 = 30.0;
/// A numerical parameter: density below which there is air, HU.
const AIR_BELOW_HU: f32 = -300.0;
/// Search range of a line before and after its neighbour's entry, mm.
const AROUND_MM: f32 = 10.0;
/// Penalty of a line that misses bone or brain, or meets air, mm.
const LOST_MM: f32 = 10.0;

/// Geometry that lines are intersected with.
pub(crate) struct Surroundings<'a> {
    pub bone: &'a BoneVolume,
    pub brain: Option<&'a DistanceField>,
    /// Centre of the head.
    pub centre: Vec3,
}

/// Depths along a line, mm.
#[derive(Clone, Copy, Debug)]
struct Passage {
    outer: f32,
    inner: f32,
    brain: f32,
    air: bool,
}

impl Passage {
    fn bone_mm(&self) -> f32 {
        self.inner - self.outer
    }

    fn gap_mm(&self) -> f32 {
        self.brain - self.inner
    }

    /// Deviation from the suitable ranges, mm; 0 if suitable.
    fn beyond(&self) -> f32 {
        let over = |value: f32, [low, high]: [f32; 2]| (low - value).max(value - high).max(0.0);
        let air = if self.air { LOST_MM } else { 0.0 };
        over(self.bone_mm(), BONE_MM) + over(self.gap_mm(), GAP_MM) + air
    }
}

/// A rated place.
struct Candidate {
    site: Site,
    /// Sum of its lines' deviations from the suitable ranges, mm.
    beyond_mm: f32,
    cost: f32,
}

impl Surroundings<'_> {
    /// Site on the line from a direction to the centre; `None` if the line misses bone, or brain
    /// below.
    pub fn towards(&self, outward: Vec3) -> Option<Site> {
        let from = self.centre + FAR_MM * outward;
        let way = self.passage(from, -outward, [0.0, FAR_MM])?;
        let (bone_mm, brain_mm) = (way.bone_mm(), way.brain - way.outer);
        Some(Site { entry: from - way.outer * outward, inward: -outward, bone_mm, brain_mm })
    }

    /// Best place on the upper right front if one is suitable there, else on the vault; the error
    /// says why none is.
    pub fn best(&self) -> Result<Site, PatientError> {
        let right_front = |d: &Vec3| d.x > 0.25 && d.y > -0.2 && d.z > 0.45;
        let vault = |d: &Vec3| d.z > 0.2;
        let suits = |found: &Option<Candidate>| found.as_ref().is_some_and(|best| best.beyond_mm == 0.0);
        let found = Some(self.best_of(right_front)).filter(suits).unwrap_or_else(|| self.best_of(vault));
        let remedy = "are CT and MRI of one head, upright, in one space (--register), and does the bone threshold fit (--isovalue-hu)? Or name a place with --opening X,Y,Z";
        let with_brain = |text: String| if self.brain.is_some() { text } else { String::new() };
        let fault = match found {
            Some(best) if best.beyond_mm == 0.0 => return Ok(best.site),
            Some(Candidate { site: Site { entry, bone_mm, brain_mm, .. }, .. }) => {
                let [thinnest, thickest] = BONE_MM;
                let wanted = with_brain(format!(" with brain at most {} mm below and no air between", GAP_MM[1]));
                let nearest = with_brain(format!(" and brain {:.1} mm below", brain_mm - bone_mm));
                format!(
                    "no place on the vault has bone {thinnest} to {thickest} mm thick{wanted} within {HOLE_MM} mm around; the nearest to it has bone of {bone_mm:.1} mm{nearest} at {entry:.0} (RAS mm)"
                )
            }
            None => format!("no line from above meets bone{}", with_brain(" and then brain".into())),
        };
        Err(PatientError::Case(format!("{fault}: {remedy}")))
    }

    fn best_of(&self, region: impl Fn(&Vec3) -> bool) -> Option<Candidate> {
        let all = rays().filter(region).filter_map(|outward| self.candidate(outward));
        all.min_by(|a, b| a.beyond_mm.total_cmp(&b.beyond_mm).then(a.cost.total_cmp(&b.cost)))
    }

    fn candidate(&self, outward: Vec3) -> Option<Candidate> {
        let site = self.towards(outward)?;
        let across = outward.any_orthonormal_vector();
        let along = outward.cross(across);
        let circle = |radius: f32| {
            (0..LINES).map(move |n| {
                let (sin, cos) = (n as f32 / LINES as f32 * std::f32::consts::TAU).sin_cos();
                radius * (cos * across + sin * along)
            })
        };
        let pass = |offset: Vec3| {
            let end = AROUND_MM + if self.brain.is_some() { site.brain_mm } else { WALL_MM };
            self.passage(site.entry + offset, -outward, [-AROUND_MM, end])
        };
        let hole: Vec<(Vec3, Passage)> = std::iter::once(Vec3::ZERO)
            .chain(circle(0.5 * HOLE_MM))
            .chain(circle(HOLE_MM))
            .filter_map(|offset| Some((offset, pass(offset)?)))
            .collect();
        let lost = (1 + 2 * LINES - hole.len()) as f32;
        let beyond_mm = LOST_MM * lost + hole.iter().map(|(_, way)| way.beyond()).sum::<f32>();
        let rim =
            circle(FLAP_MM).map(pass).map(|way| way.map_or(LOST_MM, |way| way.bone_mm() - BEST_MM[0] + way.beyond()));
        let rim = rim.map(|mm| (mm / LOST_MM).powi(2).min(1.0)).sum::<f32>() / LINES as f32;
        Some(Candidate { site, beyond_mm, cost: cost(&hole) + 4.0 * rim })
    }

    /// Intersects a line from `from` along `inward` with bone and brain between two depths. `None`
    /// if it misses either or meets brain first.
    fn passage(&self, from: Vec3, inward: Vec3, [start, end]: [f32; 2]) -> Option<Passage> {
        let over = |t: f32| self.bone.over_isovalue(from + t * inward);
        let begin = first(start, end, over)?;
        let brain = |t: f32| self.brain.map_or(-1.0, |field| -field.sample(from + t * inward));
        if first(start, begin, brain).is_some() {
            return None;
        }
        let limit = match self.brain {
            Some(_) => first(begin, end, brain)?,
            None => first(begin + STEP_MM, end.min(begin + WALL_MM), |t| open_below(t, &over))?,
        };
        let [outer, inner] = bone_along(self.bone, from, inward, [start, limit])?;
        let brain = if self.brain.is_some() { limit } else { inner + BELOW_BONE_MM };
        let air_at = AIR_BELOW_HU - f32::from(self.bone.isovalue());
        let steps = ((brain - outer) / STEP_MM) as usize;
        let air = self.brain.is_some() && (1..steps).any(|n| over(outer + n as f32 * STEP_MM) < air_at);
        Some(Passage { outer, inner, brain, air })
    }
}

/// 1 if no bone follows within 5 mm, else -1.
fn open_below(t: f32, over: &impl Fn(f32) -> f32) -> f32 {
    let bone = (0..(BELOW_BONE_MM / STEP_MM) as usize).any(|n| over(t + n as f32 * STEP_MM) >= 0.0);
    if bone { -1.0 } else { 1.0 }
}

/// Cost of a place: a sum of squares, each about 1 at a noticeable deviation.
fn cost(hole: &[(Vec3, Passage)]) -> f32 {
    let n = hole.len().max(1) as f32;
    let mean = |of: &dyn Fn(&Passage) -> f32| hole.iter().map(|(_, way)| of(way)).sum::<f32>() / n;
    let (bone, gap, outer) = (mean(&Passage::bone_mm), mean(&Passage::gap_mm), mean(&|way| way.outer));
    let spread = mean(&|way| (way.bone_mm() - bone).powi(2));
    let uneven = mean(&|way| (way.gap_mm() - gap).powi(2));
    // The least-squares slope of the outer table: offsets are symmetric about the centre.
    let moment: Vec3 = hole.iter().map(|(offset, way)| (way.outer - outer) * *offset).sum();
    let reach: f32 = 0.5 * hole.iter().map(|(offset, _)| offset.length_squared()).sum::<f32>();
    let slope = moment / reach.max(1e-6);
    let square = |value: f32, noticed: f32| (value / noticed).powi(2);
    square(bone - BEST_MM[0], 1.5) + square(gap - BEST_MM[1], 1.5) + spread + 0.5 * uneven + square(slope.length(), 0.2)
}

/// First entry into bone and last exit from it between two depths of a line, mm.
pub(crate) fn bone_along(bone: &BoneVolume, from: Vec3, inward: Vec3, [start, end]: [f32; 2]) -> Option<[f32; 2]> {
    let over = |t: f32| bone.over_isovalue(from + t * inward);
    let outer = first(start, end, over)?;
    let back = first(0.0, end - outer, |t| over(end - t))?;
    Some([outer, end - back])
}

/// First depth between `start` and `end` at which a value reaches 0, interpolated between steps,
/// mm.
pub(crate) fn first(start: f32, end: f32, value: impl Fn(f32) -> f32) -> Option<f32> {
    let steps = ((end - start) / STEP_MM).max(0.0) as usize;
    let mut before = None;
    for n in 0..=steps {
        let (t, now) = (start + n as f32 * STEP_MM, value(start + n as f32 * STEP_MM));
        if now >= 0.0 {
            let back = before.map_or(0.0, |before: f32| now / (now - before).max(1e-6));
            return Some(t - STEP_MM * back.clamp(0.0, 1.0));
        }
        before = Some(now);
    }
    None
}

/// Evenly distributed directions over the sphere.
fn rays() -> impl Iterator<Item = Vec3> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let of = move |i: usize| {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / RAYS as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    };
    (0..RAYS).map(of)
}
