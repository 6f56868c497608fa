// Traces rays through the padded density grid: skips bricks without bone, visits the cells of the
// others, and solves the cubic in a cell exactly.

@group(0) @binding(1) var density: texture_3d<f32>;   // HU of the CT, padded by one voxel of air on all sides
@group(0) @binding(2) var linear: sampler;
@group(0) @binding(3) var leap: texture_3d<u32>;      // per brick of cells: 0 where bone may be, else bricks to the nearest such
@group(0) @binding(4) var crowd: texture_3d<f32>;     // share of bone in blocks of 4³ voxels
@group(0) @binding(5) var<storage, read> drilled_table: array<u32>;
@group(0) @binding(6) var<storage, read> drilled_depths: array<i32>;

const BRICK: f32 = 4.0;   // cells along an edge: `LEAP` in Rust
const NUDGE: f32 = 1e-3;
const MOST_STEPS: i32 = 8192;

// Continuous padded grid coordinates of a world point; voxel centres are at integers.
fn grid_of(point: vec3f) -> vec3f { return (point - scene.origin.xyz) / scene.origin.w; }

// HU of the CT at continuous padded grid coordinates.
fn hu(g: vec3f) -> f32 { return textureSampleLevel(density, linear, (g + 0.5) / scene.dims.xyz, 0.0).x; }

