// Pressure of the tool's spring, N, on the weighted mean of the nodes it touches: d = d_rest + Σ w u·n, p = max(k d + b (v̄·n - v_tool), 0).
@group(0) @binding(1) var<storage, read> touched: array<vec2u>;
@group(0) @binding(2) var<storage, read> u: array<vec4f>;
@group(0) @binding(3) var<storage, read> v: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> pressure: array<f32>;

var<workgroup> sums: array<vec2f, 64>;

@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) lane: u32) {
    var mine = vec2f(0.0);
    if lane < now.pressed {
        let place = touched[lane].x;
        mine = bitcast<f32>(touched[lane].y) * vec2f(dot(u[place].xyz, now.normal), dot(v[place].xyz, now.normal));
    }
    sums[lane] = mine;
    workgroupBarrier();
    // A tree of fixed shape: the same sum in every run.
    for (var reach = 32u; reach > 0u; reach >>= 1u) {
        if lane < reach { sums[lane] += sums[lane + reach]; }
        workgroupBarrier();
    }
    if lane == 0u {
        let depth = now.rest_depth + sums[0].x;
        let force = now.stiffness * depth + now.damping * (sums[0].y - now.tool_velocity);
        let finite = (bitcast<u32>(force) & 0x7f800000u) != 0x7f800000u;
        pressure[0] = select(0.0, max(force, 0.0), now.pressed > 0u && depth > 0.0 && finite);
    }
}
