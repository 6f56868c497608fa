// Forces of the elements of one law on their four nodes, each to its own slot.
//   P = F S + (q + κ (J̄ - 1 - p)) C    f_a = -V P ∇N_a
//   p = w² (1 + b w²)                  w = (J₁ - J)/J₁ between 0 and 1
// J̄ = J, or the mean of the corners' node groups with averaged pressure. The slot of corner 0 also
// carries the growth of the element's ω² since rest, negative where J ≤ 0.

struct Range { first: u32, count: u32 }
@group(0) @binding(4) var<storage, read_write> forces: array<vec4f>;
// Further constants of the laws that have more than two.
@group(0) @binding(5) var<storage, read> more: array<vec4f>;
// Past stress: three terms of six numbers, all elements each.
@group(0) @binding(6) var<storage, read_write> memory: array<f32>;
@group(0) @binding(7) var<storage, read> volume_change: array<f32>;
@group(0) @binding(8) var<uniform> range: Range;

// An isochoric stress, times rest volume: V P = F s + q C.
struct Stress {
    s: array<f32, 6>,
    q: f32,
    // A bound of the law's own stiffening beyond s.
    stiffening: f32,
}

// J^n continued linearly below J = 0.3, and its slope, from `at` = max(J, 0.3)^n.
fn continued(d: Deformation, at: f32, n: f32) -> vec2f {
    let slope = n * at * (d.root * d.root * d.root);
    return vec2f(at + slope * (d.j - d.clamped), slope);
}

// Pressure p that resists inversion, and its slope against -J.
fn resistance(d: Deformation) -> vec2f {
    let w = clamp((RESIST_BELOW - d.j) * (1.0 / RESIST_BELOW), 0.0, 1.0);
    let steep = STEEPENING * w * w;
    return vec2f(w * w * (1.0 + steep), w * (2.0 + 4.0 * steep) * (1.0 / RESIST_BELOW));
}

// A bound of the largest eigenvalue of CᵀC.
fn largest_eigenvalue(c: mat3x3f) -> f32 {
    let squares = vec3f(dot(c[0], c[0]), dot(c[1], c[1]), dot(c[2], c[2]));
    let off = vec3f(dot(c[0], c[1]), dot(c[0], c[2]), dot(c[1], c[2]));
    let mean = (squares.x + squares.y + squares.z) / 3.0;
    let apart = squares - mean;
    return mean + 2.0 * sqrt((dot(apart, apart) + 2.0 * dot(off, off)) / 6.0);
}

// How stiff the element is now, as in the processor's stiffness.rs; `m` is μ V and κ V.
fn stiffness(stress: Stress, m: vec2f, d: Deformation, swollen: f32) -> f32 {
    let s = stress.s;
    let off = abs(s[3]) + abs(s[4]) + abs(s[5]);
    let inverse = d.root * d.root * d.root;
    let i1 = dot(d.f[0], d.f[0]) + dot(d.f[1], d.f[1]) + dot(d.f[2], d.f[2]);
    let volume = m.y * (1.0 + resistance(d).y) + 5.0 / 9.0 * m.x * i1 * (inverse * inverse * d.root * d.root);
    let turning = abs(stress.q + m.y * swollen) * sqrt(i1);
    return abs(s[0]) + abs(s[1]) + abs(s[2]) + off + off + stress.stiffening + volume * largest_eigenvalue(d.cof) + turning;
}

// Lets the memory take up the isochoric stress and takes the memory off it.
fn relaxed(e: u32, stress: Stress, d: Deformation) -> Stress {
    var left = stress;
    let inverse = d.root * d.root * d.root;
    let green = squared_rows(d.cof);
    for (var k = 0u; k < 6u; k++) {
        let whole = stress.s[k] + stress.q * (green[k] * inverse);
        for (var term = 0u; term < 3u; term++) {
            let at = (6u * term + k) * now.elements + e;
            let kept = now.fade_keep[term] * memory[at] + now.fade_gain[term] * whole;
            memory[at] = kept;
            left.s[k] -= kept;
        }
    }
    return left;
}

// A row of -V P.
fn pressed(stress: Stress, f: vec3f, c: vec3f) -> vec3f {
    let s = stress.s;
    if ROUND && !RELAXES { return -(s[0] * f + stress.q * c); }
    let along = vec3f(
        f.x * s[0] + f.y * s[3] + f.z * s[4], f.x * s[3] + f.y * s[1] + f.z * s[5], f.x * s[4] + f.y * s[5] + f.z * s[2]);
    return -(along + stress.q * c);
}

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= range.count { return; }
    let e = range.first + id.x;
    let d = deformation(e);
    let constants = array<f32, 5>(d.a.w, d.b.w, more_of(e).x, more_of(e).y, more_of(e).z);
    let m = moduli(constants);
    var found = stress(constants, d);
    var swollen = d.j - 1.0;
    if AVERAGES {
        let node_group = corners[2u * now.elements + e];
        swollen = (volume_change[node_group.x] + volume_change[node_group.y] + volume_change[node_group.z] + volume_change[node_group.w]) * 0.25;
    }
    swollen -= resistance(d).x;
    let at_rest = (3.0 + sqrt(3.0)) * abs(stress_at_rest(constants)) + stiffening_at_rest(constants) + m.y + 5.0 / 3.0 * m.x;
    let growth = max(d.c.w * (stiffness(found, m, d, swollen) - at_rest), 1e-30);
    if RELAXES { found = relaxed(e, found, d); }
    found.q += m.y * swollen;
    let p0 = pressed(found, d.f[0], d.cof[0]);
    let p1 = pressed(found, d.f[1], d.cof[1]);
    let p2 = pressed(found, d.f[2], d.cof[2]);
    let fa = vec3f(dot(p0, d.a.xyz), dot(p1, d.a.xyz), dot(p2, d.a.xyz));
    let fb = vec3f(dot(p0, d.b.xyz), dot(p1, d.b.xyz), dot(p2, d.b.xyz));
    let fc = vec3f(dot(p0, d.c.xyz), dot(p1, d.c.xyz), dot(p2, d.c.xyz));
    let to = corners[now.elements + e];
    forces[to.x] = vec4f(-(fa + fb + fc), select(growth, -growth, d.j <= 0.0));
    forces[to.y] = vec4f(fa, 0.0);
    forces[to.z] = vec4f(fb, 0.0);
    forces[to.w] = vec4f(fc, 0.0);
}
