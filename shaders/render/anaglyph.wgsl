// Both eyes' views in one picture: the left one's luminance in red, the right one's green and blue.

@group(0) @binding(1) var left: texture_2d<f32>;
@group(0) @binding(2) var right: texture_2d<f32>;
@group(0) @binding(3) var linear: sampler;

struct Corner { @builtin(position) clip: vec4f, @location(0) at: vec2f }

@vertex fn vertex(@builtin(vertex_index) i: u32) -> Corner {
    let clip = cover(i);
    return Corner(clip, vec2f(0.5 + 0.5 * clip.x, 0.5 - 0.5 * clip.y));
}

@fragment fn fragment(v: Corner) -> @location(0) vec4f {
    let grey = dot(textureSampleLevel(left, linear, v.at, 0.0).xyz, vec3f(0.299, 0.587, 0.114));
    return vec4f(grey, textureSampleLevel(right, linear, v.at, 0.0).yz, 1.0);
}
