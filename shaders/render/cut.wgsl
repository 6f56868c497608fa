// The cut surface of the brain: triangles in the plane, drawn together with those of its surface.
// Outputs as in `brain.wgsl`.

struct Corner { place: vec4f, rest: vec4f }   // now and at rest, world mm

@group(0) @binding(1) var<storage, read> corners: array<Corner>;

struct Vertex {
    @builtin(position) clip: vec4f,
    @location(0) place: vec3f,
    @location(1) rest: vec3f,
}

struct SurfacePoint {
    @location(0) hit: vec4u,
    @location(1) rest: vec4u,
}

@vertex fn vertex(@builtin(vertex_index) i: u32) -> Vertex {
    let corner = corners[i];
    return Vertex(scene.clip_from_world * vec4f(corner.place.xyz, 1.0), corner.place.xyz, corner.rest.xyz);
}

@fragment fn fragment(v: Vertex) -> SurfacePoint {
    var hit = packed(vec4f(fold(scene.brain_cut.xyz), 0.0, distance(v.place, scene.eye.xyz)));
    hit.z = pack4x8snorm(vec4f(0.0, 0.0, 0.0, 1.0));
    return SurfacePoint(hit, packed(vec4f(v.rest, 0.0)));
}
