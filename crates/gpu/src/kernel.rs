//! Compute kernels.

use crate::{Bindings, Gpu, GpuError, Resource, Slot, bind};

/// A compute pipeline made from WGSL, with its slots in group 0.
#[derive(Clone, Debug)]
pub struct Kernel {
    label: &'static str,
    pub(crate) pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Kernel {
    /// Compiles `entry` of `wgsl`. The label names the kernel in messages, preferably the shader
    /// file's stem.
    pub fn new(gpu: &Gpu, label: &'static str, wgsl: &str, entry: &str, slots: &[Slot]) -> Result<Self, GpuError> {
        let make = || {
            let device = gpu.device();
            let source = wgpu::ShaderSource::Wgsl(wgsl.into());
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source });
            let layout = bind::layout(gpu, label, slots, wgpu::ShaderStages::COMPUTE);
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(label),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            });
            Self { label, pipeline, layout }
        };
        gpu.checked(make, |reason| GpuError::Shader { label: label.into(), reason })
    }

    /// Binds resources in the order of the slots.
    pub fn bind(&self, gpu: &Gpu, resources: &[Resource]) -> Result<Bindings, GpuError> {
        bind::bind(gpu, self.label, &self.layout, resources)
    }

    /// The name in messages.
    pub fn label(&self) -> &'static str {
        self.label
    }
}
