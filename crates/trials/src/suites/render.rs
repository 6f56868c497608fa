//! The picture: rays against a brute-force f64 march, device against processor, and what leaping, steps and resolution are worth.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use crate::timer::Samples;
use glam::{DVec3, IVec3, Vec2, Vec3};
use std::sync::Arc;
use trepan_gpu::{Gpu, Prefer};
use trepan_render::{Camera, Casting, Frame, Hit, Image, ProcessorRenderer, Renderer, SceneData, SliceLook, View};
use trepan_volume::{AIR_HU, BoneVolume, VoxelVolume};

const ISO: i16 = 400;
/// Step of the reference along a ray, voxels.
const FINE_VOXEL: f64 = 1.0 / 16.0;

type Hits = Vec<Option<Hit>>;

/// Who draws.
enum By {
    Processor(Box<ProcessorRenderer>),
    Device(Box<Renderer>),
}

/// What of the 3-D view is drawn, and how.
#[derive(Clone, Copy)]
struct Setting {
    name: &'static str,
    casting: Casting,
    /// Share of the pixels along an edge.
    detail: f32,
}

/// Accuracy on small pictures, then speed against image error on a large one.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    // Without a driver the processor's rows are all there are.
    let gpu = Gpu::open(Prefer::Hardware).ok();
    if scope.takes(0) {
        depth(scope, gpu.as_ref(), &mut findings);
        walls(gpu.as_ref(), &mut findings);
    }
    if scope.takes(1) {
        speed(scope, gpu.as_ref(), &mut findings);
    }
    findings
}

impl By {
    /// The processor, and the device if there is one.
    fn all(bone: &Arc<BoneVolume>, gpu: Option<&Gpu>, size: [u32; 2]) -> Vec<Self> {
        let data = SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None };
        let processor = ProcessorRenderer::new(&data, size).expect("the scene loads");
        let device = gpu.map(|gpu| Self::Device(Box::new(Renderer::new(gpu, &data, size).expect("the scene loads"))));
        [Some(Self::Processor(Box::new(processor))), device].into_iter().flatten().collect()
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Processor(_) => "processor",
            Self::Device(_) => "device",
        }
    }

    fn machine(&self) -> String {
        match self {
            Self::Processor(p) => format!("{} threads", p.threads),
            Self::Device(r) => r.gpu().name(),
        }
    }

    /// Casts the next picture anew, in this way.
    fn set(&mut self, setting: &Setting, size: [u32; 2]) {
        match self {
            Self::Processor(p) => {
                p.resize(size.map(|n| (n as f32 * setting.detail).round() as u32)).expect("the size is allowed");
                p.set_casting(setting.casting);
            }
            Self::Device(r) => {
                r.set_detail(setting.detail).expect("the size is allowed");
                r.set_leaping(setting.casting.leap);
            }
        }
    }

    /// Draws and waits.
    fn draw(&mut self, frame: &Frame) {
        match self {
            Self::Processor(p) => drop(p.draw(frame).expect("drawn")),
            Self::Device(r) => {
                r.draw(frame).expect("drawn");
                r.gpu().wait().expect("the device answers");
            }
        }
    }

    fn hits(&self) -> Hits {
        match self {
            Self::Processor(p) => p.bone_hits(),
            Self::Device(r) => r.bone_hits().expect("the hits are read"),
        }
    }

    fn image(&self) -> Image {
        match self {
            Self::Processor(p) => p.image().clone(),
            Self::Device(r) => r.image().expect("the picture is read"),
        }
    }

    fn view(&self, frame: &Frame) -> View {
        match self {
            Self::Processor(p) => p.view(frame),
            Self::Device(r) => r.view(frame),
        }
    }
}

/// The 3-D view alone.
fn frame(target: Vec3, towards_eye: Vec3, distance_mm: f32, fov_rad: f32) -> Frame<'static> {
    let camera = Camera { fov_rad, ..Camera::viewed_from(target, towards_eye, distance_mm) };
    Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
}

/// A shell of bone with waves on it and a drilled hole with sharp edges.
fn head(edge: usize) -> Arc<BoneVolume> {
    let half = 0.5 * (edge as f64 - 1.0);
    let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(-half as f32), 1.0, AIR_HU);
    for at in 0..ct.data.len() {
        let p = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]);
        let depth = (p.length() - 0.8 * half - (0.3 * p.x).sin() * (0.3 * p.z).cos()).abs();
        let drilled = (p - DVec3::new(0.1, 0.7, 0.4) * half).length() < 0.15 * half;
        ct.data[at] = if drilled { AIR_HU } else { (400.0 + 250.0 * (3.0 - depth)).clamp(-1000.0, 1400.0) as i16 };
    }
    Arc::new(BoneVolume::new(&ct, ISO).expect("the scene has bone"))
}

