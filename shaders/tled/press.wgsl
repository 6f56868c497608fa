// Forces of all springs on the nodes they touch, each implicit, one after the other, with the
// velocities v that nodes would have without the springs to come: d = d_rest + Σ w u·n    p =
// max(0, (k (d + dt v̄) + b (v̄ - v_tool)) / (1 + gain (k dt + b) Σ w²/m)) What slides across the
// normal of a pressing spring is damped, node by node. Planes, springs of one node each and no two
// of the same, follow side by side; they damp sliding by how deep their node is.
// Depth from which sliding along a plane is damped as strongly as the normal velocity.
const SLIDING_FULL_MM = 0.2;

struct Spring {
    // Unit vector out of the tissue.
    normal: vec3f,
    stiffness: f32,
    damping: f32,
    rest_depth: f32,
    tool_velocity: f32,
    unused: f32,
    // To what sliding is damped, mm/ms, and how strongly, N ms/mm.
    lateral_velocity: vec3f,
    lateral_damping: f32,
    // Of `touched`, up to 64 nodes, each at most once.
    first: u32,
    count: u32,
}
@group(0) @binding(1) var<storage, read> springs: array<Spring>;
// Of every node of every spring: place; bits of the weight, of 1/m, of the share of m that has
// weight.
@group(0) @binding(2) var<storage, read> touched: array<vec4u>;
@group(0) @binding(3) var<storage, read> u: array<vec4f>;
@group(0) @binding(4) var<storage, read> v: array<vec4f>;
// The elements' forces: where a place's run of slots begins, and the slots.
@group(0) @binding(5) var<storage, read> starts: array<u32>;
@group(0) @binding(6) var<storage, read> forces: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> pushed: array<vec4f>;
// Of all springs, summed, N.
@group(0) @binding(8) var<storage, read_write> pressure: array<f32>;
@group(0) @binding(9) var<storage, read> anchors: array<Anchor>;

var<workgroup> sums: array<vec3f, 64>;

// Force of a spring that is so deep, mm, on nodes that come at this speed, mm/ms.
fn pressed(spring: Spring, depth: f32, coming: f32, compliance: f32, touches: bool) -> f32 {
    let held = 1.0 + now.gain * (spring.stiffness * now.dt + spring.damping) * compliance;
    let force = (spring.stiffness * (depth + now.dt * coming) + spring.damping * (coming - spring.tool_velocity)) / held;
    let finite = (bitcast<u32>(force) & 0x7f800000u) != 0x7f800000u;
    return select(0.0, max(force, 0.0), touches && finite);
}

// Velocity that a node would have after the step under its elements, weight, and the springs so
// far.
fn free_velocity(at: vec4u) -> vec3f {
    let inverse_mass = bitcast<f32>(at.z);
    if inverse_mass == 0.0 { return v[at.x].xyz; }
    var force = pushed[at.x].xyz;
    for (var slot = starts[at.x]; slot < starts[at.x + 1u]; slot++) { force += forces[slot].xyz; }
    let moved = u[at.x].xyz;
    let pull = weight_at(at.x, moved) * bitcast<f32>(at.w) + force * inverse_mass;
    return anchored(at.x, moved, v[at.x].xyz * now.keep + pull * now.gain, inverse_mass * now.gain);
}

// 1/m of a node, less where an anchor holds it.
fn moved_by_force(at: vec4u) -> f32 {
    let inverse_mass = bitcast<f32>(at.z);
    let anchor = anchors[at.x];
    let held = anchor.along * (1.0 - anchor.in_fluid * dryness(anchor.rest + u[at.x].xyz));
    return inverse_mass / (1.0 + held * inverse_mass * now.gain * now.dt);
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
        sums[lane] = vec3f(0.0);
        if mine {
            velocity = free_velocity(at);
            let along = vec2f(dot(u[at.x].xyz, spring.normal), dot(velocity, spring.normal));
            sums[lane] = weight * vec3f(along, weight * moved_by_force(at));
        }
        workgroupBarrier();
        // A tree of fixed shape: the same sum in every run.
        for (var reach = 32u; reach > 0u; reach >>= 1u) {
            if lane < reach { sums[lane] += sums[lane + reach]; }
            workgroupBarrier();
        }
        let depth = spring.rest_depth + sums[0].x;
        let force = pressed(spring, depth, sums[0].y, sums[0].z, depth > 0.0);
        total += force;
        if mine && depth > 0.0 {
            let slip = velocity - spring.lateral_velocity;
            let sliding = slip - spring.normal * dot(slip, spring.normal);
            let damping = weight * spring.lateral_damping;
            let push = -spring.normal * (force * weight) - sliding * (damping / (1.0 + now.gain * inverse_mass * damping));
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
        let velocity = free_velocity(at);
        let coming = dot(velocity, plane.normal);
        // A plane acts from the moment that its node reaches it, within the step.
        let ahead = depth + now.dt * coming;
        var reached = plane;
        if depth <= 0.0 { reached.damping *= ahead / (now.dt * coming); }
        let force = pressed(reached, depth, coming, moved_by_force(at), depth > 0.0 || ahead > 0.0);
        of_planes += force;
        let braking = plane.damping * clamp(depth / SLIDING_FULL_MM, 0.0, 1.0);
        let brake = braking / (1.0 + now.gain * bitcast<f32>(at.z) * braking);
        pushed[at.x] -= vec4f(plane.normal * force + (velocity - plane.normal * coming) * brake, 0.0);
    }
    sums[lane] = vec3f(of_planes, 0.0, 0.0);
    workgroupBarrier();
    for (var reach = 32u; reach > 0u; reach >>= 1u) {
        if lane < reach { sums[lane] += sums[lane + reach]; }
        workgroupBarrier();
    }
    if lane == 0u { pressure[0] = total + sums[0].x; }
}
