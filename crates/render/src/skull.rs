//! The skull's pass: densities on the device, changed bricks followed, rays cast only where something changed.
//!
//! # Theory
//! Within a cell the density is trilinear, so along a ray it is a cubic; its first root is found exactly (Marmitt et al. 2004), and no wall is
//! too thin to be seen. See `skull.wgsl`.
//!
//! # Practice
//! Half-precision densities: exact for whole HU up to 2048, which holds every useful isovalue. The hits of the last picture are kept: with
//! a resting camera only the part of the picture that shows changed bricks is cast again, and the whole once the drilling rests (ambient
//! light reaches farther than a brick).

use crate::RenderError;
use crate::bricks::{BLOCK, Grid, LEAP, Leaps, densities};
use crate::camera::View;
use crate::scene::Scene;
use glam::Vec3;
use std::sync::Arc;
use trepan_geometry::Aabb;
use trepan_gpu::{
    Bindings, Buffer, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Target, Texture,
    TextureSpec, Topology,
};
use trepan_volume::{BRICK, BoneVolume};

/// Bytes of densities handed to the device at once while loading.
const LOAD_BYTES: usize = 16 << 20;

/// Around changed bone, where the picture is cast again at once, mm.
const MARGIN_MM: f32 = 4.0;

/// What a ray that meets nothing stores as its distance.
pub(crate) const NOTHING: f32 = 1e30;

/// The slots of [`Skull::volumes`].
pub(crate) const VOLUMES: [Slot; 4] = [Slot::Texture3, Slot::Sampler, Slot::Integer3, Slot::Texture3];

/// The skull on the device.
#[derive(Debug)]
pub(crate) struct Skull {
    bone: Arc<BoneVolume>,
    pub grid: Grid,
    leaps: Leaps,
    seen: Vec<u32>,
    pub density: Texture,
    leap: Texture,
    crowd: Texture,
    pipeline: Pipeline,
    cast_for: Option<View>,
    changed: Aabb,
    unsettled: bool,
}

/// What following the bone came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Followed {
    pub bricks: u32,
    pub left: u32,
}

impl Skull {
    pub fn new(gpu: &Gpu, bone: Arc<BoneVolume>) -> Result<Self, RenderError> {
        let grid = Grid::of(&bone);
        let seen = bone.seen();
        let leaps = Leaps::of(&bone, &grid);
        let volume = |label, size: [usize; 3], format| {
            Texture::new(
                gpu,
                &TextureSpec { label, size: size.map(|n| n as u32), volume: true, format, drawn_to: false },
            )
        };
        let density = volume("density", grid.dims, Format::R16Float)?;
        let leap = volume("leap", leaps.bricks, Format::R8Uint)?;
        let crowd = volume("crowd", grid.blocks(), Format::R8Unorm)?;
        let slots = [&[Slot::Uniform], &VOLUMES[..]].concat();
        let pipeline = Pipeline::new(
            gpu,
            &PipelineSpec {
                label: "skull",
                wgsl: trepan_shaders::RENDER_SKULL,
                slots: &slots,
                targets: &[Format::Rgba32Float],
                depth: false,
                blend: false,
                topology: Topology::Triangles,
            },
        )?;
        let (changed, cast_for) = (Aabb::EMPTY, None);
        let skull =
            Self { bone, grid, leaps, seen, density, leap, crowd, pipeline, cast_for, changed, unsettled: false };
        skull.load(gpu);
        Ok(skull)
    }

    /// Hands everything to the device, a few layers at a time.
    fn load(&self, gpu: &Gpu) {
        let [nx, ny, nz] = self.grid.dims;
        let layers = (LOAD_BYTES / (2 * nx * ny)).max(1);
        for first in (0..nz).step_by(layers) {
            self.upload(gpu, [0, 0, first], [nx, ny, layers.min(nz - first)]);
            // Submitting lets the device take the layers over before the next ones come.
            gpu.record("load").submit();
        }
        self.leap.write(gpu, [0; 3], self.leap.size(), &self.leaps.free);
        let [bx, by, bz] = self.grid.blocks();
        let place = |at: usize| [at % bx, at / bx % by, at / (bx * by)];
        let shares: Vec<u8> = (0..bx * by * bz).map(|at| self.grid.share(&self.bone, place(at))).collect();
        self.crowd.write(gpu, [0; 3], self.crowd.size(), &shares);
    }

    fn upload(&self, gpu: &Gpu, first: [usize; 3], size: [usize; 3]) {
        let values = densities(&self.bone, first, size, |hu| half::f16::from_f32(hu.into()));
        self.density.write(gpu, first.map(|v| v as u32), size.map(|v| v as u32), &values);
    }

    /// Brings up to `limit` changed bricks to the device.
    pub fn follow(&mut self, gpu: &Gpu, limit: usize) -> Followed {
        let mut changed = Vec::new();
        let bone = self.bone.clone();
        let left = bone.changed(&mut self.seen, limit, |brick| changed.push(brick));
        for &brick in &changed {
            self.refresh(gpu, brick);
        }
        Followed { bricks: changed.len() as u32, left: left as u32 }
    }

