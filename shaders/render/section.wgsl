// The deformed brain cut by a slice: the rest position of each point of the cut, so that the MRI
// moves with the brain.

struct Corner { at: vec4f, rest: vec4f }   // in the slice's picture, -1 to 1; world mm

@group(0) @binding(1) var<storage, read> corners: array<Corner>;

struct Vertex { @builtin(position) clip: vec4f, @location(0) rest: vec3f }

@vertex fn vertex(@builtin(vertex_index) i: u32) -> Vertex {
    return Vertex(vec4f(corners[i].at.xy, 0.0, 1.0), corners[i].rest.xyz);
}

@fragment fn fragment(v: Vertex) -> @location(0) vec4u { return packed(vec4f(v.rest, 1.0)); }
