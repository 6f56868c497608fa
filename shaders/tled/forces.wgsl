// Forces of a neo-Hookean tetrahedron on its four nodes, each to its own slot.
//   F = I + Σ (u_a - u_0) ⊗ ∇N_a    C = cof F    J = det F    f_a = -V P ∇N_a
//   P = μ g F + (μ/2 g' I₁ + κ (J-1)) C,    g = J^(-2/3), continued linearly below J = 0.3
// The slot of corner 0 also carries the element's present ω², negative where J ≤ 0.
@group(0) @binding(1) var<storage, read> corners: array<vec4u>;
@group(0) @binding(2) var<storage, read> slots: array<vec4u>;
// Three rows an element: ∇N_1..3, and beside them μ V, κ V, ω² over stiffness at rest.
@group(0) @binding(3) var<storage, read> rows: array<vec4f>;
@group(0) @binding(4) var<storage, read> u: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> forces: array<vec4f>;

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

// A bound of the largest eigenvalue of CᵀC.
fn largest_eigenvalue(c: mat3x3f) -> f32 {
    let squares = vec3f(dot(c[0], c[0]), dot(c[1], c[1]), dot(c[2], c[2]));
    let off = vec3f(dot(c[0], c[1]), dot(c[0], c[2]), dot(c[1], c[2]));
    let mean = (squares.x + squares.y + squares.z) / 3.0;
    let apart = squares - mean;
    return mean + 2.0 * sqrt((dot(apart, apart) + 2.0 * dot(off, off)) / 6.0);
}

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    let e = id.x;
    if e >= now.elements { return; }
    let at = corners[e];
    let to = slots[e];
    let a = rows[3u * e];
    let b = rows[3u * e + 1u];
    let c = rows[3u * e + 2u];
    let o = u[at.x].xyz;
    let ua = u[at.y].xyz - o;
    let ub = u[at.z].xyz - o;
    let uc = u[at.w].xyz - o;
    // Rows of F and of its cofactor.
    let f0 = vec3f(1.0, 0.0, 0.0) + (ua.x * a.xyz + ub.x * b.xyz + uc.x * c.xyz);
    let f1 = vec3f(0.0, 1.0, 0.0) + (ua.y * a.xyz + ub.y * b.xyz + uc.y * c.xyz);
    let f2 = vec3f(0.0, 0.0, 1.0) + (ua.z * a.xyz + ub.z * b.xyz + uc.z * c.xyz);
    let cof = mat3x3f(cross(f1, f2), cross(f2, f0), cross(f0, f1));
    let j = dot(f0, cof[0]);
    let clamped = max(j, 0.3);
    let root = inverse_cube_root(clamped);
    let inverse = root * root * root;
    let mu = a.w;
    let kappa = b.w;
    let i1 = dot(f0, f0) + dot(f1, f1) + dot(f2, f2);
    let slope = -2.0 / 3.0 * root * root * inverse;
    let s = mu * (root * root + slope * (j - clamped));
    let q = mu * 0.5 * slope * i1 + kappa * (j - 1.0);
    let p0 = -(s * f0 + q * cof[0]);
    let p1 = -(s * f1 + q * cof[1]);
    let p2 = -(s * f2 + q * cof[2]);
    let fa = vec3f(dot(p0, a.xyz), dot(p1, a.xyz), dot(p2, a.xyz));
    let fb = vec3f(dot(p0, b.xyz), dot(p1, b.xyz), dot(p2, b.xyz));
    let fc = vec3f(dot(p0, c.xyz), dot(p1, c.xyz), dot(p2, c.xyz));
    // How stiff the element is now, as in the processor's stiffness.rs.
    let volume = kappa + 5.0 / 9.0 * mu * i1 * inverse * inverse * root * root;
    let stiff = 3.0 * abs(s) + volume * largest_eigenvalue(cof) + abs(q) * sqrt(i1);
    let omega2 = c.w * stiff;
    forces[to.x] = vec4f(-(fa + fb + fc), select(omega2, -omega2, j <= 0.0));
    forces[to.y] = vec4f(fa, 0.0);
    forces[to.z] = vec4f(fb, 0.0);
    forces[to.w] = vec4f(fc, 0.0);
}
