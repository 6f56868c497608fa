//! The skull pass: keeps densities on the device, updates changed bricks, and casts only affected
//! rays.
//!
//! # Theory
//! Within a cell the density is trilinear, so that along a ray it is a cubic. Its first root is
//! found exactly (Marmitt et al. 2004), and no thin wall is missed. See `skull.wgsl`.
//!
//! # Practice
//! A compute pass: cards for data centres run fragment shaders on only a few of their processors.
//! Half-precision densities are exact for integer HU up to 2048, which covers every useful
//! isovalue. The hits of the last picture are kept. With a static camera only the part of the
//! picture that shows changed bricks is cast again, and all of it once drilling stops, since
//! ambient light reaches farther than a brick.

use crate::RenderError;
use crate::bricks::{Followed, Grid, SkipDistances, densities};
use crate::scene::Scene;
use crate::smooth::Smooth;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_gpu::{Bindings, Buffer, Format, Gpu, Kernel, Recorder, Resource, Slot, Texture, TextureSpec};

/// Bytes of densities uploaded at once while loading.
const LOAD_BYTES: usize = 16 << 20;

/// The slots of [`Skull::volumes`].
pub(crate) const VOLUMES: [Slot; 6] =
    [Slot::Texture3, Slot::Sampler, Slot::Integer3, Slot::Texture3, Slot::Storage, Slot::Storage];

/// The skull on the device.
#[derive(Debug)]
pub(crate) struct Skull {
    bone: Option<Arc<BoneVolume>>,
    pub grid: Grid,
    leaps: SkipDistances,
    seen: Vec<u32>,
    pub density: Texture,
    smooth: (Smooth, Texture),
    leap: Texture,
    crowd: Texture,
    /// Table and depths of what was cut.
    drilled: (Buffer<u32>, Buffer<[i16; 2]>),
    kernel: Kernel,
    leaping: bool,
}

impl Skull {
    pub fn new(gpu: &Gpu, bone: Option<Arc<BoneVolume>>) -> Result<Self, RenderError> {
        let grid = Grid::of(bone.as_deref());
        let seen = bone.as_ref().map_or_else(Vec::new, |bone| bone.seen());
        let leaps = SkipDistances::of(bone.as_deref(), &grid);
        let volume = |label, size: [usize; 3], format| {
            let size = size.map(|n| n as u32);
            Texture::new(gpu, &TextureSpec { label, size, volume: true, format, drawn_to: false, stored_to: false })
        };
        let density = volume("density", grid.dims, Format::R16Float)?;
        let smooth = Smooth::of(bone.as_deref(), &grid);
        let smooth_texture = volume("smooth", smooth.dims, Format::R16Float)?;
        let leap = volume("leap", leaps.bricks, Format::R8Uint)?;
        let crowd = volume("crowd", grid.blocks(), Format::R8Unorm)?;
        let table = Buffer::from_slice(gpu, "drilled table", &leaps.drilled.table)?;
        let depths = Buffer::from_slice(gpu, "drilled depths", bytemuck::cast_slice(&leaps.drilled.depths))?;
        let own = [Slot::Texture3, Slot::Uniform, Slot::Store2(Format::Rgba32Uint)];
        let slots = [&[Slot::Uniform], &VOLUMES[..], &own].concat();
        let kernel = Kernel::new(gpu, "skull", trepan_shaders::RENDER_SKULL, "main", &slots)?;
        let (drilled, smooth) = ((table, depths), (smooth, smooth_texture));
        let skull = Self { bone, grid, leaps, seen, density, smooth, leap, crowd, drilled, kernel, leaping: true };
        skull.load(gpu);
        Ok(skull)
    }

    /// Whether there is any bone to show.
    pub fn is_some(&self) -> bool {
        self.bone.is_some()
    }

    /// Enables or disables empty-space skipping over bricks without bone.
    pub fn set_leaping(&mut self, gpu: &Gpu, leaping: bool) {
        self.leaping = leaping;
        self.write_leaps(gpu);
    }

    /// Uploads everything, a few layers at a time.
    fn load(&self, gpu: &Gpu) {
        let [nx, ny, nz] = self.grid.dims;
        let layers = (LOAD_BYTES / (2 * nx * ny)).max(1);
        for first in (0..nz).step_by(layers) {
            self.upload(gpu, [0, 0, first], [nx, ny, layers.min(nz - first)]);
            // Submitting lets the device take these layers before the next ones are written.
            gpu.record("load").submit();
        }
        self.write_leaps(gpu);
        self.write_smooth(gpu, [[0; 3], self.smooth.0.dims]);
        let shares = self.grid.shares(self.bone.as_deref());
        self.crowd.write(gpu, [0; 3], self.crowd.size(), &shares);
    }

    fn write_leaps(&self, gpu: &Gpu) {
        let free = |at| if self.leaping { self.leaps.free(at) } else { 0 };
        let free: Vec<u8> = (0..self.leaps.cells.len()).map(free).collect();
        self.leap.write(gpu, [0; 3], self.leap.size(), &free);
    }

