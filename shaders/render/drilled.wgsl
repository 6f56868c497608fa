// What tools have cut from the bone: depths on a lattice in the bricks of cells near cuts, twice as
// fine as the cut's nodes. Whoever includes this declares `drilled_table`, for each brick of cells
// its place and 1, or 0, and `drilled_depths`, two depths a word, 4096 a node; over 0 was cut.

const FAR: f32 = -4.0;              // depth far from all cuts, nodes
const CUT_RAMP_HU: f32 = 1000.0;    // how a cut lowers the density that is shown, HU a node

// Eight corners of a cell, x fastest.
struct Corners { low: vec4f, high: vec4f }

// Trilinear interpolation of eight corners.
fn blend(low: vec4f, high: vec4f, u: vec3f) -> f32 {
    let plane = mix(low, high, u.z);
    let line = mix(plane.xy, plane.zw, u.y);
    return mix(line.x, line.y, u.x);
}

// First word of the brick of a cell; negative if nothing near it was cut.
fn drilled_brick(cell: vec3i) -> i32 {
    let bricks = (vec3i(scene.dims.xyz) + 2) / 4;
    let brick = cell / 4;
    let place = i32(drilled_table[brick.x + bricks.x * (brick.y + bricks.y * brick.z)]);
    let edge = 4 * i32(scene.steps.x) + 1;
    return (place - 1) * ((edge * edge * edge + 1) / 2);
}

fn drilled_value(first: i32, at: i32) -> f32 {
    return f32(extractBits(drilled_depths[first + at / 2], u32(at & 1) * 16u, 16u)) / 4096.0;
}

// Depths at the corners of the lattice's cell at `at` in the brick, nodes.
fn drilled_corners(first: i32, at: vec3i) -> Corners {
    let y = 4 * i32(scene.steps.x) + 1;
    let z = y * y;
    let n = at.x + y * at.y + z * at.z;
    let low = vec4f(drilled_value(first, n), drilled_value(first, n + 1),
                    drilled_value(first, n + y), drilled_value(first, n + y + 1));
    let high = vec4f(drilled_value(first, n + z), drilled_value(first, n + z + 1),
                     drilled_value(first, n + z + y), drilled_value(first, n + z + y + 1));
    return Corners(low, high);
}

// How deep a place, in padded grid coordinates, lies in what was cut, nodes.
fn drilled(g: vec3f) -> f32 {
    let cell = clamp(vec3i(floor(g)), vec3i(0), vec3i(scene.dims.xyz) - 2);
    let first = drilled_brick(cell);
    if first < 0 { return FAR; }
    let last = 4.0 * scene.steps.x;
    let at = clamp((g - 4.0 * vec3f(cell / 4)) * scene.steps.x, vec3f(0.0), vec3f(last));
    let low = min(floor(at), vec3f(last - 1.0));
    let c = drilled_corners(first, vec3i(low));
    return blend(c.low, c.high, at - low);
}

// A density with what was cut there, HU: under a ramp at the cut.
fn shown_hu(hu: f32, g: vec3f) -> f32 {
    return min(hu, max(scene.dims.w - CUT_RAMP_HU * drilled(g), -1000.0));
}
