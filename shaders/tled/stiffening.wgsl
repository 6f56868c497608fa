// Stiffening with strain, constants s μ V, A V, ε and κ V, with Q = A (t w)^(1/16)/w N¹⁶,
// N = h cofᵀF cof F / t:  s = s μ g I + 2 h Q ⨯ FᵀF    q = s μ/2 g' I₁ + h' tr(Q cofᵀF cof F)
// J₁ and b of the pressure against inversion, as in the processor's law.
const RESIST_BELOW = 0.7;
const STEEPENING = 16.0;
const ROUND = false;
fn more_of(e: u32) -> vec4f { return more[e]; }
fn moduli(c: array<f32, 5>) -> vec2f { return vec2f(c[0] + 34.0 * c[1], c[3]); }
fn stress_at_rest(c: array<f32, 5>) -> f32 { return c[0] + 4.0 * c[1]; }
fn stiffening_at_rest(c: array<f32, 5>) -> f32 { return 99.0 * c[1]; }

fn squared(a: array<f32, 6>) -> array<f32, 6> {
    let xy = a[3] * a[3];
    let xz = a[4] * a[4];
    let yz = a[5] * a[5];
    return array<f32, 6>(
        a[0] * a[0] + xy + xz, a[1] * a[1] + xy + yz, a[2] * a[2] + xz + yz,
        (a[0] + a[1]) * a[3] + a[4] * a[5], (a[0] + a[2]) * a[4] + a[3] * a[5], (a[1] + a[2]) * a[5] + a[3] * a[4]);
}

// tr(A B).
fn trace_of_product(a: array<f32, 6>, b: array<f32, 6>) -> f32 {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
}

// A ⨯ B, twice the cofactor for A = B.
fn crossed(a: array<f32, 6>, b: array<f32, 6>) -> array<f32, 6> {
    return array<f32, 6>(
        a[1] * b[2] + a[2] * b[1] - 2.0 * a[5] * b[5],
        a[0] * b[2] + a[2] * b[0] - 2.0 * a[4] * b[4],
        a[0] * b[1] + a[1] * b[0] - 2.0 * a[3] * b[3],
        a[4] * b[5] + a[5] * b[4] - a[3] * b[2] - a[2] * b[3],
        a[3] * b[5] + a[5] * b[3] - a[4] * b[1] - a[1] * b[4],
        a[3] * b[4] + a[4] * b[3] - a[5] * b[0] - a[0] * b[5]);
}

fn times(a: array<f32, 6>, by: f32) -> array<f32, 6> {
    return array<f32, 6>(a[0] * by, a[1] * by, a[2] * by, a[3] * by, a[4] * by, a[5] * by);
}

fn stress(c: array<f32, 5>, d: Deformation) -> Stress {
    let power = d.root * d.root;
    let g = continued(d, power, -2.0 / 3.0);
    let h = continued(d, power * power, -4.0 / 3.0);
    let green = squared_rows(d.f);
    let inverse = squared_rows(d.cof);
    let b = times(inverse, h.x);
    let t = max((b[0] + b[1] + b[2]) * (1.0 / 3.0), 1.0);
    let fall = 1.0 / t;
    let n = times(b, fall);
    let n16 = squared(squared(squared(squared(n))));
    let fall4 = (fall * fall) * (fall * fall);
    let fall16 = (fall4 * fall4) * (fall4 * fall4);
    let w = (1.0 - 3.0 * c[2]) * (fall16 * fall) + c[2] * trace_of_product(n16, n);
    let q = times(n16, c[1] * sqrt(sqrt(sqrt(sqrt(t * w)))) / w);
    var s = times(crossed(q, green), 2.0 * h.x);
    let i1 = green[0] + green[1] + green[2];
    for (var k = 0u; k < 3u; k++) { s[k] += c[0] * g.x; }
    let through = trace_of_product(q, inverse);
    let along = 0.5 * c[0] * g.y * i1 + h.y * through;
    let root3 = power * d.root;
    let swollen = through * (inverse[0] + inverse[1] + inverse[2]) * root3 * root3;
    return Stress(s, along, 5.5 * h.x * ((q[0] + q[1] + q[2]) * i1 + swollen));
}
