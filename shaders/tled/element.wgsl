// How an element is deformed; the text before each pass over elements. F = I + Σ (u_a - u_0) ⊗ ∇N_a
// C = cof F    J = det F Places of the corners; then where each corner writes, and the node_groups
// where it takes its volume from, all elements each.
@group(0) @binding(1) var<storage, read> corners: array<vec4u>;
// Three rows an element: ∇N_1..3, and beside them the law's first two constants and ω² over
// stiffness at rest.
@group(0) @binding(2) var<storage, read> rows: array<vec4f>;
@group(0) @binding(3) var<storage, read> u: array<vec4f>;

struct Deformation {
    // Rows of F and of its cofactor.
    f: mat3x3f,
    cof: mat3x3f,
    j: f32,
    // max(J, 0.3) and its power -1/3.
    clamped: f32,
    root: f32,
    // Gradients and what stands beside them.
    a: vec4f,
    b: vec4f,
    c: vec4f,
}

// x^(-1/3): the same bits to begin with and the same three Newton steps as on the processor.
fn inverse_cube_root(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    var third = (bits >> 2u) + (bits >> 4u);
    third += third >> 4u;
    third += third >> 8u;
    var y = bitcast<f32>(0x54A2FA8Cu - third);
    for (var i = 0; i < 3; i++) {
        y = y * (4.0 - x * (y * y * y)) * (1.0 / 3.0);
    }
    return y;
}

fn deformation(e: u32) -> Deformation {
    var d: Deformation;
    let at = corners[e];
    d.a = rows[3u * e];
    d.b = rows[3u * e + 1u];
    d.c = rows[3u * e + 2u];
    let o = u[at.x].xyz;
    let ua = u[at.y].xyz - o;
    let ub = u[at.z].xyz - o;
    let uc = u[at.w].xyz - o;
    let f0 = vec3f(1.0, 0.0, 0.0) + (ua.x * d.a.xyz + ub.x * d.b.xyz + uc.x * d.c.xyz);
    let f1 = vec3f(0.0, 1.0, 0.0) + (ua.y * d.a.xyz + ub.y * d.b.xyz + uc.y * d.c.xyz);
    let f2 = vec3f(0.0, 0.0, 1.0) + (ua.z * d.a.xyz + ub.z * d.b.xyz + uc.z * d.c.xyz);
    d.f = mat3x3f(f0, f1, f2);
    d.cof = mat3x3f(cross(f1, f2), cross(f2, f0), cross(f0, f1));
    d.j = dot(f0, d.cof[0]);
    d.clamped = max(d.j, 0.3);
    d.root = inverse_cube_root(d.clamped);
    return d;
}

// Rowᵀrow, summed over three rows: xx, yy, zz, xy, xz, yz.
fn squared_rows(m: mat3x3f) -> array<f32, 6> {
    let plain = m[0] * m[0] + m[1] * m[1] + m[2] * m[2];
    let mixed = m[0] * m[0].yzx + m[1] * m[1].yzx + m[2] * m[2].yzx;
    return array<f32, 6>(plain.x, plain.y, plain.z, mixed.x, mixed.z, mixed.y);
}
