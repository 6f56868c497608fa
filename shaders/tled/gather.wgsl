// Gathers what the elements left for a node, in the order of its run of slots. The pass declares
// `starts` and `forces`. Slots are loaded some at a time, since each load waits as long as many.
const AT_ONCE = 8u;

struct Gathered {
    force: vec3f,
    // Largest growth of ω², and inverted elements.
    growth: f32,
    inverted: u32,
}

fn gathered(n: u32) -> Gathered {
    var sum = Gathered(vec3f(0.0), 0.0, 0u);
    let end = starts[n + 1u];
    for (var slot = starts[n]; slot < end; slot += AT_ONCE) {
        var some: array<vec4f, AT_ONCE>;
        for (var i = 0u; i < AT_ONCE; i++) { some[i] = forces[min(slot + i, end - 1u)]; }
        for (var i = 0u; i < AT_ONCE; i++) {
            let f = select(vec4f(0.0), some[i], slot + i < end);
            sum.force += f.xyz;
            sum.growth = max(sum.growth, abs(f.w));
            sum.inverted += select(0u, 1u, f.w < 0.0);
        }
    }
    return sum;
}
