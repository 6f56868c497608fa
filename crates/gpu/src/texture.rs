//! Textures of two and three dimensions.

use crate::{Gpu, GpuError};

/// Texel format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One byte, read as 0 to 1.
    R8Unorm,
    /// One byte, an integer.
    R8Uint,
    /// Colour, one byte each, read as 0 to 1.
    Rgba8Unorm,
    /// Half precision, filterable everywhere.
    R16Float,
    /// Colour in half precision: filterable, and passes can blend into it.
    Rgba16Float,
    /// Four integers, or the bits of four single-precision numbers; load only. Every driver can
    /// render to it.
    Rgba32Uint,
    /// Depth buffer.
    Depth32Float,
}

/// Parameters of a texture.
#[derive(Clone, Copy, Debug)]
pub struct TextureSpec<'a> {
    /// Name in messages.
    pub label: &'a str,
    /// Texels along x, y, z; z is 1 for two dimensions.
    pub size: [u32; 3],
    /// Whether it is 3-D (even with a single layer).
    pub volume: bool,
    /// The texel format.
    pub format: Format,
    /// Whether passes render to it.
    pub drawn_to: bool,
    /// Whether kernels store to it.
    pub stored_to: bool,
}

/// A texture with its one view.
#[derive(Clone, Debug)]
pub struct Texture {
    raw: wgpu::Texture,
    view: wgpu::TextureView,
    size: [u32; 3],
    format: Format,
}

impl Format {
    /// The corresponding wgpu format.
    pub fn raw(self) -> wgpu::TextureFormat {
        match self {
            Self::R8Unorm => wgpu::TextureFormat::R8Unorm,
            Self::R8Uint => wgpu::TextureFormat::R8Uint,
            Self::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
            Self::R16Float => wgpu::TextureFormat::R16Float,
            Self::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
            Self::Rgba32Uint => wgpu::TextureFormat::Rgba32Uint,
            Self::Depth32Float => wgpu::TextureFormat::Depth32Float,
        }
    }

    /// Bytes of a texel.
    pub fn bytes(self) -> u32 {
        match self {
            Self::R8Unorm | Self::R8Uint => 1,
            Self::R16Float => 2,
            Self::Rgba8Unorm | Self::Depth32Float => 4,
            Self::Rgba16Float => 8,
            Self::Rgba32Uint => 16,
        }
    }
}

impl Texture {
    /// Creates a texture of zeroes.
    pub fn new(gpu: &Gpu, spec: &TextureSpec) -> Result<Self, GpuError> {
        let limits = gpu.limits();
        let limit = if spec.volume { limits.max_texture_dimension_3d } else { limits.max_texture_dimension_2d };
        let longest = spec.size.into_iter().max().unwrap_or(1);
        gpu.within(spec.label, longest.into(), limit.into(), "texels along an edge")?;
        let size = spec.size.map(|n| n.max(1));
        let mut usage =
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC;
        usage.set(wgpu::TextureUsages::RENDER_ATTACHMENT, spec.drawn_to);
        usage.set(wgpu::TextureUsages::STORAGE_BINDING, spec.stored_to);
        let raw = gpu.device().create_texture(&wgpu::TextureDescriptor {
            label: Some(spec.label),
            size: extent(size),
            mip_level_count: 1,
            sample_count: 1,
            dimension: if spec.volume { wgpu::TextureDimension::D3 } else { wgpu::TextureDimension::D2 },
            format: spec.format.raw(),
            usage,
            view_formats: &[],
        });
        let view = raw.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(Self { raw, view, size, format: spec.format })
    }

    /// Texels along x, y, z.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// The texel format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Overwrites the box of `size` texels at `origin`, before the next submission. The box must be
    /// inside and `texels` must fill it.
    pub fn write<T: bytemuck::Pod>(&self, gpu: &Gpu, origin: [u32; 3], size: [u32; 3], texels: &[T]) {
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size[0] * self.format.bytes()),
            rows_per_image: Some(size[1]),
        };
        gpu.queue().write_texture(self.place(origin), bytemuck::cast_slice(texels), layout, extent(size));
    }

    /// Waits for the device and copies all texels to the host, row by row.
    pub fn read<T: bytemuck::Pod>(&self, gpu: &Gpu) -> Result<Vec<T>, GpuError> {
        let [width, height, depth] = self.size;
        let row = width * self.format.bytes();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let bytes = u64::from(padded) * u64::from(height) * u64::from(depth);
        gpu.within("readback", bytes, gpu.limits().max_buffer_size, "bytes")?;
        let staging = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: bytes,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: Some(height) };
        let to = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
        encoder.copy_texture_to_buffer(self.place([0; 3]), to, extent(self.size));
        gpu.queue().submit([encoder.finish()]);
        gpu.read_back(&staging, bytes, |data| {
            let rows = data.chunks_exact(padded as usize).map(|r| &r[..row as usize]);
            bytemuck::pod_collect_to_vec(&rows.collect::<Vec<_>>().concat())
        })
    }

    /// The wgpu view.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    fn place(&self, [x, y, z]: [u32; 3]) -> wgpu::TexelCopyTextureInfo<'_> {
        let origin = wgpu::Origin3d { x, y, z };
        wgpu::TexelCopyTextureInfo { texture: &self.raw, mip_level: 0, origin, aspect: wgpu::TextureAspect::All }
    }
}

fn extent([width, height, depth_or_array_layers]: [u32; 3]) -> wgpu::Extent3d {
    wgpu::Extent3d { width, height, depth_or_array_layers }
}
