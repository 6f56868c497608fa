// Ogden, constants m₁, α₁, m₂, α₂ and κ V, with m = 2 μ V/α² and the principal stretches λ_i along
// n_i: s = Σ_i s_i n_i n_iᵀ,  s_i = Σ_p 2 m g_p ∂(λ_i^α)/∂(λ_i²)    q = Σ_p m g_p' Σ_i λ_i^α
// g_p = J^(-α/3) Logarithm, power and axes as in the processor's lane.rs and principal.rs.
// J₁ and b of the pressure against inversion, as in the processor's law.
const RESIST_BELOW = 0.3;
const STEEPENING = 4.0;
const ROUND = false;
fn more_of(e: u32) -> vec4f { return more[e]; }
fn moduli(c: array<f32, 5>) -> vec2f {
    return vec2f(0.5 * (c[0] * c[1] * c[1] + c[2] * c[3] * c[3]), c[4]);
}
fn stress_at_rest(c: array<f32, 5>) -> f32 { return c[0] * c[1] + c[2] * c[3]; }

// log₂ x for x over 0.
fn logarithm(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let exponent = f32(bits >> 23u) - 127.0;
    let m = bitcast<f32>((bits & 0x007FFFFFu) | 0x3F800000u);
    let s = (m - 1.41421356) / (m + 1.41421356);
    let q = s * s;
    let series = ((1.0 / 9.0 * q + 1.0 / 7.0) * q + 0.2) * q + 1.0 / 3.0;
    return exponent + (0.5 + (s + s * q * series) * 2.88539008);
}

// 2^x, x held between -126 and 126.
fn power_of_two(given: f32) -> f32 {
    let x = clamp(given, -126.0, 126.0);
    let whole = round(x);
    let f = x - whole;
    var series = 0.000015252734 * f + 0.0001540353;
    series = series * f + 0.0013333558;
    series = series * f + 0.009618129;
    series = series * f + 0.05550411;
    series = series * f + 0.2402265;
    series = series * f + 0.69314718;
    return (series * f + 1.0) * bitcast<f32>(u32(i32(whole) + 127) << 23u);
}

// Makes entry pq zero: what pp loses and qq gains, cosine and sine.
fn rotation(pp: f32, qq: f32, pq: f32) -> vec3f {
    let apart = qq - pp;
    let twice = 2.0 * pq;
    let root = sqrt(apart * apart + twice * twice) + 1e-30;
    let t = twice / (apart + select(root, -root, apart < 0.0));
    let c = 1.0 / sqrt(1.0 + t * t);
    return vec3f(t * pq, c, t * c);
}

// λ^α as a function of λ², and its slope over λ²; a tangent line below λ = 0.1.
fn stretch_power(square: f32, alpha: f32) -> vec2f {
    let at = max(square, 0.01);
    let value = power_of_two(0.5 * alpha * logarithm(at));
    let slope = 0.5 * alpha * value / at;
    return vec2f(value + slope * (square - at), slope);
}

// One term: s_i and its part of q.
fn term(scale: f32, alpha: f32, squares: vec3f, d: Deformation) -> vec4f {
    let n = alpha * (-1.0 / 3.0);
    let g = continued(d, power_of_two(n * logarithm(d.clamped)), n);
    let x = stretch_power(squares.x, alpha);
    let y = stretch_power(squares.y, alpha);
    let z = stretch_power(squares.z, alpha);
    return vec4f(2.0 * scale * g.x * vec3f(x.y, y.y, z.y), scale * g.y * (x.x + y.x + z.x));
}

fn stiffening_at_rest(c: array<f32, 5>) -> f32 { return 0.0; }
fn stress(c: array<f32, 5>, d: Deformation) -> Stress {
    var b = squared_rows(d.f);
    var x = vec3f(1.0, 0.0, 0.0);
    var y = vec3f(0.0, 1.0, 0.0);
    var z = vec3f(0.0, 0.0, 1.0);
    for (var sweep = 0; sweep < 4; sweep++) {
        let r = rotation(b[0], b[1], b[3]);
        b = array<f32, 6>(b[0] - r.x, b[1] + r.x, b[2], 0.0, r.y * b[4] - r.z * b[5], r.z * b[4] + r.y * b[5]);
        let p = x;
        x = r.y * p - r.z * y;
        y = r.z * p + r.y * y;
        let s = rotation(b[0], b[2], b[4]);
        b = array<f32, 6>(b[0] - s.x, b[1], b[2] + s.x, s.y * b[3] - s.z * b[5], 0.0, s.z * b[3] + s.y * b[5]);
        let q = x;
        x = s.y * q - s.z * z;
        z = s.z * q + s.y * z;
        let t = rotation(b[1], b[2], b[5]);
        b = array<f32, 6>(b[0], b[1] - t.x, b[2] + t.x, t.y * b[3] - t.z * b[4], t.z * b[3] + t.y * b[4], 0.0);
        let w = y;
        y = t.y * w - t.z * z;
        z = t.z * w + t.y * z;
    }
    let squares = vec3f(b[0], b[1], b[2]);
    let both = term(c[0], c[1], squares, d) + term(c[2], c[3], squares, d);
    let plain = both.x * x * x + both.y * y * y + both.z * z * z;
    let mixed = both.x * x * x.yzx + both.y * y * y.yzx + both.z * z * z.yzx;
    return Stress(array<f32, 6>(plain.x, plain.y, plain.z, mixed.x, mixed.z, mixed.y), both.w, 0.0);
}
