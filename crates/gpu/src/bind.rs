//! Shader binding slots and the resources bound to them.

use crate::{Buffer, Format, Gpu, GpuError, Texture};

/// The resource type of one binding of group 0; its list index is the binding number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// `var<uniform>`.
    Uniform,
    /// `var<storage, read>`.
    Storage,
    /// `var<storage, read_write>`.
    StorageMut,
    /// `texture_2d<f32>`, filtered or loaded.
    Texture2,
    /// `texture_2d<u32>`: only loaded.
    Integer2,
    /// `texture_3d<f32>`, filtered or loaded.
    Texture3,
    /// `texture_3d<u32>`: only loaded.
    Integer3,
    /// `texture_storage_2d<_, write>` of a format: only stored, by kernels.
    Store2(Format),
    /// A linear `sampler`.
    Sampler,
}

/// A resource that can be bound.
#[derive(Clone, Copy, Debug)]
pub enum Resource<'a> {
    /// A whole buffer.
    Buffer(&'a wgpu::Buffer),
    /// A whole texture.
    Texture(&'a Texture),
    /// A linear sampler, clamped at the edges.
    Linear,
}

/// Resources bound to the slots of one kernel or pipeline, kept alive by it.
#[derive(Clone, Debug)]
pub struct Bindings {
    pub(crate) group: wgpu::BindGroup,
}

impl<'a, T: bytemuck::Pod> From<&'a Buffer<T>> for Resource<'a> {
    fn from(buffer: &'a Buffer<T>) -> Self {
        Self::Buffer(buffer.raw())
    }
}

impl<'a> From<&'a Texture> for Resource<'a> {
    fn from(texture: &'a Texture) -> Self {
        Self::Texture(texture)
    }
}

impl Slot {
    fn binding_type(self) -> wgpu::BindingType {
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let texture = |sample_type, view_dimension| wgpu::BindingType::Texture {
            sample_type,
            view_dimension,
            multisampled: false,
        };
        let float = wgpu::TextureSampleType::Float { filterable: true };
        match self {
            Self::Uniform => buffer(wgpu::BufferBindingType::Uniform),
            Self::Storage => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
            Self::StorageMut => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
            Self::Texture2 => texture(float, wgpu::TextureViewDimension::D2),
            Self::Texture3 => texture(float, wgpu::TextureViewDimension::D3),
            Self::Integer2 => texture(wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D2),
            Self::Integer3 => texture(wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D3),
            Self::Store2(format) => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: format.raw(),
                view_dimension: wgpu::TextureViewDimension::D2,
            },
            Self::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        }
    }
}

/// The layout of group 0 for a list of slots.
pub(crate) fn layout(gpu: &Gpu, label: &str, slots: &[Slot], stages: wgpu::ShaderStages) -> wgpu::BindGroupLayout {
    let entry = |(binding, slot): (usize, &Slot)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: stages,
        ty: slot.binding_type(),
        count: None,
    };
    let entries: Vec<_> = slots.iter().enumerate().map(entry).collect();
    gpu.device().create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// Binds resources in the order of the slots.
pub(crate) fn bind(
    gpu: &Gpu,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: &[Resource],
) -> Result<Bindings, GpuError> {
    let sampler = gpu.device().create_sampler(&wgpu::SamplerDescriptor {
        label: Some("linear"),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    // wgpu's validation checks that resources fit the slots, and names the binding that does not.
    let mut entries = Vec::with_capacity(resources.len());
    for (binding, resource) in resources.iter().enumerate() {
        let resource = match resource {
            Resource::Buffer(buffer) => buffer.as_entire_binding(),
            Resource::Texture(texture) => wgpu::BindingResource::TextureView(texture.view()),
            Resource::Linear => wgpu::BindingResource::Sampler(&sampler),
        };
        entries.push(wgpu::BindGroupEntry { binding: binding as u32, resource });
    }
    let make =
        || gpu.device().create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries });
    let group = gpu.checked(make, |reason| GpuError::Bind { label: label.into(), reason })?;
    Ok(Bindings { group })
}