/// Rays through the pixels' centres, row by row.
fn rays(view: &View, [width, height]: [u32; 2]) -> impl Iterator<Item = Vec3> {
    let pixels = (0..width * height).map(move |n| Vec2::new((n % width) as f32 + 0.5, (n / width) as f32 + 0.5));
    pixels.map(move |p| view.ray(Vec2::new(2.0 * p.x / width as f32 - 1.0, 1.0 - 2.0 * p.y / height as f32)))
}

/// Distance to bone along a ray by small steps through the trilinear density in f64, mm: no bricks, no cells, no roots.
fn march(bone: &BoneVolume, eye: Vec3, along: Vec3) -> Option<f64> {
    let spacing = f64::from(bone.spacing_mm());
    let (start, step) = (bone.grid_of(eye).as_dvec3(), along.as_dvec3());
    let middle = DVec3::from(bone.dims().map(|n| 0.5 * (n as f64 - 1.0)));
    let reach = middle.length() + 2.0;
    let (closest, mut under) = ((middle - start).dot(step), -1e9);
    let mut at = (closest - reach).max(0.0);
    while at < closest + reach {
        let over = density(bone, start + at * step) - f64::from(bone.isovalue());
        if over >= 0.0 {
            return Some((at - FINE_VOXEL * over / (over - under)) * spacing);
        }
        under = over;
        at += FINE_VOXEL;
    }
    None
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
fn depth(scope: Scope, gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = scope.pick([96, 72], [320, 240]);
    let bone = head(scope.pick(72, 160));
    let frame = frame(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.5), scope.pick(120.0, 260.0), 0.6);
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
                format!("{name}: rays that hit on one side only, of {}", leapt.len()),
                lost as f64,
                0.001 * leapt.len() as f64,
            ),
            Gate::at_most(format!("{name}: hits gained or lost by leaping"), gone as f64, 0.0),
            Gate::at_most(format!("{name}: largest change of a hit by leaping, voxel"), most, 1e-3),
        ]);
    }
}

/// Sorted distances between hits, voxels of 1 mm, and the rays that hit on one side only.
fn apart(a: &[Option<Hit>], b: &[Option<Hit>]) -> (Vec<f64>, usize) {
    let both = a.iter().zip(b).filter_map(|(a, b)| Some((a.as_ref()?.distance_mm, b.as_ref()?.distance_mm)));
    let mut distances: Vec<f64> = both.map(|(a, b)| f64::from((a - b).abs())).collect();
    distances.sort_by(f64::total_cmp);
    (distances, a.iter().zip(b).filter(|(a, b)| a.is_some() != b.is_some()).count())
}

/// Walls of one layer just over the isovalue, between air: no ray may pass.
fn walls(gpu: Option<&Gpu>, findings: &mut Findings) {
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

const EXACT: Setting = Setting { name: "exact", casting: Casting { leap: true, step_voxel: None }, detail: 1.0 };

const fn stepped(name: &'static str, step: f32) -> Setting {
    Setting { name, casting: Casting { leap: true, step_voxel: Some(step) }, detail: 1.0 }
}

/// The first is what all pictures are drawn with; steps are the processor's alone.
const SETTINGS: [Setting; 7] = [
    EXACT,
    Setting { name: "exact, no leaping", casting: Casting { leap: false, step_voxel: None }, detail: 1.0 },
    stepped("steps of 1/4 voxel", 0.25),
    stepped("steps of 1 voxel", 1.0),
    stepped("steps of 2 voxels", 2.0),
    Setting { name: "exact, 3/4 of the pixels along an edge", detail: 0.75, ..EXACT },
    Setting { name: "exact, 1/2 of the pixels along an edge", detail: 0.5, ..EXACT },
];

/// Time of a picture whose camera moves, against its difference from the processor's picture with steps of 1/16 voxel.
fn speed(scope: Scope, gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = scope.pick([640, 480], [1680, 1050]);
    let bone = head(160);
    let here = frame(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.5), 280.0, 0.6);
    let aside = frame(Vec3::ZERO, Vec3::new(0.21, 1.0, 0.5), 280.0, 0.6);
    let mut drawers = By::all(&bone, gpu, size);
    drawers[0].set(&stepped("reference", FINE_VOXEL as f32), size);
    drawers[0].draw(&here);
    let reference = drawers[0].image();
    let mut pictures = Vec::new();
    for by in &mut drawers {
        let device = matches!(by, By::Device(_));
        for setting in SETTINGS.iter().filter(|s| !device || s.casting.step_voxel.is_none()) {
            by.set(setting, size);
            by.draw(&aside);
            // Each picture moves the camera, so every ray is cast; the last one is seen from here.
            let times = Samples::of(scope.pick(3, 9), |n| by.draw(if n % 2 == 0 { &here } else { &aside }));
            let image = enlarged(&by.image(), size);
            let mut row = Row::new(
                format!("drilled shell at {}x{}", size[0], size[1]),
                format!("{}: {}", by.name(), setting.name),
            )
            .with("machine", by.machine())
            .metric("frame_p50_ms", 1e-3 * times.quantile(0.5))
            .metric("frames_per_s", 1e6 / times.quantile(0.5))
            .metric("image_error_percent", error_percent(&image, &reference))
            .metric("ssim", similarity(&image, &reference));
            if let By::Processor(p) = by {
                row = row.metric("steps_per_ray", p.steps_per_ray());
            }
            findings.rows.push(row);
            if setting.name == EXACT.name {
                let like = similarity(&image, &reference);
                findings.gates.push(Gate::at_least(format!("{}: SSIM to steps of 1/16 voxel", by.name()), like, 0.99));
                pictures.push(image);
            }
        }
    }
    if let [processor, device] = &pictures[..] {
        findings.gates.push(Gate::at_least("SSIM of device and processor", similarity(device, processor), 0.99));
    }
}