// Smallest fraction s ≥ `begin` of the path through a cell at which the density reaches the
// isovalue, or 2. `v` is the density less the isovalue at s = 0, 1/3, 2/3, 1: a trilinear cell is a
// cubic along a ray (Marmitt et al. 2004: split at the extrema, then refine).
fn first_root(v: vec4f, begin: f32) -> f32 {
    let c1 = 0.5 * (-11.0 * v.x + 18.0 * v.y - 9.0 * v.z + 2.0 * v.w);
    let c2 = 4.5 * (2.0 * v.x - 5.0 * v.y + 4.0 * v.z - v.w);
    let c3 = 4.5 * (-v.x + 3.0 * v.y - 3.0 * v.z + v.w);
    if v.x + begin * (c1 + begin * (c2 + begin * c3)) >= 0.0 { return begin; }
    let roots = sqrt(max(c2 * c2 - 3.0 * c1 * c3, 0.0));
    let q = -(c2 + select(-roots, roots, c2 >= 0.0));
    let e1 = select(2.0, q / (3.0 * c3), abs(c3) > 1e-20);
    let e2 = select(2.0, c1 / q, abs(q) > 1e-20);
    var start = begin;
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

// First fraction from which two such cubics are both at least 0, or 2.
fn first_of_both(a: vec4f, b: vec4f) -> f32 {
    var s = first_root(a, 0.0);
    for (var turn = 0; turn < 4 && s <= 1.0; turn++) {
        let next = first_root(select(a, b, turn % 2 == 0), s);
        if next == s { return s; }
        s = next;
    }
    return s;
}

// The corners of a cell of the CT, less the isovalue.
fn corners(c: vec3i) -> Corners {
    let e = vec2i(0, 1);
    let low = vec4f(textureLoad(density, c, 0).x, textureLoad(density, c + e.yxx, 0).x,
                    textureLoad(density, c + e.xyx, 0).x, textureLoad(density, c + e.yyx, 0).x);
    let high = vec4f(textureLoad(density, c + e.xxy, 0).x, textureLoad(density, c + e.yxy, 0).x,
                     textureLoad(density, c + e.xyy, 0).x, textureLoad(density, c + e.yyy, 0).x);
    return Corners(low - scene.dims.w, high - scene.dims.w);
}

// Whether a cell can hold bone.
fn promising(c: Corners) -> bool {
    let most = max(c.low, c.high);
    return max(max(most.x, most.y), max(most.z, most.w)) >= 0.0;
}

// Values at 0, 1/3, 2/3, 1 of the segment between two local points of a cell.
fn along_segment(c: Corners, a: vec3f, b: vec3f) -> vec4f {
    let third = (b - a) / 3.0;
    return vec4f(blend(c.low, c.high, a), blend(c.low, c.high, a + third), blend(c.low, c.high, b - third), blend(c.low, c.high, b));
}

// Fraction of the segment between two local points of a cell at which bone begins that was not cut,
// or 2. The CT reaches the isovalue at the fraction `begin`.
fn enter_drilled(c: Corners, cell: vec3i, a: vec3f, b: vec3f, begin: f32) -> f32 {
    let first = drilled_brick(cell);
    if first < 0 { return begin; }
    // The segment on the lattice of the brick.
    let steps = scene.steps.x;
    let low = steps * vec3f(cell % 4);
    let o = low + steps * a;
    let d = steps * (b - a);
    let safe = select(d, vec3f(1e-12), abs(d) < vec3f(1e-12));
    let ahead = select(vec3f(0.0), vec3f(1.0), safe > vec3f(0.0));
    var s = begin;
    for (var n = 0; n < 3 * i32(steps) + 3; n++) {
        let at = clamp(floor(o + safe * (s + 1e-4)), low, low + steps - 1.0);
        let exits = (at + ahead - o) / safe;
        let next = clamp(min(min(exits.x, exits.y), exits.z), s, 1.0);
        let depth = drilled_corners(first, vec3i(at));
        let left = Corners(-depth.low, -depth.high);
        let most = max(left.low, left.high);
        if max(max(most.x, most.y), max(most.z, most.w)) > 0.0 {
            // Where the CT was entered it may be a little under the isovalue, by rounding.
            let ct = along_segment(c, mix(a, b, s), mix(a, b, next)) + 0.01;
            let root = first_of_both(ct, along_segment(left, o + safe * s - at, o + safe * next - at));
            if root <= 1.0 { return s + root * (next - s); }
        }
        if next >= 1.0 { break; }
        s = next;
    }
    return 2.0;
}

// Height over the CT's surface at which shadow rays start, voxels: 0.8 mm or voxels, whichever is
// more. Over the steps that thick slices leave.
fn lift() -> f32 { return 0.8 * max(1.0, 1.0 / scene.origin.w); }

// Distance along the ray o + t·d (padded grid coordinates, t in mm) at which bone begins, or
// NOTHING. Three loops, each cheap, instead of branches: drivers that run pixels in lockstep skip
// loops, but pay for all branches.
fn meet(o: vec3f, d: vec3f, furthest: f32) -> f32 {
    let safe = select(d, vec3f(1e-12), abs(d) < vec3f(1e-12));
    let inverse = 1.0 / safe;
    let near = min(-o * inverse, (scene.dims.xyz - 1.0 - o) * inverse);
    let far = max(-o * inverse, (scene.dims.xyz - 1.0 - o) * inverse);
    var t = max(max(max(near.x, near.y), near.z), 0.0);
    var end = min(min(min(far.x, far.y), far.z), furthest);
    // Of the bone only the part under the cut is there.
    let over = height(scene.bone_cut, scene.origin.xyz + scene.origin.w * o);
    let rising = scene.origin.w * dot(scene.bone_cut.xyz, d);
    if rising < 0.0 { t = max(t, -over / rising); }
    if rising > 0.0 { end = min(end, -over / rising); }
    if rising == 0.0 && over > 0.0 { return NOTHING; }
    let nudge = NUDGE * scene.origin.w;
    let positive = safe > vec3f(0.0);
    let last = vec3i(scene.dims.xyz) - 2;
    let furthest_brick = vec3i(textureDimensions(leap)) - 1;
    let step = select(vec3i(-1), vec3i(1), positive);
    let ahead = select(vec3f(0.0), vec3f(1.0), positive);
    var steps = 0;
    while t < end && steps < MOST_STEPS {
        // Leap to the next brick that may hold bone.
        var leave = t;
        var free = 1;
        while free > 0 && t < end && steps < MOST_STEPS {
            t = leave;
            let brick = clamp(vec3i(floor((o + safe * (t + nudge)) / BRICK)), vec3i(0), furthest_brick);
            free = i32(textureLoad(leap, brick, 0).x);
            // The way out of the box of bricks that are known to be free, or of this brick.
            let reach = f32(max(free - 1, 0));
            let exits = (BRICK * (vec3f(brick) + select(vec3f(-reach), vec3f(reach + 1.0), positive)) - o) * inverse;
            leave = max(min(min(exits.x, exits.y), exits.z), t + nudge);
            steps++;
        }
        leave = min(leave, end);
        // Walk its cells to one with a corner in bone, and solve that; if the ray only passes by,
        // go on behind it.
        var cell = clamp(vec3i(floor(o + safe * (t + nudge))), vec3i(0), last);
        while t < leave && t < end && steps < MOST_STEPS {
            var found: Corners;
            var next = t;
            var onward = vec3i(0);
            var open = true;
            while open && t < leave && steps < MOST_STEPS {
                let crossing = (vec3f(cell) + ahead - o) * inverse;
                next = max(min(min(crossing.x, crossing.y), crossing.z), t);
                onward = select(vec3i(0), step, crossing <= vec3f(next));
                found = corners(cell);
                open = !promising(found);
                t = select(t, next, open);
                cell += select(vec3i(0), onward, open);
                leave = select(leave, t, any(cell < vec3i(0)) || any(cell > last));
                steps++;
            }
            if open { break; }
            let a = o + safe * t - vec3f(cell);
            let b = o + safe * next - vec3f(cell);
            var s = first_root(along_segment(found, a, b), 0.0);
            if s <= 1.0 { s = enter_drilled(found, cell, a, b, s); }
            if s <= 1.0 {
                let hit = t + s * (next - t);
                return select(NOTHING, hit, hit <= end);
            }
            t = next;
            cell += onward;
            leave = select(leave, t, any(cell < vec3i(0)) || any(cell > last));
        }
        t = max(t, leave);
    }
    return NOTHING;
}

// Ambient light that reaches a surface point: little where bone crowds in front of it.
fn openness(g: vec3f, normal: vec3f) -> f32 {
    var dark = 0.0;
    for (var i = 0; i < 4; i++) {
        let reach = 2.5 * exp2(f32(i)) / scene.origin.w;
        let there = g + normal * reach;
        let at = (there + 0.5) / (4.0 * vec3f(textureDimensions(crowd)));
        let cut_away = height(scene.bone_cut, scene.origin.xyz + scene.origin.w * there) > 0.0;
        dark += select(textureSampleLevel(crowd, linear, at, 0.0).x, 0.0, cut_away);
    }
    return exp(-1.1 * dark);
}

// Whether a point that a ray has met is where bone is cut.
fn on_cut(point: vec3f) -> bool { return any(scene.bone_cut.xyz != vec3f(0.0)) && abs(height(scene.bone_cut, point)) < 0.01; }

// Whether bone stands between a surface point and the light, seen from `lift` voxels over it.
fn shadowed(g: vec3f, normal: vec3f, lift: f32) -> bool {
    return meet(g + lift * normal, scene.light.xyz / scene.origin.w, NOTHING) < NOTHING;
}
