// Rays through the padded grid of densities: leap over bricks without bone, walk the cells of the others, solve the cubic in a cell exactly.

@group(0) @binding(1) var density: texture_3d<f32>;   // HU, padded by one voxel of air on all sides
@group(0) @binding(2) var linear: sampler;
@group(0) @binding(3) var leap: texture_3d<u32>;      // per brick of cells: 0 where bone may be, else bricks to the nearest such
@group(0) @binding(4) var crowd: texture_3d<f32>;     // share of bone in blocks of 4³ voxels

const BRICK: f32 = 4.0;   // cells along an edge: `LEAP` in Rust
const NUDGE: f32 = 1e-3;

// Continuous padded grid coordinates of a world point: voxel centres are at whole numbers.
fn grid_of(point: vec3f) -> vec3f { return (point - scene.origin.xyz) / scene.origin.w; }

// HU at continuous padded grid coordinates.
fn hu(g: vec3f) -> f32 { return textureSampleLevel(density, linear, (g + 0.5) / scene.dims.xyz, 0.0).x; }

// Smallest part s of the way through a cell at which the density reaches the isovalue, or 2. `v` is the density less the isovalue
// at s = 0, 1/3, 2/3, 1: a trilinear cell is a cubic along a ray (Marmitt et al. 2004: split at the extrema, then refine).
fn first_root(v: vec4f) -> f32 {
    if v.x >= 0.0 { return 0.0; }
    let c1 = 0.5 * (-11.0 * v.x + 18.0 * v.y - 9.0 * v.z + 2.0 * v.w);
    let c2 = 4.5 * (2.0 * v.x - 5.0 * v.y + 4.0 * v.z - v.w);
    let c3 = 4.5 * (-v.x + 3.0 * v.y - 3.0 * v.z + v.w);
    let roots = sqrt(max(c2 * c2 - 3.0 * c1 * c3, 0.0));
    let q = -(c2 + select(-roots, roots, c2 >= 0.0));
    let e1 = select(2.0, q / (3.0 * c3), abs(c3) > 1e-20);
    let e2 = select(2.0, c1 / q, abs(q) > 1e-20);
    var start = 0.0;
    for (var part = 0; part < 3; part++) {
        var to = 1.0;
        if e1 > start && e1 < to { to = e1; }
        if e2 > start && e2 < to { to = e2; }
        if v.x + to * (c1 + to * (c2 + to * c3)) >= 0.0 {
            var low = start;
            var high = to;
            for (var i = 0; i < 12; i++) {
                let s = 0.5 * (low + high);
                if v.x + s * (c1 + s * (c2 + s * c3)) < 0.0 { low = s; } else { high = s; }
            }
            return high;
        }
        start = to;
        if start >= 1.0 { break; }
    }
    return 2.0;
}

// Trilinear interpolation of eight corners, x fastest.
fn blend(low: vec4f, high: vec4f, u: vec3f) -> f32 {
    let plane = mix(low, high, u.z);
    let line = mix(plane.xy, plane.zw, u.y);
    return mix(line.x, line.y, u.x);
}

// Share of the way through cell `c` between local points `a` and `b` where bone begins, or 2.
fn enter(c: vec3i, a: vec3f, b: vec3f) -> f32 {
    let e = vec2i(0, 1);
    let low = vec4f(textureLoad(density, c, 0).x, textureLoad(density, c + e.yxx, 0).x,
                    textureLoad(density, c + e.xyx, 0).x, textureLoad(density, c + e.yyx, 0).x) - scene.dims.w;
    let high = vec4f(textureLoad(density, c + e.xxy, 0).x, textureLoad(density, c + e.yxy, 0).x,
                     textureLoad(density, c + e.xyy, 0).x, textureLoad(density, c + e.yyy, 0).x) - scene.dims.w;
    let most = max(low, high);
    if max(max(most.x, most.y), max(most.z, most.w)) < 0.0 { return 2.0; }
    let third = (b - a) / 3.0;
    return first_root(vec4f(blend(low, high, a), blend(low, high, a + third), blend(low, high, b - third), blend(low, high, b)));
}

// Distance along the ray o + t·d (padded grid coordinates, t in mm) at which bone begins, or NOTHING.
fn meet(o: vec3f, d: vec3f, furthest: f32) -> f32 {
    let safe = select(d, vec3f(1e-12), abs(d) < vec3f(1e-12));
    let inverse = 1.0 / safe;
    let near = min(-o * inverse, (scene.dims.xyz - 1.0 - o) * inverse);
    let far = max(-o * inverse, (scene.dims.xyz - 1.0 - o) * inverse);
    var t = max(max(max(near.x, near.y), near.z), 0.0);
    let end = min(min(min(far.x, far.y), far.z), furthest);
    let nudge = NUDGE * scene.origin.w;
    let last = vec3i(scene.dims.xyz) - 2;
    let step = select(vec3i(-1), vec3i(1), safe > vec3f(0.0));
    let ahead = select(vec3f(0.0), vec3f(1.0), safe > vec3f(0.0));
    for (var bricks = 0; bricks < 4096 && t < end; bricks++) {
        let g = o + safe * (t + nudge);
        let brick = clamp(vec3i(floor(g / BRICK)), vec3i(0), vec3i(textureDimensions(leap)) - 1);
        let free = i32(textureLoad(leap, brick, 0).x);
        // The way out of the box of bricks that are known to be free, or of this brick.
        let reach = max(free - 1, 0);
        let wall = BRICK * (vec3f(brick) + select(vec3f(-f32(reach)), vec3f(f32(reach + 1)), safe > vec3f(0.0)));
        let exits = (wall - o) * inverse;
        let out = max(min(min(exits.x, exits.y), exits.z), t + nudge);
        if free == 0 {
            var cell = clamp(vec3i(floor(g)), vec3i(0), last);
            var crossing = (vec3f(cell) + ahead - o) * inverse;
            for (var cells = 0; cells < 32 && t < out; cells++) {
                let next = max(min(min(crossing.x, crossing.y), crossing.z), t);
                let s = enter(cell, o + safe * t - vec3f(cell), o + safe * next - vec3f(cell));
                if s <= 1.0 { return t + s * (next - t); }
                t = next;
                let forward = select(vec3i(0), step, crossing <= vec3f(next));
                cell = cell + forward;
                crossing = (vec3f(cell) + ahead - o) * inverse;
                if any(cell < vec3i(0)) || any(cell > last) { return NOTHING; }
            }
        }
        t = max(t, out);
    }
    return NOTHING;
}

// Ambient light that reaches a surface point: little where bone crowds in front of it.
fn openness(g: vec3f, normal: vec3f) -> f32 {
    var dark = 0.0;
    for (var i = 0; i < 4; i++) {
        let reach = 2.5 * exp2(f32(i)) / scene.origin.w;
        let at = (g + normal * reach + 0.5) / (4.0 * vec3f(textureDimensions(crowd)));
        dark += textureSampleLevel(crowd, linear, at, 0.0).x;
    }
    return exp(-1.1 * dark);
}

// Whether bone stands between a surface point and the light.
fn shadowed(g: vec3f, normal: vec3f) -> bool {
    return meet(g + 0.8 * normal, scene.light.xyz / scene.origin.w, NOTHING) < NOTHING;
}