/// A smaller picture at another size, linearly.
fn enlarged(image: &Image, [width, height]: [u32; 2]) -> Image {
    if [image.width, image.height] == [width, height] {
        return image.clone();
    }
    let mut rgba = Vec::with_capacity(4 * (width * height) as usize);
    let scale = Vec2::new(image.width as f32 / width as f32, image.height as f32 / height as f32);
    let last = Vec2::new(image.width as f32, image.height as f32) - 1.0;
    for n in 0..width * height {
        let at = ((Vec2::new((n % width) as f32, (n / width) as f32) + 0.5) * scale - 0.5).clamp(Vec2::ZERO, last);
        let (low, share) = (at.floor(), at.fract());
        let pixel = |x: f32, y: f32| {
            let [r, g, b, _] = image.pixel((low.x + x).min(last.x) as u32, (low.y + y).min(last.y) as u32);
            Vec3::new(r.into(), g.into(), b.into())
        };
        let row = |y: f32| pixel(0.0, y).lerp(pixel(1.0, y), share.x);
        let [r, g, b] = row(0.0).lerp(row(1.0), share.y).round().to_array();
        rgba.extend([r as u8, g as u8, b as u8, 255]);
    }
    Image { width, height, rgba }
}

/// Root mean square difference of all colours, percent of white.
fn error_percent(a: &Image, b: &Image) -> f64 {
    let squares = a.rgba.iter().zip(&b.rgba).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
    // The fourth byte never differs.
    (squares.sum::<f64>() / (0.75 * a.rgba.len() as f64)).sqrt() / 2.55
}

/// Mean structural similarity of the green channels over windows of 8x8 pixels (Wang et al. 2004).
fn similarity(a: &Image, b: &Image) -> f64 {
    let index = |x: u32, y: u32| {
        let mut sums = [0.0f64; 5];
        for n in 0..64 {
            let green = |image: &Image| f64::from(image.pixel(x + n % 8, y + n / 8)[1]);
            let (p, q) = (green(a), green(b));
            for (sum, value) in sums.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                *sum += value / 64.0;
            }
        }
        let [ma, mb, aa, bb, ab] = sums;
        let (c1, c2) = (6.5025, 58.5225);
        (2.0 * ma * mb + c1) * (2.0 * (ab - ma * mb) + c2)
            / ((ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2))
    };
    let (columns, rows) = (a.width / 8, a.height / 8);
    let sum: f64 = (0..columns * rows).map(|n| index(8 * (n % columns), 8 * (n / columns))).sum();
    sum / f64::from(columns * rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measures_of_pictures_are_zero_and_one_for_equal_ones_and_see_a_difference() {
        let of = |shift: u32| Image {
            width: 32,
            height: 16,
            rgba: (0..512u32)
                .flat_map(|n| [((n * 7 + shift) % 200) as u8, ((n * 13 + shift * 5) % 250) as u8, 9, 255])
                .collect(),
        };
        assert_eq!(error_percent(&of(0), &of(0)), 0.0);
        assert!((similarity(&of(0), &of(0)) - 1.0).abs() < 1e-12);
        assert!(error_percent(&of(0), &of(3)) > 1.0 && similarity(&of(0), &of(30)) < 0.9);
        assert_eq!(enlarged(&of(0), [32, 16]), of(0));
        assert_eq!(enlarged(&enlarged(&of(0), [64, 32]), [32, 16]).width, 32);
    }

    #[test]
    fn the_march_finds_a_slab_where_it_is() {
        let mut ct = VoxelVolume::isotropic([24; 3], Vec3::splat(-11.5), 1.0, AIR_HU);
        (0..ct.data.len()).filter(|at| at / 576 >= 12).for_each(|at| ct.data[at] = 1800);
        let bone = BoneVolume::new(&ct, ISO).unwrap();
        // From -1000 HU at -0.5 mm to 1800 HU at 0.5 mm: 400 HU lies at 0.
        let mm = march(&bone, Vec3::new(0.3, 0.2, -50.0), Vec3::Z).unwrap();
        assert!((mm - 50.0).abs() < 1e-6, "{mm}");
        assert_eq!(march(&bone, Vec3::new(30.0, 0.0, -50.0), Vec3::Z), None);
    }
}
