//! A list of named passes, submitted together.

use crate::{Bindings, Gpu, Kernel, Pipeline, Texture, Timer};

/// Collects passes; [`submit`](Self::submit) sends them to the device. A pass's name labels it in
/// captures and timings.
#[derive(Debug)]
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    pub(crate) encoder: wgpu::CommandEncoder,
    timer: Option<&'a mut Timer>,
}

/// A colour target.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// The texture.
    pub texture: &'a Texture,
    /// Clear colour; `None` keeps the contents.
    pub clear: Option<[f64; 4]>,
}

/// The depth texture of a pass.
#[derive(Clone, Copy, Debug)]
pub struct Depth<'a> {
    /// The texture.
    pub texture: &'a Texture,
    /// Clear depth; `None` keeps the contents.
    pub clear: Option<f32>,
}

/// Targets of a pass.
#[derive(Clone, Copy, Debug, Default)]
pub struct DrawTarget<'a> {
    /// Colour targets, all of one size.
    pub colours: &'a [Target<'a>],
    /// Depth target, if any.
    pub depth: Option<Depth<'a>>,
}

/// The dispatches of one compute pass, run in order.
#[derive(Debug)]
pub struct Dispatches<'p> {
    pass: wgpu::ComputePass<'p>,
}

/// The draws of one pass, run in order.
#[derive(Debug)]
pub struct Draws<'p> {
    pass: wgpu::RenderPass<'p>,
}

impl Gpu {
    /// Starts a list of passes.
    pub fn record(&self, label: &str) -> Recorder<'_> {
        Recorder::new(self, label)
    }
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(gpu: &'a Gpu, label: &str) -> Self {
        let encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) });
        Self { gpu, encoder, timer: None }
    }

    /// Times the following passes.
    pub fn timed(mut self, timer: Option<&'a mut Timer>) -> Self {
        self.timer = timer;
        if let Some(timer) = &mut self.timer {
            timer.names.clear();
        }
        self
    }

    /// The device.
    pub fn gpu(&self) -> &'a Gpu {
        self.gpu
    }

    /// A compute pass of several dispatches; each sees the writes of those before it.
    pub fn compute(&mut self, name: &'static str, steps: impl FnOnce(&mut Dispatches)) {
        let queries = self.timer.as_mut().and_then(|t| t.next(name));
        let timestamp_writes =
            queries.zip(self.timer.as_ref()).map(|([begin, end], t)| wgpu::ComputePassTimestampWrites {
                query_set: &t.queries,
                beginning_of_pass_write_index: Some(begin),
                end_of_pass_write_index: Some(end),
            });
        let descriptor = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes };
        steps(&mut Dispatches { pass: self.encoder.begin_compute_pass(&descriptor) });
    }

    /// A compute pass of one dispatch.
    pub fn dispatch(&mut self, name: &'static str, kernel: &Kernel, bindings: &Bindings, groups: [u32; 3]) {
        self.compute(name, |d| d.dispatch(kernel, bindings, groups));
    }

    /// A render pass.
    pub fn draw(&mut self, name: &'static str, target: &DrawTarget, draws: impl FnOnce(&mut Draws)) {
        let queries = self.timer.as_mut().and_then(|t| t.next(name));
        let timestamp_writes =
            queries.zip(self.timer.as_ref()).map(|([begin, end], t)| wgpu::RenderPassTimestampWrites {
                query_set: &t.queries,
                beginning_of_pass_write_index: Some(begin),
                end_of_pass_write_index: Some(end),
            });
        let colours: Vec<_> = target.colours.iter().map(|t| Some(attachment(t))).collect();
        let depth = target.depth.map(|d| wgpu::RenderPassDepthStencilAttachment {
            view: d.texture.view(),
            depth_ops: Some(wgpu::Operations {
                load: d.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
                store: wgpu::StoreOp::Store,
            }),
            stencil_ops: None,
        });
        let descriptor = wgpu::RenderPassDescriptor {
            label: Some(name),
            color_attachments: &colours,
            depth_stencil_attachment: depth,
            timestamp_writes,
            ..Default::default()
        };
        draws(&mut Draws { pass: self.encoder.begin_render_pass(&descriptor) });
    }

    /// Submits the passes; does not wait.
    pub fn submit(mut self) {
        if let Some(timer) = &self.timer {
            timer.resolve(&mut self.encoder);
        }
        self.gpu.queue().submit([self.encoder.finish()]);
    }
}

impl Dispatches<'_> {
    /// Runs a kernel over the given workgroups.
    pub fn dispatch(&mut self, kernel: &Kernel, bindings: &Bindings, [x, y, z]: [u32; 3]) {
        self.pass.set_pipeline(&kernel.pipeline);
        self.pass.set_bind_group(0, &bindings.group, &[]);
        self.pass.dispatch_workgroups(x, y, z);
    }
}

impl Draws<'_> {
    /// Sets the viewport to the rectangle `[x, y, width, height]` in pixels.
    pub fn viewport(&mut self, [x, y, width, height]: [u32; 4]) {
        self.pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
        self.pass.set_scissor_rect(x, y, width, height);
    }

    /// Restricts drawing to the rectangle `[x, y, width, height]` in pixels.
    pub fn scissor(&mut self, [x, y, width, height]: [u32; 4]) {
        self.pass.set_scissor_rect(x, y, width, height);
    }

    /// Draws some vertices.
    pub fn draw(&mut self, pipeline: &Pipeline, bindings: &Bindings, vertices: u32) {
        self.pass.set_pipeline(&pipeline.raw);
        self.pass.set_bind_group(0, &bindings.group, &[]);
        self.pass.draw(0..vertices, 0..1);
    }
}

fn attachment<'t>(target: &Target<'t>) -> wgpu::RenderPassColorAttachment<'t> {
    let load = target.clear.map_or(wgpu::LoadOp::Load, |[r, g, b, a]| wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }));
    wgpu::RenderPassColorAttachment {
        view: target.texture.view(),
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
    }
}
