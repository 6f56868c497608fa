// Enlarges a coarser 3-D view into the picture.

@group(0) @binding(1) var coarse: texture_2d<f32>;
@group(0) @binding(2) var linear: sampler;

struct Corner { @builtin(position) clip: vec4f, @location(0) at: vec2f }

@vertex fn vertex(@builtin(vertex_index) i: u32) -> Corner {
    let clip = cover(i);
    return Corner(clip, vec2f(0.5 + 0.5 * clip.x, 0.5 - 0.5 * clip.y));
}

@fragment fn fragment(v: Corner) -> @location(0) vec4f { return textureSampleLevel(coarse, linear, v.at, 0.0); }
