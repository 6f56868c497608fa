//! Render pipelines. Vertices are read from storage buffers by vertex index: there are no vertex
//! layouts.

use crate::{Bindings, Format, Gpu, GpuError, Resource, Slot, bind};

/// Primitive topology.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Topology {
    /// Three vertices a triangle.
    #[default]
    Triangles,
    /// Two vertices a line, one pixel wide.
    Lines,
}

/// Which fragments are kept; depth grows away from the eye.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthTest {
    /// All; the pass has no depth texture.
    #[default]
    Off,
    /// All, and the depth texture stays as it is.
    Ignored,
    /// The nearest so far.
    Nearest,
    /// The nearest so far of triangles that are counterclockwise to the eye.
    NearestFront,
    /// The nearest so far of the other triangles, of which only the depth is kept.
    BackDepth,
}

/// Parameters of a pipeline; entry points are `vertex` and `fragment`, bindings are in group 0.
#[derive(Clone, Copy, Debug)]
pub struct PipelineSpec<'a> {
    /// Name in messages, preferably the shader file's stem.
    pub label: &'static str,
    /// The shader's source.
    pub wgsl: &'a str,
    /// Its binding slots.
    pub slots: &'a [Slot],
    /// Formats of the textures that it renders to.
    pub targets: &'a [Format],
    /// Which fragments are kept.
    pub depth: DepthTest,
    /// Whether colours are alpha-blended over the target.
    pub blend: bool,
    /// Primitive topology.
    pub topology: Topology,
}

/// A render pipeline with its slots in group 0.
#[derive(Clone, Debug)]
pub struct Pipeline {
    label: &'static str,
    pub(crate) raw: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl Pipeline {
    /// Compiles the vertex and fragment entry points.
    pub fn new(gpu: &Gpu, spec: &PipelineSpec) -> Result<Self, GpuError> {
        gpu.checked(|| compile(gpu, spec), |reason| GpuError::Shader { label: spec.label.into(), reason })
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

fn compile(gpu: &Gpu, spec: &PipelineSpec) -> Pipeline {
    let device = gpu.device();
    let source = wgpu::ShaderSource::Wgsl(spec.wgsl.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(spec.label), source });
    let layout = bind::layout(gpu, spec.label, spec.slots, wgpu::ShaderStages::VERTEX_FRAGMENT);
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(spec.label),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let blend = spec.blend.then_some(wgpu::BlendState::ALPHA_BLENDING);
    let write_mask =
        if spec.depth == DepthTest::BackDepth { wgpu::ColorWrites::empty() } else { wgpu::ColorWrites::ALL };
    let target = |f: &Format| Some(wgpu::ColorTargetState { format: f.raw(), blend, write_mask });
    let targets: Vec<_> = spec.targets.iter().map(target).collect();
    let compare =
        if spec.depth == DepthTest::Ignored { wgpu::CompareFunction::Always } else { wgpu::CompareFunction::Less };
    let depth_stencil = (spec.depth != DepthTest::Off).then(|| wgpu::DepthStencilState {
        format: Format::Depth32Float.raw(),
        depth_write_enabled: Some(spec.depth != DepthTest::Ignored),
        depth_compare: Some(compare),
        stencil: Default::default(),
        bias: Default::default(),
    });
    let topology = match spec.topology {
        Topology::Triangles => wgpu::PrimitiveTopology::TriangleList,
        Topology::Lines => wgpu::PrimitiveTopology::LineList,
    };
    let cull_mode = match spec.depth {
        DepthTest::NearestFront => Some(wgpu::Face::Back),
        DepthTest::BackDepth => Some(wgpu::Face::Front),
        _ => None,
    };
    let raw = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(spec.label),
        layout: Some(&pipeline_layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState { topology, cull_mode, ..Default::default() },
        depth_stencil,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    });
    Pipeline { label: spec.label, raw, layout }
}
