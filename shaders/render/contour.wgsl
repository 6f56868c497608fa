// Draws the outline of the deformed brain on a slice, as lines.

struct Ink { colour: vec4f }

@group(0) @binding(1) var<uniform> ink: Ink;
@group(0) @binding(2) var<storage, read> ends: array<vec2f>;   // in the slice's picture, -1 to 1

@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return vec4f(ends[i], 0.0, 1.0); }

@fragment fn fragment() -> @location(0) vec4f { return ink.colour; }
