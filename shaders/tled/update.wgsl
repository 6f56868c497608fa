// Gathers the forces on a node from its run of slots, in their order, and moves it by central
// differences. v⁺ = keep v + gain (w g + f/m)    u⁺ = u + dt v⁺
@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read> forces: array<vec4f>;
// 1/m, 0 where the node is fixed; the share of m that has weight.
@group(0) @binding(3) var<storage, read> nodes: array<vec4f>;
@group(0) @binding(4) var<storage, read> pushed: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> u: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> v: array<vec4f>;
// Since they were last cleared: most inverted elements at once, times limited, times not finite,
// bits of the largest growth of ω².
@group(0) @binding(7) var<storage, read_write> noticed: array<vec4u>;
@group(0) @binding(8) var<storage, read> anchors: array<Anchor>;

fn finite(x: vec3f) -> bool {
    let exponents = bitcast<vec3u>(x) & vec3u(0x7f800000u);
    return all(exponents != vec3u(0x7f800000u));
}

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    let n = id.x;
    if n >= now.nodes { return; }
    let sum = gathered(n);
    let force = sum.force + pushed[n].xyz;
    var seen = noticed[n];
    seen.x = max(seen.x, sum.inverted);
    seen.w = max(seen.w, bitcast<u32>(sum.growth));
    let node = nodes[n];
    if node.x > 0.0 {
        let before = u[n].xyz;
        let pull = weight_at(n, before) * node.y + force * node.x;
        var velocity = anchored(n, before, v[n].xyz * now.keep + pull * now.gain, node.x * now.gain);
        let speed = length(velocity);
        var held = speed > now.max_speed;
        if held { velocity *= now.max_speed / speed; }
        var after = before + velocity * now.dt;
        let far = length(after);
        if !(finite(velocity) && finite(after)) {
            velocity = vec3f(0.0);
            after = before;
            held = false;
            seen.z += 1u;
        } else if far > now.max_displacement {
            after *= now.max_displacement / far;
            velocity = vec3f(0.0);
            held = true;
        }
        seen.y += select(0u, 1u, held);
        u[n] = vec4f(after, 0.0);
        v[n] = vec4f(velocity, 0.0);
    }
    noticed[n] = seen;
}