    /// Brings one brick of voxels to the device, with the bricks of cells and the blocks that it touches.
    fn refresh(&mut self, gpu: &Gpu, brick: [usize; 3]) {
        let first = brick.map(|b| b * BRICK + 1);
        let size = [0, 1, 2].map(|a| BRICK.min(self.grid.dims[a] - 1 - first[a]));
        self.upload(gpu, first, size);
        let mut anew = false;
        for n in 0..27 {
            let cells = [n % 3, n / 3 % 3, n / 9];
            let cells = [0, 1, 2].map(|a| brick[a] * (BRICK / LEAP) + cells[a]);
            if (0..3).all(|a| cells[a] < self.leaps.bricks[a]) {
                anew |= self.leaps.refresh(&self.bone, cells);
                let free = self.leaps.free[self.leaps.index(cells)];
                self.leap.write(gpu, cells.map(|v| v as u32), [1; 3], &[free]);
            }
        }
        if anew {
            self.leap.write(gpu, [0; 3], self.leap.size(), &self.leaps.free);
        }
        let blocks = self.grid.blocks();
        for n in 0..27 {
            let block = [n % 3, n / 3 % 3, n / 9];
            let block = [0, 1, 2].map(|a| first[a] / BLOCK + block[a]);
            if (0..3).all(|a| block[a] < blocks[a]) {
                self.crowd.write(gpu, block.map(|v| v as u32), [1; 3], &[self.grid.share(&self.bone, block)]);
            }
        }
        let corner = |voxel: [usize; 3]| self.grid.origin + self.grid.spacing_mm * Vec3::from(voxel.map(|v| v as f32));
        let high = [0, 1, 2].map(|a| first[a] + size[a]);
        self.changed = self.changed.grown(corner(first.map(|v| v - 1))).grown(corner(high));
    }

    /// What `bricks.wgsl` binds, after the uniform.
    pub fn volumes(&self) -> [Resource<'_>; 4] {
        [(&self.density).into(), Resource::Linear, (&self.leap).into(), (&self.crowd).into()]
    }

    /// Binds the pass to the frame's uniform.
    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>) -> Result<Bindings, RenderError> {
        Ok(self.pipeline.bind(gpu, &[&[scene.into()], &self.volumes()[..]].concat())?)
    }

    /// Forgets the hits, so that the next picture casts all rays.
    pub fn forget(&mut self) {
        self.cast_for = None;
    }

    /// Casts what has to be cast again into `hits`. Returns the number of pixels.
    pub fn cast(&mut self, recorder: &mut Recorder, bindings: &Bindings, view: &View, hits: &Texture) -> u32 {
        let [width, height, _] = hits.size();
        let whole = [0, 0, width, height];
        let resting = self.cast_for == Some(*view);
        let (part, settled) = match (resting, self.changed.is_empty()) {
            (false, _) => (Some(whole), true),
            (true, true) => (self.unsettled.then_some(whole), true),
            (true, false) => (rectangle(view, self.changed.inflated(MARGIN_MM), [width, height]), false),
        };
        self.cast_for = Some(*view);
        self.changed = Aabb::EMPTY;
        self.unsettled = !settled;
        let Some(part) = part else { return 0 };
        let colours = [Target { texture: hits, clear: None }];
        recorder.draw("skull", &DrawTarget { colours: &colours, depth: None }, |d| {
            d.scissor(part);
            d.draw(&self.pipeline, bindings, 3);
        });
        part[2] * part[3]
    }
}

/// The smallest rectangle of pixels that shows a box; none if it is out of sight.
fn rectangle(view: &View, of: Aabb, [width, height]: [u32; 2]) -> Option<[u32; 4]> {
    let mut low = glam::Vec2::INFINITY;
    let mut high = glam::Vec2::NEG_INFINITY;
    for n in 0..8 {
        let pick = |axis: usize| if n >> axis & 1 == 0 { of.min[axis] } else { of.max[axis] };
        let (at, depth) = view.project(Vec3::new(pick(0), pick(1), pick(2)));
        if depth < View::NEAR_MM {
            return Some([0, 0, width, height]);
        }
        (low, high) = (low.min(at), high.max(at));
    }
    let size = glam::Vec2::new(width as f32, height as f32);
    let left_top = (glam::Vec2::new(low.x, -high.y) * 0.5 + 0.5) * size;
    let right_bottom = (glam::Vec2::new(high.x, -low.y) * 0.5 + 0.5) * size;
    let from = left_top.floor().max(glam::Vec2::ZERO).as_uvec2();
    let to = right_bottom.ceil().clamp(glam::Vec2::ZERO, size).as_uvec2();
    (to.x > from.x && to.y > from.y).then(|| [from.x, from.y, to.x - from.x, to.y - from.y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;

    #[test]
    fn the_rectangle_holds_the_box_and_nothing_out_of_sight() {
        let view = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 100.0).view(2.0);
        let small = Aabb::of_sphere(Vec3::new(10.0, 0.0, 3.0), 2.0);
        let [x, y, w, h] = rectangle(&view, small, [200, 100]).unwrap();
        for n in 0..8 {
            let corner = Vec3::new(
                if n & 1 == 0 { 8.0 } else { 12.0 },
                if n & 2 == 0 { -2.0 } else { 2.0 },
                if n & 4 == 0 { 1.0 } else { 5.0 },
            );
            let (at, _) = view.project(corner);
            let pixel = glam::Vec2::new((at.x * 0.5 + 0.5) * 200.0, (0.5 - at.y * 0.5) * 100.0);
            assert!(
                pixel.x >= x as f32 && pixel.x <= (x + w) as f32 && pixel.y >= y as f32 && pixel.y <= (y + h) as f32
            );
        }
        assert!(w < 40 && h < 20);
        assert_eq!(rectangle(&view, Aabb::of_sphere(Vec3::new(900.0, 0.0, 0.0), 1.0), [200, 100]), None);
        assert_eq!(
            rectangle(&view, Aabb::of_sphere(Vec3::new(0.0, 100.0, 0.0), 1.0), [200, 100]),
            Some([0, 0, 200, 100])
        );
    }
}
