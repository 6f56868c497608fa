// Mooney-Rivlin, constants c₁₀ V, c₀₁ V, κ V, with g = J^(-2/3), h = J^(-4/3):
//   s = (2 c₁₀ g + 2 c₀₁ h I₁) I - 2 c₀₁ h FᵀF    q = c₁₀ g' I₁ + c₀₁ h' I₂
// J₁ and b of the pressure against inversion, as in the processor's law.
const RESIST_BELOW = 0.3;
const STEEPENING = 4.0;
const ROUND = false;
fn more_of(e: u32) -> vec4f { return more[e]; }
fn moduli(c: array<f32, 5>) -> vec2f { return vec2f(2.0 * (c[0] + c[1]), c[2]); }
fn stress_at_rest(c: array<f32, 5>) -> f32 { return 2.0 * (c[0] + 2.0 * c[1]); }
fn stiffening_at_rest(c: array<f32, 5>) -> f32 { return 0.0; }
fn stress(c: array<f32, 5>, d: Deformation) -> Stress {
    let power = d.root * d.root;
    let g = continued(d, power, -2.0 / 3.0);
    let h = continued(d, power * power, -4.0 / 3.0);
    let b = squared_rows(d.f);
    let i1 = b[0] + b[1] + b[2];
    let i2 = dot(d.cof[0], d.cof[0]) + dot(d.cof[1], d.cof[1]) + dot(d.cof[2], d.cof[2]);
    let second = 2.0 * c[1] * h.x;
    let along = 2.0 * c[0] * g.x + second * i1;
    let s = array<f32, 6>(
        along - second * b[0], along - second * b[1], along - second * b[2], -second * b[3], -second * b[4], -second * b[5]);
    return Stress(s, c[0] * g.y * i1 + c[1] * h.y * i2, 0.0);
}
