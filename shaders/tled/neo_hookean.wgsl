// Neo-Hookean, constants μ V, κ V:  s = μ g I,  q = μ/2 g' I₁,  g = J^(-2/3)
// J₁ and b of the pressure against inversion, as in the processor's law.
const RESIST_BELOW = 0.3;
const STEEPENING = 4.0;
const ROUND = true;
fn more_of(e: u32) -> vec4f { return vec4f(0.0); }
fn moduli(c: array<f32, 5>) -> vec2f { return vec2f(c[0], c[1]); }
fn stress_at_rest(c: array<f32, 5>) -> f32 { return c[0]; }
fn stiffening_at_rest(c: array<f32, 5>) -> f32 { return 0.0; }
fn stress(c: array<f32, 5>, d: Deformation) -> Stress {
    let g = continued(d, d.root * d.root, -2.0 / 3.0);
    let i1 = dot(d.f[0], d.f[0]) + dot(d.f[1], d.f[1]) + dot(d.f[2], d.f[2]);
    let along = c[0] * g.x;
    return Stress(array<f32, 6>(along, along, along, 0.0, 0.0, 0.0), c[0] * 0.5 * g.y * i1, 0.0);
}
