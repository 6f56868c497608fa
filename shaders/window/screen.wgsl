// Shows a finished picture in a part of the window.

@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var filtered: sampler;

struct Corner { @builtin(position) clip: vec4f, @location(0) at: vec2f }

@vertex fn vertex(@builtin(vertex_index) i: u32) -> Corner {
    let at = vec2f(vec2u(i << 1u, i) & vec2u(2u));
    return Corner(vec4f(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0), at);
}

@fragment fn fragment(v: Corner) -> @location(0) vec4f { return textureSampleLevel(picture, filtered, v.at, 0.0); }
