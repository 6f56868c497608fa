// Data shared by all passes of a picture: camera, bone grid, tool, light. Layout of the Rust type
// `Scene`.

// A tool where it is.
struct ToolShape {
    tip: vec4f,               // centre of its ball; w: its radius (negative: no tool)
    tail: vec4f,              // far end of the shaft; w: its radius
    across: vec4f,            // unit, across the shaft; w: how far its flutes have turned, rad
    look: vec4f,              // x: what it looks like; y: mm of the shaft that cut; z: farthest from the axis, mm; w: length, mm
}

struct Scene {
    clip_from_world: mat4x4f,
    mri_from_world: mat4x4f,  // texture coordinates of the MRI, 0 to 1
    eye: vec4f,               // world mm; w: 1 if there is an MRI
    right: vec4f,             // half the picture's width at distance 1; w: width in pixels
    up: vec4f,                // half its height at distance 1; w: height in pixels
    forward: vec4f,           // to the picture's middle at distance 1; w: 1 if bone is shown
    origin: vec4f,            // world centre of the padded voxel (0, 0, 0); w: voxel edge, mm
    dims: vec4f,              // padded voxels along x, y, z; w: isovalue, HU
    tools: array<ToolShape, 2>,    // in the first and in the second hand
    light: vec4f,             // unit, towards the light; w: 1 while drilling
    brain_cut: vec4f,         // unit normal and offset of the plane over which the brain is cut away; zeroes: none
    bone_cut: vec4f,          // the same for bone
    steps: vec4f,             // x: steps of the cut's lattice a voxel; y: voxels from one point of the smoothed CT to the next; z: share of a sample in the mean
    mri_window: vec4f,        // x: signal shown as black, 0 to 1; y: one over the range to white
    bone_paint: array<vec4f, 2>,    // lower corner of the colours over bone (w: 1 if there are any), one over the box's size
    brain_paint: array<vec4f, 2>,   // the same over the brain at rest
}

@group(0) @binding(0) var<uniform> scene: Scene;

const NOTHING: f32 = 1e30;

// Hits are passed between passes as the bits of floats in integer textures, which every driver can
// write.
fn packed(v: vec4f) -> vec4u { return bitcast<vec4u>(v); }

fn unpacked(v: vec4u) -> vec4f { return bitcast<vec4f>(v); }

// A triangle that covers the viewport.
fn cover(vertex: u32) -> vec4f {
    return vec4f(f32(vertex & 1u) * 4.0 - 1.0, f32(vertex >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// Unit direction of the ray through a pixel's position in the 3-D view.
fn ray_of(pixel: vec2f) -> vec3f {
    let x = 2.0 * pixel.x / scene.right.w - 1.0;
    let y = 1.0 - 2.0 * pixel.y / scene.up.w;
    return normalize(scene.forward.xyz + x * scene.right.xyz + y * scene.up.xyz);
}

// Signed height of a point over a plane, mm; 0 without a plane.
fn height(plane: vec4f, point: vec3f) -> f32 { return dot(plane.xyz, point) - plane.w; }

// Unit vectors in two numbers (octahedral encoding, Cigolle et al. 2014).
fn fold(n: vec3f) -> vec2f {
    let p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    let signs = select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return select(p, (1.0 - abs(p.yx)) * signs, n.z < 0.0);
}

fn unfold(p: vec2f) -> vec3f {
    let z = 1.0 - abs(p.x) - abs(p.y);
    let signs = select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return normalize(vec3f(select(p, (1.0 - abs(p.yx)) * signs, z < 0.0), z));
}

// Distance to the nearest tool as contact knows it, mm: a ball and a capsule each.
fn tool_distance(point: vec3f) -> f32 {
    return min(distance_to(point, scene.tools[0].tip, scene.tools[0].tail), distance_to(point, scene.tools[1].tip, scene.tools[1].tail));
}

fn distance_to(point: vec3f, tip: vec4f, tail: vec4f) -> f32 {
    if tip.w < 0.0 { return NOTHING; }
    let axis = tail.xyz - tip.xyz;
    let along = clamp(dot(point - tip.xyz, axis) / dot(axis, axis), 0.0, 1.0);
    let shaft = distance(point, tip.xyz + along * axis) - tail.w;
    return min(shaft, distance(point, tip.xyz) - tip.w);
}

// The MRI's mark and its grey value within the window.
fn windowed(signal: vec4f) -> vec4f {
    return vec4f(signal.xyz, clamp((signal.w - scene.mri_window.x) * scene.mri_window.y, 0.0, 1.0));
}

// Blends a mark of the MRI over a colour.
fn tinted(colour: vec3f, signal: vec4f) -> vec3f {
    let share = max(signal.x, max(signal.y, signal.z));
    return mix(colour, signal.xyz / max(share, 1e-3), 0.45 * share);
}
