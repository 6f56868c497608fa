// The deformed brain's surface as triangles with smooth normals. Output 0: octahedral normal (xy),
// four bytes (z): ways to vessels, and half the light of the surroundings, or 1 on a cut; distance
// along the ray in mm (w). Output 1: the rest position, for sampling the
// MRI, and the stain (w): blood in mm, towards -1 a burn, -2 dura.

@group(0) @binding(1) var<storage, read> places: array<vec4f>;    // now, world mm, and the stain
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;   // now, unit
@group(0) @binding(3) var<storage, read> rest: array<vec4f>;      // at rest, world mm
@group(0) @binding(4) var<storage, read> looks: array<vec4f>;     // ways to vessels, light of the surroundings
@group(0) @binding(5) var<storage, read> corners: array<u32>;     // three vertices a triangle

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) place: vec3f,
    @location(1) normal: vec3f,
    @location(2) rest: vec3f,
    @location(3) stain: f32,
    @location(4) look: vec4f,
}

struct SurfacePoint {
    @location(0) hit: vec4u,
    @location(1) rest: vec4u,
}

@vertex fn vertex(@builtin(vertex_index) i: u32) -> Corner {
    let v = corners[i];
    let place = places[v].xyz;
    return Corner(scene.clip_from_world * vec4f(place, 1.0), place, normals[v].xyz, rest[v].xyz, places[v].w, looks[v]);
}

@fragment fn fragment(v: Corner) -> SurfacePoint {
    if height(scene.brain_cut, v.place) > 0.0 { discard; }
    var hit = packed(vec4f(fold(normalize(v.normal)), 0.0, distance(v.place, scene.eye.xyz)));
    hit.z = pack4x8snorm(vec4f(v.look.xyz, 0.5 * v.look.w));
    return SurfacePoint(hit, packed(vec4f(v.rest, v.stain)));
}