    fn write_smooth(&self, gpu: &Gpu, part: [[usize; 3]; 2]) {
        let values: Vec<_> =
            Smooth::part(part, &self.smooth.0).into_iter().map(|hu| half::f16::from_f32(hu.into())).collect();
        let [first, size] = part.map(|n| n.map(|v| v as u32));
        self.smooth.1.write(gpu, first, size, &values);
    }

    fn upload(&self, gpu: &Gpu, first: [usize; 3], size: [usize; 3]) {
        let values = densities(self.bone.as_deref(), first, size, |hu| half::f16::from_f32(hu.into()));
        self.density.write(gpu, first.map(|v| v as u32), size.map(|v| v as u32), &values);
    }

    /// Whether there are changes to follow.
    pub fn is_stale(&mut self) -> bool {
        self.bone.as_ref().is_some_and(|bone| bone.changed(&mut self.seen, 0, |_| ()) > 0)
    }

    /// Uploads up to `limit` changed bricks; also returns whether passes must be bound again.
    pub fn follow(&mut self, gpu: &Gpu, limit: usize) -> Result<(Followed, bool), RenderError> {
        let Some(bone) = self.bone.clone() else { return Ok(Default::default()) };
        let mut changed = Vec::new();
        let left = bone.changed(&mut self.seen, limit, |brick| changed.push(brick));
        for &brick in &changed {
            self.refresh(gpu, &bone, brick);
        }
        let smoothed = self.smooth.0.follow(&bone, &changed);
        smoothed.into_iter().for_each(|part| self.write_smooth(gpu, part));
        let touched = self.leaps.follow(&bone, &changed);
        for cells in touched.freed.into_iter().filter(|_| self.leaping) {
            let free = self.leaps.free(self.leaps.index(cells));
            self.leap.write(gpu, cells.map(|v| v as u32), [1; 3], &[free]);
        }
        if self.leaps.settle() {
            self.write_leaps(gpu);
        }
        let grown = self.write_drilled(gpu, &touched.drilled)?;
        Ok((Followed::of(&self.grid, &changed, left), grown))
    }

    /// Uploads what was cut in bricks of cells, each with its place; returns whether the buffer was
    /// too small and is a new one.
    fn write_drilled(&mut self, gpu: &Gpu, bricks: &[(usize, usize)]) -> Result<bool, RenderError> {
        let (table, room) = &mut self.drilled;
        let (depths, words) = (&self.leaps.drilled.depths, self.leaps.drilled.stride() / 2);
        let depths: &[[i16; 2]] = bytemuck::cast_slice(depths);
        let grown = depths.len() > room.len();
        if grown {
            *room = Buffer::zeroed(gpu, "drilled depths", 2 * depths.len())?;
            room.write(gpu, 0, depths);
        }
        for &(brick, place) in bricks {
            table.write(gpu, brick, &[place as u32 + 1]);
            if !grown {
                room.write(gpu, place * words, &depths[place * words..][..words]);
            }
        }
        Ok(grown)
    }

    /// Uploads one brick of voxels and the blocks that it touches.
    fn refresh(&self, gpu: &Gpu, bone: &BoneVolume, brick: [usize; 3]) {
        let (first, size) = self.grid.voxels_of(brick);
        self.upload(gpu, first, size);
        for block in self.grid.blocks_of(brick) {
            self.crowd.write(gpu, block.map(|v| v as u32), [1; 3], &[self.grid.share(bone, block)]);
        }
    }

    /// The resources that `bricks.wgsl` binds, after the uniform.
    pub fn volumes(&self) -> [Resource<'_>; 6] {
        let [table, depths] = self.drilled();
        [(&self.density).into(), Resource::Linear, (&self.leap).into(), (&self.crowd).into(), table, depths]
    }

    /// What was cut, as `drilled.wgsl` reads it.
    pub fn drilled(&self) -> [Resource<'_>; 2] {
        [(&self.drilled.0).into(), (&self.drilled.1).into()]
    }

    /// Binds the pass to the frame's uniform, the rectangle of pixels to cast, and their hits.
    pub fn bind(
        &self,
        gpu: &Gpu,
        scene: &Buffer<Scene>,
        part: &Buffer<[u32; 4]>,
        hits: &Texture,
    ) -> Result<Bindings, RenderError> {
        let own = [(&self.smooth.1).into(), part.into(), hits.into()];
        Ok(self.kernel.bind(gpu, &[&[scene.into()], &self.volumes()[..], &own].concat())?)
    }

    /// Casts the bound part, of `size` pixels, again.
    pub fn cast(&self, recorder: &mut Recorder, bindings: &Bindings, size: [u32; 2]) {
        recorder.dispatch("skull", &self.kernel, bindings, tiles(size));
    }
}

/// Workgroups of 8x8 threads, one a pixel, that cover so many pixels.
pub(crate) fn tiles([width, height]: [u32; 2]) -> [u32; 3] {
    [width.div_ceil(8), height.div_ceil(8), 1]
}
