//! Tests kernels, textures, pipelines and timing against the processor.

use trepan_gpu::{adapter_for_tests as device, *};

const SAXPY: &str = "
struct Scale { a: f32, count: u32 }
@group(0) @binding(0) var<uniform> scale: Scale;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;
@compute @workgroup_size(64) fn saxpy(@builtin(global_invocation_id) id: vec3u) {
    if id.x < scale.count { y[id.x] += scale.a * x[id.x]; }
}";

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Scale {
    a: f32,
    count: u32,
}

#[test]
fn saxpy_twice_equals_the_processor() {
    let Some(gpu) = device() else { return };
    let count = 1000u32;
    let x: Vec<f32> = (0..count).map(|i| i as f32 * 0.25).collect();
    let y: Vec<f32> = (0..count).map(|i| 7.0 - i as f32).collect();
    let slots = [Slot::Uniform, Slot::Storage, Slot::StorageMut];
    let kernel = Kernel::new(&gpu, "saxpy", SAXPY, "saxpy", &slots).unwrap();
    let scale = Buffer::from_slice(&gpu, "scale", &[Scale { a: 2.0, count }]).unwrap();
    let (xs, ys) = (Buffer::from_slice(&gpu, "x", &x).unwrap(), Buffer::from_slice(&gpu, "y", &y).unwrap());
    let bindings = kernel.bind(&gpu, &[(&scale).into(), (&xs).into(), (&ys).into()]).unwrap();
    let mut timer = Timer::new(&gpu, 1).unwrap();
    let mut recorder = gpu.record("test").timed(timer.as_mut());
    recorder.dispatch("first", &kernel, &bindings, [count.div_ceil(64), 1, 1]);
    recorder.dispatch("second", &kernel, &bindings, [count.div_ceil(64), 1, 1]);
    recorder.submit();
    let expected: Vec<f32> = x.iter().zip(&y).map(|(x, y)| y + 2.0 * x + 2.0 * x).collect();
    assert_eq!(ys.read(&gpu).unwrap(), expected);
    if let Some(timer) = timer {
        let times = timer.read(&gpu).unwrap();
        assert_eq!(times.iter().map(|t| t.name).collect::<Vec<_>>(), ["first"]);
        assert!(times[0].us.is_finite() && timer.untimed() == 1);
    }
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_part_of_a_buffer_of_small_values_is_overwritten() {
    let Some(gpu) = device() else { return };
    let buffer = Buffer::from_slice(&gpu, "bytes", &[1u8, 2, 3, 4, 5, 6, 7]).unwrap();
    buffer.write(&gpu, 4, &[9, 8, 7, 6, 5]);
    assert_eq!(buffer.read(&gpu).unwrap(), [1, 2, 3, 4, 9, 8, 7]);
    let none = Buffer::<u32>::from_slice(&gpu, "none", &[]).unwrap();
    assert!(none.is_empty() && none.read(&gpu).unwrap().is_empty());
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_box_of_an_odd_sized_volume_comes_back() {
    let Some(gpu) = device() else { return };
    let size = [5, 3, 2];
    let spec = TextureSpec {
        label: "volume",
        size,
        volume: true,
        format: Format::R16Float,
        drawn_to: false,
        stored_to: false,
    };
    let texture = Texture::new(&gpu, &spec).unwrap();
    texture.write(&gpu, [0; 3], size, &(0..30u16).collect::<Vec<_>>());
    texture.write(&gpu, [4, 1, 1], [1, 2, 1], &[100u16, 101]);
    let mut expected: Vec<u16> = (0..30).collect();
    (expected[15 + 5 + 4], expected[15 + 10 + 4]) = (100, 101);
    assert_eq!(texture.read::<u16>(&gpu).unwrap(), expected);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn a_kernel_stores_to_a_texture() {
    let Some(gpu) = device() else { return };
    let wgsl = "@group(0) @binding(0) var to: texture_storage_2d<rgba8unorm, write>;
        @compute @workgroup_size(2) fn main(@builtin(global_invocation_id) id: vec3u) {
            textureStore(to, id.xy, vec4f(vec2f(id.xy), 0.0, 1.0));
        }";
    let (size, format) = ([2, 2, 1], Format::Rgba8Unorm);
    let spec = TextureSpec { label: "stored", size, volume: false, format, drawn_to: false, stored_to: true };
    let texture = Texture::new(&gpu, &spec).unwrap();
    let kernel = Kernel::new(&gpu, "store", wgsl, "main", &[Slot::Store2(format)]).unwrap();
    let mut recorder = gpu.record("test");
    recorder.dispatch("store", &kernel, &kernel.bind(&gpu, &[(&texture).into()]).unwrap(), [1, 2, 1]);
    recorder.submit();
    let stored = [[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 0, 255]];
    assert_eq!(texture.read::<[u8; 4]>(&gpu).unwrap(), stored);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn the_nearer_of_two_triangles_is_seen_inside_the_scissor() {
    let Some(gpu) = device() else { return };
    let wgsl = "
        @group(0) @binding(0) var<storage, read> depths: array<f32>;
        struct Flat { @builtin(position) position: vec4f, @location(0) @interpolate(flat) colour: f32 }
        @vertex fn vertex(@builtin(vertex_index) i: u32) -> Flat {
            let corner = vec2f(f32(i % 3u & 1u), f32(i % 3u >> 1u)) * 4.0 - 1.0;
            return Flat(vec4f(corner, depths[i / 3u], 1.0), f32(i / 3u));
        }
        @fragment fn fragment(v: Flat) -> @location(0) vec4f { return vec4f(v.colour, 1.0, 0.0, 1.0); }";
    let targets = [Format::Rgba8Unorm];
    let spec = PipelineSpec {
        label: "flat",
        wgsl,
        slots: &[Slot::Storage],
        targets: &targets,
        depth: DepthTest::Nearest,
        blend: false,
        topology: Topology::Triangles,
    };
    let pipeline = Pipeline::new(&gpu, &spec).unwrap();
    let depths = Buffer::from_slice(&gpu, "depths", &[0.5f32, 0.25]).unwrap();
    let bindings = pipeline.bind(&gpu, &[(&depths).into()]).unwrap();
    let image = |format| TextureSpec {
        label: "image",
        size: [3, 2, 1],
        volume: false,
        format,
        drawn_to: true,
        stored_to: false,
    };
    let colour = Texture::new(&gpu, &image(Format::Rgba8Unorm)).unwrap();
    let depth = Texture::new(&gpu, &image(Format::Depth32Float)).unwrap();
    let mut recorder = gpu.record("test");
    let colours = [Target { texture: &colour, clear: Some([0.0; 4]) }];
    let target = DrawTarget { colours: &colours, depth: Some(Depth { texture: &depth, clear: Some(1.0) }) };
    recorder.draw("flat", &target, |d| {
        d.scissor([1, 0, 2, 1]);
        d.draw(&pipeline, &bindings, 6);
    });
    recorder.submit();
    let (black, near) = ([0u8; 4], [255u8, 255, 0, 255]);
    assert_eq!(colour.read::<[u8; 4]>(&gpu).unwrap(), [black, near, near, black, black, black]);
    assert_eq!(gpu.faults(), Faults::default());
}

#[test]
fn mistakes_come_back_as_errors() {
    let Some(gpu) = device() else { return };
    let broken = Kernel::new(&gpu, "broken", "fn main( {", "main", &[]).unwrap_err();
    assert!(matches!(&broken, GpuError::Shader { label, .. } if label == "broken"), "{broken}");
    let kernel = Kernel::new(&gpu, "saxpy", SAXPY, "saxpy", &[Slot::Uniform, Slot::Storage, Slot::StorageMut]).unwrap();
    assert!(matches!(kernel.bind(&gpu, &[]), Err(GpuError::Bind { .. })));
    let huge = Buffer::<u8>::zeroed(&gpu, "huge", usize::MAX / 4);
    assert!(matches!(huge, Err(GpuError::TooLarge { unit: "bytes", .. })));
    let spec = TextureSpec {
        label: "wide",
        size: [1 << 20, 1, 1],
        volume: false,
        format: Format::R8Unorm,
        drawn_to: false,
        stored_to: false,
    };
    assert!(matches!(Texture::new(&gpu, &spec), Err(GpuError::TooLarge { .. })));
    assert_eq!(gpu.faults(), Faults::default());
}
