// Forces of all springs on the nodes they touch, one spring after the other: d = d_rest + Σ w u·n, p = max(k d + b (v̄·n - v_tool), 0).
struct Spring {
    // Unit vector out of the tissue; the rest is scaled to what is stable.
    normal: vec3f,
    stiffness: f32,
    damping: f32,
    rest_depth: f32,
    tool_velocity: f32,
    // Of `touched`, up to 64 nodes, each at most once.
    first: u32,
    count: u32,
}
@group(0) @binding(1) var<storage, read> springs: array<Spring>;
// Place and bits of the weight of every node of every spring.
@group(0) @binding(2) var<storage, read> touched: array<vec2u>;
@group(0) @binding(3) var<storage, read> u: array<vec4f>;
@group(0) @binding(4) var<storage, read> v: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> pushed: array<vec4f>;
// Of all springs, summed, N.
@group(0) @binding(6) var<storage, read_write> pressure: array<f32>;

var<workgroup> sums: array<vec2f, 64>;

fn force_of(spring: Spring) -> f32 {
    let depth = spring.rest_depth + sums[0].x;
    let force = spring.stiffness * depth + spring.damping * (sums[0].y - spring.tool_velocity);
    let finite = (bitcast<u32>(force) & 0x7f800000u) != 0x7f800000u;
    return select(0.0, max(force, 0.0), depth > 0.0 && finite);
}

@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) lane: u32) {
    for (var s = 0u; s < now.springs; s++) {
        let spring = springs[s];
        if lane < spring.count { pushed[touched[spring.first + lane].x] = vec4f(0.0); }
    }
    var total = 0.0;
    for (var s = 0u; s < now.springs; s++) {
        let spring = springs[s];
        let at = touched[spring.first + lane];
        let weight = bitcast<f32>(at.y);
        let mine = lane < spring.count;
        sums[lane] = vec2f(0.0);
        if mine { sums[lane] = weight * vec2f(dot(u[at.x].xyz, spring.normal), dot(v[at.x].xyz, spring.normal)); }
        workgroupBarrier();
        // A tree of fixed shape: the same sum in every run.
        for (var reach = 32u; reach > 0u; reach >>= 1u) {
            if lane < reach { sums[lane] += sums[lane + reach]; }
            workgroupBarrier();
        }
        let force = force_of(spring);
        total += force;
        storageBarrier();
        if mine { pushed[at.x] -= vec4f(spring.normal * (force * weight), 0.0); }
        workgroupBarrier();
    }
    if lane == 0u { pressure[0] = total; }
}
