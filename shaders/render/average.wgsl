// Adds a sample of the 3-D view to the mean of those before, by its share as alpha.

@group(0) @binding(1) var seen: texture_2d<f32>;

@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return cover(i); }

@fragment fn fragment(@builtin(position) pixel: vec4f) -> @location(0) vec4f {
    return vec4f(textureLoad(seen, vec2i(pixel.xy), 0).xyz, scene.steps.z);
}
