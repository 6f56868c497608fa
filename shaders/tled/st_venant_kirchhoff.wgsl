// St. Venant-Kirchhoff, constants λ V, μ V:  s = (λ tr E - μ) I + μ FᵀF,  q = 0, no κ term
// J₁ and b of the pressure against inversion, as in the processor's law.
const RESIST_BELOW = 0.3;
const STEEPENING = 4.0;
const ROUND = false;
fn more_of(e: u32) -> vec4f { return vec4f(0.0); }
fn moduli(c: array<f32, 5>) -> vec2f { return vec2f(c[0] + c[1], 0.0); }
fn stress_at_rest(c: array<f32, 5>) -> f32 { return 0.0; }
fn stiffening_at_rest(c: array<f32, 5>) -> f32 { return 0.0; }
fn stress(c: array<f32, 5>, d: Deformation) -> Stress {
    let b = squared_rows(d.f);
    let along = c[0] * (0.5 * ((b[0] - 1.0) + (b[1] - 1.0) + (b[2] - 1.0))) - c[1];
    let s = array<f32, 6>(
        along + c[1] * b[0], along + c[1] * b[1], along + c[1] * b[2], c[1] * b[3], c[1] * b[4], c[1] * b[5]);
    return Stress(s, 0.0, 0.0);
}
