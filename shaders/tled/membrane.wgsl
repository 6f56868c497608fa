// Forces of the membrane's triangles on their nodes, each to its own slot; as in the processor's
// sheet.rs. F = e + h    C - 1 = e·h + h·e + h·h    f_a = -A F S ∇N_a
// Places of a triangle's corners, then its slots; three of each count.
@group(0) @binding(1) var<storage, read> corners: array<vec4u>;
// Three rows a triangle: first axis and its part of ∇N_1, second axis and its part of ∇N_1, and
// ∇N_2 with shear modulus times volume.
@group(0) @binding(2) var<storage, read> rows: array<vec4f>;
@group(0) @binding(3) var<storage, read> u: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> forces: array<vec4f>;

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    let t = id.x;
    if t >= arrayLength(&corners) / 2u { return; }
    let at = corners[2u * t];
    let x = rows[3u * t];
    let y = rows[3u * t + 1u];
    let z = rows[3u * t + 2u];
    let o = u[at.x].xyz;
    let ua = u[at.y].xyz - o;
    let ub = u[at.z].xyz - o;
    let h = ua * x.w + ub * z.x;
    let g = ua * y.w + ub * z.y;
    let f0 = x.xyz + h;
    let f1 = y.xyz + g;
    let first = dot(h, x.xyz) + dot(h, f0);
    let second = dot(g, y.xyz) + dot(g, f1);
    let shear = dot(x.xyz, g) + dot(h, f1);
    let mean = 0.5 * (first + second);
    let apart = 0.5 * (first - second);
    let radius = sqrt(apart * apart + shear * shear);
    let wide = max(1.0 + mean + radius, 1e-6);
    let narrow = max(1.0 + mean - radius, 1.0 / sqrt(wide));
    let along = max(1.0 - 1.0 / (wide * wide * narrow), 0.0);
    let across = max(1.0 - 1.0 / (narrow * narrow * wide), 0.0);
    let round = z.z * 0.5 * (along + across);
    let turn = z.z * 0.5 * (along - across) / max(radius, 1e-9);
    let p0 = f0 * (round + turn * apart) + f1 * (turn * shear);
    let p1 = f0 * (turn * shear) + f1 * (round - turn * apart);
    let fa = -(p0 * x.w + p1 * y.w);
    let fb = -(p0 * z.x + p1 * z.y);
    let to = corners[2u * t + 1u];
    forces[to.x] = vec4f(-(fa + fb), 0.0);
    forces[to.y] = vec4f(fa, 0.0);
    forces[to.z] = vec4f(fb, 0.0);
}
