// One orthogonal slice through the tool's tip: the present CT, MRI where there is no bone, tool and
// crosshair on top.

struct Slice {
    centre: vec4f,   // world mm at the middle of the picture; w: mm from there to its right edge
    right: vec4f,    // unit, to the right of the picture; w: mm to its upper edge
    up: vec4f,       // unit, upwards in the picture; w: width in pixels
    window: vec4f,   // lowest HU shown, its range; share of MRI; height in pixels
    corner: vec4f,   // upper left pixel of the slice in the whole picture; letters at the left and the right
    colour: vec4f,   // of frame and letters; w: letters at the top and the bottom
}

@group(0) @binding(1) var<uniform> slice: Slice;
@group(0) @binding(2) var density: texture_3d<f32>;
@group(0) @binding(3) var mri: texture_3d<f32>;
@group(0) @binding(4) var linear: sampler;
@group(0) @binding(5) var section: texture_2d<u32>;   // where the brain that is here now is at rest, world mm; w: 1 in the brain
@group(0) @binding(6) var<storage, read> drilled_table: array<u32>;
@group(0) @binding(7) var<storage, read> drilled_depths: array<i32>;

// Letters of 5 x 5 dots, top row first, leftmost dot in the highest bit: R L A P S I.
const LETTERS = array<u32, 6>(0x1e8fa51u, 0x108421fu, 0x0e8fe31u, 0x1e8fa10u, 0x0f8383eu, 0x0e2108eu);

@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return cover(i); }

fn ink(letter: f32, away: vec2f, pixel: vec2f, scale: f32) -> bool {
    let dot = vec2i(floor((pixel - away) / scale));
    if any(dot < vec2i(0)) || any(dot > vec2i(4)) { return false; }
    return ((LETTERS[u32(letter)] >> u32(24 - 5 * dot.y - dot.x)) & 1u) == 1u;
}

fn labelled(pixel: vec2f, size: vec2f) -> bool {
    let scale = max(1.0, floor(size.y / 110.0));
    let middle = 0.5 * size - 2.5 * scale;
    let far = size - 7.0 * scale;
    let sides = ink(slice.corner.z, vec2f(2.0 * scale, middle.y), pixel, scale) || ink(slice.corner.w, vec2f(far.x, middle.y), pixel, scale);
    let top = floor(slice.colour.w / 8.0);
    let ends = ink(top, vec2f(middle.x, 2.0 * scale), pixel, scale)
        || ink(slice.colour.w - 8.0 * top, vec2f(middle.x, far.y), pixel, scale);
    return sides || ends;
}

fn tissue(world: vec3f, rest: vec3f) -> vec3f {
    let g = (world - scene.origin.xyz) / scene.origin.w;
    let at = (g + 0.5) / scene.dims.xyz;
    let inside = all(at >= vec3f(0.0)) && all(at <= vec3f(1.0));
    let hu = select(-1000.0, shown_hu(textureSampleLevel(density, linear, at, 0.0).x, g), inside);
    let grey = clamp((hu - slice.window.x) / slice.window.y, 0.0, 1.0);
    let place = (scene.mri_from_world * vec4f(rest, 1.0)).xyz;
    let known = all(place >= vec3f(0.0)) && all(place <= vec3f(1.0));
    let signal = windowed(textureSampleLevel(mri, linear, place, 0.0));
    let share = slice.window.z * scene.eye.w * (1.0 - smoothstep(scene.dims.w - 150.0, scene.dims.w, hu));
    if !known { return vec3f(grey); }
    return mix(vec3f(grey), tinted(vec3f(signal.w), signal), share);
}

@fragment fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let pixel = position.xy - slice.corner.xy;
    let size = vec2f(slice.up.w, slice.window.w);
    let offset = (2.0 * pixel / size - 1.0) * vec2f(slice.centre.w, -slice.right.w);
    let world = slice.centre.xyz + offset.x * slice.right.xyz + offset.y * slice.up.xyz;
    let moved = unpacked(textureLoad(section, vec2i(vec2f(pixel.x, position.y)), 0));
    var colour = tissue(world, select(world, moved.xyz, moved.w > 0.5));
    let mm = 2.0 * slice.centre.w / size.x;
    if scene.tools[0].tip.w > 0.0 {
        let away = vec2f(dot(world - scene.tools[0].tip.xyz, slice.right.xyz), dot(world - scene.tools[0].tip.xyz, slice.up.xyz));
        let beyond = length(away) > scene.tools[0].tip.w + 4.0 * mm;
        if beyond && min(abs(away.x), abs(away.y)) < 0.5 * mm { colour = mix(colour, vec3f(0.25, 0.85, 1.0), 0.65); }
        let gap = tool_distance(world);
        if gap < 0.0 { colour = mix(colour, vec3f(1.0, 0.80, 0.20), 0.35); }
        if abs(gap) < 0.8 * mm { colour = vec3f(1.0, 0.80, 0.20); }
    }
    if labelled(pixel, size) { colour = vec3f(0.95, 0.95, 0.80); }
    let border = min(min(pixel.x, pixel.y), min(size.x - pixel.x, size.y - pixel.y));
    if border < 1.0 { colour = slice.colour.xyz; }
    return vec4f(colour, 1.0);
}
