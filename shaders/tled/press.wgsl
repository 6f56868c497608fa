// Forces of all springs on the nodes they touch, each implicit, one after the other, with the
// velocities v that nodes would have without the springs to come: d = d_rest + Σ w u·n    c = v̄ -
// v_tool    p = max(0, (k (d + dt c) + b c) / (1 + gain (k dt + b) Σ w²/m)) What slides across the
// normal of a pressing spring is damped, node by node. Springs of one node that no other touches
// follow side by side, then planes, no two of the same node; they damp sliding by how deep it is.
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
@group(0) @binding(1) var<storage, read_write> springs: array<Spring>;
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

const LANES = 256u;
// Nodes of a spring at most.
const NODES = 64u;
var<workgroup> sums: array<vec3f, LANES>;

// Force of a spring that is so deep, mm, on nodes that come at this speed, mm/ms.
fn pressed(spring: Spring, depth: f32, coming: f32, compliance: f32, touches: bool) -> f32 {
    let held = 1.0 + now.gain * (spring.stiffness * now.dt + spring.damping) * compliance;
    let closing = coming - spring.tool_velocity;
    let force = (spring.stiffness * (depth + now.dt * closing) + spring.damping * closing) / held;
    let finite = (bitcast<u32>(force) & 0x7f800000u) != 0x7f800000u;
    return select(0.0, max(force, 0.0), touches && finite);
}

// Velocity that a node would have after the step under its elements, weight, and the springs so
// far.
fn free_velocity(at: vec4u) -> vec3f {
    let inverse_mass = bitcast<f32>(at.z);
    if inverse_mass == 0.0 { return v[at.x].xyz; }
    let force = pushed[at.x].xyz + gathered(at.x).force;
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

// Adds a pressing spring's force to what pushes one of its nodes.
fn push(spring: Spring, force: f32, at: vec4u, velocity: vec3f) {
    let weight = bitcast<f32>(at.y);
    let slip = velocity - spring.lateral_velocity;
    let sliding = slip - spring.normal * dot(slip, spring.normal);
    let damping = weight * spring.lateral_damping;
    let brake = damping / (1.0 + now.gain * bitcast<f32>(at.z) * damping);
    pushed[at.x] += vec4f(-spring.normal * (force * weight) - sliding * brake, 0.0);
}

// Sums over the first lanes by a tree of fixed shape: the same in every run.
fn add_up(lane: u32, lanes: u32) {
    workgroupBarrier();
    for (var reach = lanes / 2u; reach > 0u; reach >>= 1u) {
        if lane < reach { sums[lane] += sums[lane + reach]; }
        workgroupBarrier();
    }
}

@compute @workgroup_size(LANES) fn main(@builtin(local_invocation_index) lane: u32) {
    for (var n = lane; n < now.touched; n += LANES) { pushed[touched[n].x] = vec4f(0.0); }
    storageBarrier();
    var total = 0.0;
    for (var s = 0u; s < now.springs; s++) {
        let spring = springs[s];
        let at = touched[spring.first + min(lane, NODES - 1u)];
        let weight = bitcast<f32>(at.y);
        let mine = lane < spring.count;
        var velocity = vec3f(0.0);
        sums[lane] = vec3f(0.0);
        if mine {
            velocity = free_velocity(at);
            let along = vec2f(dot(u[at.x].xyz, spring.normal), dot(velocity, spring.normal));
            sums[lane] = weight * vec3f(along, weight * moved_by_force(at));
        }
        add_up(lane, NODES);
        let depth = spring.rest_depth + sums[0].x;
        let force = pressed(spring, depth, sums[0].y, sums[0].z, depth > 0.0);
        total += force;
        if mine && depth > 0.0 { push(spring, force, at, velocity); }
        storageBarrier();
        workgroupBarrier();
    }
    var beside = 0.0;
    let singles_end = now.springs + now.singles;
    for (var s = now.springs + lane; s < singles_end; s += LANES) {
        let spring = springs[s];
        let at = touched[spring.first];
        let weight = bitcast<f32>(at.y);
        let velocity = free_velocity(at);
        let depth = spring.rest_depth + weight * dot(u[at.x].xyz, spring.normal);
        let coming = weight * dot(velocity, spring.normal);
        let force = pressed(spring, depth, coming, weight * weight * moved_by_force(at), depth > 0.0);
        beside += force;
        if depth > 0.0 { push(spring, force, at, velocity); }
    }
    storageBarrier();
    workgroupBarrier();
    for (var s = singles_end + lane; s < singles_end + now.planes; s += LANES) {
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
        beside += force;
        let braking = plane.damping * clamp(depth / SLIDING_FULL_MM, 0.0, 1.0);
        let brake = braking / (1.0 + now.gain * bitcast<f32>(at.z) * braking);
        pushed[at.x] -= vec4f(plane.normal * force + (velocity - plane.normal * coming) * brake, 0.0);
    }
    sums[lane] = vec3f(beside, 0.0, 0.0);
    add_up(lane, LANES);
    if lane == 0u { pressure[0] = total + sums[0].x; }
    // The tools go on to the next step.
    for (var s = lane; s < singles_end; s += LANES) { springs[s].rest_depth -= now.dt * springs[s].tool_velocity; }
}
