//! Hits against a brute-force f64 march, with leaping against without, sparse rays against all, and
//! walls that no ray may pass.

use super::scenes::{ISO, frame, head};
use super::{By, EXACT, FINE_VOXEL, Hits, SPARSE, Setting};
use glam::{DVec3, IVec3, Vec2, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_gpu::Gpu;
use trepan_render::{Casting, Frame, Hit, View};
use trepan_volume::{AIR_HU, VoxelVolume};

/// Rays through the pixels' centres, row by row.
pub fn rays(view: &View, [width, height]: [u32; 2]) -> impl Iterator<Item = Vec3> {
    let pixels = (0..width * height).map(move |n| Vec2::new((n % width) as f32 + 0.5, (n / width) as f32 + 0.5));
    pixels.map(move |p| view.ray(Vec2::new(2.0 * p.x / width as f32 - 1.0, 1.0 - 2.0 * p.y / height as f32)))
}

/// Distance to bone along a ray by small steps through the trilinear density in f64, mm: no bricks,
/// no cells, no roots. Peaks between steps are searched, so that a ray that grazes bone for less
/// than a step hits it.
pub fn march(bone: &BoneVolume, eye: Vec3, along: Vec3) -> Option<f64> {
    let spacing = f64::from(bone.spacing_mm());
    let (start, step) = (bone.grid_of(eye).as_dvec3(), along.as_dvec3());
    let middle = DVec3::from(bone.dims().map(|n| 0.5 * (n as f64 - 1.0)));
    let reach = middle.length() + 2.0;
    let over = |at: f64| density(bone, start + at * step) - f64::from(bone.isovalue());
    let closest = (middle - start).dot(step);
    let (mut before, mut under) = (-1e9, -1e9);
    let mut at = (closest - reach).max(0.0);
    while at < closest + reach {
        let now = over(at);
        if now >= 0.0 {
            return Some((at - FINE_VOXEL * now / (now - under)) * spacing);
        }
        if under > before && under >= now {
            let peak = peak(over, at - 2.0 * FINE_VOXEL, at);
            if over(peak) >= 0.0 {
                return Some(peak * spacing);
            }
        }
        (before, under) = (under, now);
        at += FINE_VOXEL;
    }
    None
}

/// Where a function with one peak between two places has it, by ternary search.
fn peak(of: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..24 {
        let third = (high - low) / 3.0;
        if of(low + third) < of(high - third) { low += third } else { high -= third }
    }
    0.5 * (low + high)
}

fn density(bone: &BoneVolume, at: DVec3) -> f64 {
    let (low, share) = (at.floor().as_ivec3(), at - at.floor());
    let corner = |n: i32| {
        let bit = IVec3::new(n & 1, n >> 1 & 1, n >> 2);
        let part = DVec3::select(bit.cmpeq(IVec3::ONE), share, 1.0 - share);
        part.x * part.y * part.z * f64::from(bone.hu(low + bit))
    };
    (0..8).map(corner).sum()
}

/// Every drawer's hits against the march, and with leaping against without.
pub fn depth(scope: Scope, gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = scope.pick([96, 72], [320, 240]);
    let bone = head(scope.pick(72, 160));
    let frame = frame(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.5), scope.pick(120.0, 260.0), 0.6);
    sparse(&bone, &frame, size.map(|n| 2 * n), findings);
    let mut truth: Option<Hits> = None;
    for mut by in By::all(&bone, gpu, size) {
        by.draw(&frame);
        let (view, leapt) = (by.view(&frame), by.hits());
        let march = |along| march(&bone, view.eye, along).map(|mm| Hit { distance_mm: mm as f32, normal: along });
        let truth = truth.get_or_insert_with(|| rays(&view, size).map(march).collect());
        let (errors, lost) = apart(&leapt, truth);
        let p99 = errors.get(errors.len() * 99 / 100).copied().unwrap_or(f64::NAN);
        by.set(&Setting { casting: Casting { leap: false, ..Casting::default() }, ..EXACT }, size);
        by.draw(&frame);
        let (moved, gone) = apart(&leapt, &by.hits());
        let most = moved.last().copied().unwrap_or(f64::NAN);
        let name = by.name();
        let row = Row::new("hits on a drilled shell", name).with("rays", leapt.len()).with("machine", by.machine());
        findings.rows.push(
            row.metric("depth_error_p99_voxel", p99)
                .metric("hits_on_one_side_percent", 100.0 * lost as f64 / leapt.len() as f64)
                .metric("depth_change_by_leaping_voxel", most),
        );
        findings.gates.extend([
            Gate::at_most(format!("{name}: depth of hit against steps of 1/16 voxel, p99 voxel"), p99, 0.1),
            Gate::at_most(
                format!("{name}: rays that hit on one side only, percent"),
                100.0 * lost as f64 / leapt.len() as f64,
                0.1,
            ),
            Gate::at_most(format!("{name}: hits gained or lost by leaping"), gone as f64, 0.0),
            Gate::at_most(format!("{name}: largest change of a hit by leaping, voxel"), most, 1e-3),
        ]);
    }
}

/// Sorted distances between hits, voxels of 1 mm, and the rays that hit on one side only.
pub fn apart(a: &[Option<Hit>], b: &[Option<Hit>]) -> (Vec<f64>, usize) {
    let both = a.iter().zip(b).filter_map(|(a, b)| Some((a.as_ref()?.distance_mm, b.as_ref()?.distance_mm)));
    let mut distances: Vec<f64> = both.map(|(a, b)| f64::from((a - b).abs())).collect();
    distances.sort_by(f64::total_cmp);
    (distances, a.iter().zip(b).filter(|(a, b)| a.is_some() != b.is_some()).count())
}

