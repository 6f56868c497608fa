// Forces of all springs on the nodes they touch, each implicit, one after the other, with the velocities v that nodes would have without the springs to come:
//   d = d_rest + Σ w u·n    p = max(0, (k (d + dt v̄) + b (v̄ - v_tool)) / (1 + gain (k dt + b) Σ w²/m))
// What moves against the common velocity of a pressing spring's nodes is calmed.
// Planes, springs of one node each and no two of the same, follow side by side.
struct Spring {
    // Unit vector out of the tissue.
    normal: vec3f,
    stiffness: f32,
    damping: f32,
    rest_depth: f32,
    tool_velocity: f32,
    // Of `touched`, up to 64 nodes, each at most once.
    first: u32,
    count: u32,
    // Σ w²/m.
    compliance: f32,
    // Σ w of the nodes that are not fixed; those that are rest.
    weight: f32,
    // What it takes of its nodes' motion against each other.
    calm: f32,
}
@group(0) @binding(1) var<storage, read> springs: array<Spring>;
// Of every node of every spring: place; bits of the weight, of 1/m, of the share of m that has weight.
@group(0) @binding(2) var<storage, read> touched: array<vec4u>;
@group(0) @binding(3) var<storage, read> u: array<vec4f>;
@group(0) @binding(4) var<storage, read> v: array<vec4f>;
// The elements' forces: where a place's run of slots begins, and the slots.
@group(0) @binding(5) var<storage, read> starts: array<u32>;
@group(0) @binding(6) var<storage, read> forces: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> pushed: array<vec4f>;
// Of all springs, summed, N.
@group(0) @binding(8) var<storage, read_write> pressure: array<f32>;

var<workgroup> sums: array<vec2f, 64>;
// Momentum and mass of the nodes of a spring.
var<workgroup> carried: array<vec4f, 64>;

fn force_of(spring: Spring) -> f32 {
    let depth = spring.rest_depth + sums[0].x;
    // As they are calmed, of which each takes the same share.
    let together = carried[0].xyz / max(carried[0].w, 1e-30);
    let coming = (1.0 - spring.calm) * sums[0].y + spring.calm * spring.weight * dot(together, spring.normal);
    return pressed(spring, depth, coming);
}

// Force of a spring that is so deep, mm, on nodes that come at this speed, mm/ms.
fn pressed(spring: Spring, depth: f32, coming: f32) -> f32 {
    let held = 1.0 + now.gain * (spring.stiffness * now.dt + spring.damping) * spring.compliance;
    let force = (spring.stiffness * (depth + now.dt * coming) + spring.damping * (coming - spring.tool_velocity)) / held;
    let finite = (bitcast<u32>(force) & 0x7f800000u) != 0x7f800000u;
    return select(0.0, max(force, 0.0), depth > 0.0 && finite);
}

// Velocity that a node would have after the step under its elements, weight, and the springs so far.
fn free_velocity(at: vec4u) -> vec3f {
    let inverse_mass = bitcast<f32>(at.z);
    if inverse_mass == 0.0 { return v[at.x].xyz; }
    var force = pushed[at.x].xyz;
    for (var slot = starts[at.x]; slot < starts[at.x + 1u]; slot++) { force += forces[slot].xyz; }
    return v[at.x].xyz * now.keep + (now.gravity * bitcast<f32>(at.w) + force * inverse_mass) * now.gain;
}

@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) lane: u32) {
    for (var s = 0u; s < now.springs; s++) {
        let spring = springs[s];
        if lane < spring.count { pushed[touched[spring.first + lane].x] = vec4f(0.0); }
    }
    for (var s = now.springs + lane; s < now.springs + now.planes; s += 64u) {
        pushed[touched[springs[s].first].x] = vec4f(0.0);
    }
    storageBarrier();
    var total = 0.0;
    for (var s = 0u; s < now.springs; s++) {
        let spring = springs[s];
        let at = touched[spring.first + lane];
        let weight = bitcast<f32>(at.y);
        let mine = lane < spring.count;
        let inverse_mass = bitcast<f32>(at.z);
        var velocity = vec3f(0.0);
        sums[lane] = vec2f(0.0);
        carried[lane] = vec4f(0.0);
        if mine {
            velocity = free_velocity(at);
            sums[lane] = weight * vec2f(dot(u[at.x].xyz, spring.normal), dot(velocity, spring.normal));
            if inverse_mass > 0.0 { carried[lane] = vec4f(velocity, 1.0) / inverse_mass; }
        }
        workgroupBarrier();
        // A tree of fixed shape: the same sum in every run.
        for (var reach = 32u; reach > 0u; reach >>= 1u) {
            if lane < reach {
                sums[lane] += sums[lane + reach];
                carried[lane] += carried[lane + reach];
            }
            workgroupBarrier();
        }
        let force = force_of(spring);
        total += force;
        if mine && spring.rest_depth + sums[0].x > 0.0 {
            var push = -spring.normal * (force * weight);
            if inverse_mass > 0.0 {
                push += (carried[0].xyz / carried[0].w - velocity) * (spring.calm / (inverse_mass * now.gain));
            }
            pushed[at.x] += vec4f(push, 0.0);
        }
        storageBarrier();
        workgroupBarrier();
    }
    var of_planes = 0.0;
    for (var s = now.springs + lane; s < now.springs + now.planes; s += 64u) {
        let plane = springs[s];
        let at = touched[plane.first];
        let depth = plane.rest_depth + dot(u[at.x].xyz, plane.normal);
        let coming = dot(free_velocity(at), plane.normal);
        let force = pressed(plane, depth, coming);
        of_planes += force;
        pushed[at.x] -= vec4f(plane.normal * force, 0.0);
    }
    sums[lane] = vec2f(of_planes, 0.0);
    workgroupBarrier();
    for (var reach = 32u; reach > 0u; reach >>= 1u) {
        if lane < reach { sums[lane] += sums[lane + reach]; }
        workgroupBarrier();
    }
    if lane == 0u { pressure[0] = total + sums[0].x; }
}