/// Sparse rays against all of them, by the processor.
fn sparse(bone: &Arc<BoneVolume>, frame: &Frame, size: [u32; 2], findings: &mut Findings) {
    let mut by = By::all(bone, None, size).remove(0);
    by.draw(frame);
    let exact = by.hits();
    by.set(&SPARSE, size);
    by.draw(frame);
    let (errors, lost) = apart(&by.hits(), &exact);
    let p99 = errors.get(errors.len() * 99 / 100).copied().unwrap_or(f64::NAN);
    let share = 100.0 * lost as f64 / exact.len() as f64;
    let row = Row::new("hits on a drilled shell", "processor: sparse rays").with("rays", exact.len());
    findings.rows.push(row.metric("depth_error_p99_voxel", p99).metric("hits_on_one_side_percent", share));
    findings.gates.extend([
        Gate::at_most("sparse rays: depth of hit against a ray for every pixel, p99 voxel", p99, 0.1),
        Gate::at_most("sparse rays: rays that hit on one side only, percent", share, 0.1),
    ]);
}

/// Voxels drilled between two pictures: in the second one every ray is where a picture of the
/// drilled bone that is loaded anew has it.
pub fn edits(gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = [96, 72];
    let frame = frame(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.5), 120.0, 0.6);
    for number in 0..By::all(&head(40), gpu, [8, 8]).len() {
        let bone = head(72);
        let mut by = By::all(&bone, gpu, size).remove(number);
        by.draw(&frame);
        let before = by.hits();
        let site = bone.voxel_of(Vec3::new(4.0, 27.0, 14.0));
        for n in 0..9 * 9 * 9 {
            bone.set_hu(site + IVec3::new(n % 9 - 4, n / 9 % 9 - 4, n / 81 - 4), AIR_HU);
        }
        by.draw(&frame);
        let after = by.hits();
        let mut anew = By::all(&bone, gpu, size).remove(number);
        anew.draw(&frame);
        let stale = after.iter().zip(&anew.hits()).filter(|(a, b)| a != b).count();
        let seen = before.iter().zip(&after).filter(|(a, b)| a != b).count();
        let name = by.name();
        let row = Row::new("voxels drilled between two pictures", name).with("voxels", 729);
        findings.rows.push(row.metric("rays_changed_count", seen as f64).metric("stale_rays_count", stale as f64));
        findings.gates.extend([
            Gate::at_least(format!("{name}: rays that see drilled voxels in the next picture"), seen as f64, 20.0),
            Gate::at_most(format!("{name}: rays that still see what was drilled away"), stale as f64, 0.0),
        ]);
    }
}

/// Walls of one layer just over the isovalue, between air: no ray may pass.
pub fn walls(gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = [64, 48];
    let tilts = [Vec3::ZERO, Vec3::new(0.9, 0.4, 0.2), Vec3::new(-0.2, 0.7, -0.8)];
    let mut lost: Vec<(&str, usize, usize)> = Vec::new();
    for axis in 0..3 {
        let mut ct = VoxelVolume::isotropic([40; 3], Vec3::splat(-19.5), 1.0, AIR_HU);
        for at in 0..ct.data.len() {
            if [at % 40, at / 40 % 40, at / 1600][axis] == 20 {
                ct.data[at] = ISO + 1;
            }
        }
        let bone = Arc::new(BoneVolume::new(&ct, ISO).expect("the wall is bone"));
        for (number, mut by) in By::all(&bone, gpu, size).into_iter().enumerate() {
            lost.resize(lost.len().max(number + 1), (by.name(), 0, 0));
            for tilt in tilts {
                by.draw(&frame(Vec3::ZERO, Vec3::AXES[axis] + tilt, 100.0, 0.05));
                let hits = by.hits();
                lost[number].1 += hits.iter().filter(|hit| hit.is_none()).count();
                lost[number].2 += hits.len();
            }
        }
    }
    for (name, lost, of) in lost {
        let row = Row::new("wall of one voxel", name).with("rays", of);
        findings.rows.push(row.metric("rays_through_count", lost as f64));
        findings.gates.push(Gate::at_most(
            format!("{name}: rays through a wall of one voxel, of {of}"),
            lost as f64,
            0.0,
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_march_finds_a_slab_where_it_is() {
        let mut ct = VoxelVolume::isotropic([24; 3], Vec3::splat(-11.5), 1.0, AIR_HU);
        (0..ct.data.len()).filter(|at| at / 576 >= 12).for_each(|at| ct.data[at] = 1800);
        let bone = BoneVolume::new(&ct, ISO).unwrap();
        // From -1000 HU at -0.5 mm to 1800 HU at 0.5 mm: 400 HU lies at 0.
        let mm = march(&bone, Vec3::new(0.3, 0.2, -50.0), Vec3::Z).unwrap();
        assert!((mm - 50.0).abs() < 1e-6, "{mm}");
        assert_eq!(march(&bone, Vec3::new(30.0, 0.0, -50.0), Vec3::Z), None);
        assert!((peak(|x| -(x - 0.3).powi(2), -1.0, 2.0) - 0.3).abs() < 1e-3);
    }
}
