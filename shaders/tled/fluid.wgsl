// Weight above the level of a fluid, and anchors. s = clamp((x·up - level)/4 mm + 1/2, 0, 1)
// a = g + s weight    f = -(1 - s share) (k_along (u·n) n + k_across (u - (u·n) n)) + p A n, by
// backward Euler. The pass declares `anchors`.
const LEVEL_BAND_MM = 4.0;

struct Anchor {
    // Place at rest, mm.
    rest: vec3f,
    along: f32,
    normal: vec3f,
    across: f32,
    // Share of the stiffness that holds only below the level.
    in_fluid: f32,
    // Area in an opening, mm2.
    open: f32,
}

fn dryness(place: vec3f) -> f32 {
    return clamp((dot(place, now.up) - now.level) / LEVEL_BAND_MM + 0.5, 0.0, 1.0);
}

// Acceleration of a node that has moved by u.
fn weight_at(n: u32, u: vec3f) -> vec3f {
    return now.gravity + now.weight * dryness(anchors[n].rest + u);
}

// What the anchor of a node makes of its velocity; a force gives the node a velocity of `gain`.
fn anchored(n: u32, u: vec3f, velocity: vec3f, gain: f32) -> vec3f {
    let anchor = anchors[n];
    if anchor.along + anchor.across + anchor.open == 0.0 { return velocity; }
    let held = 1.0 - anchor.in_fluid * dryness(anchor.rest + u);
    let pushed_out = velocity + anchor.normal * (anchor.open * now.opening * gain);
    let reached = u + pushed_out * now.dt;
    let out = anchor.normal * dot(reached, anchor.normal);
    let along = held * anchor.along * gain;
    let across = held * anchor.across * gain;
    return pushed_out - out * (along / (1.0 + along * now.dt)) - (reached - out) * (across / (1.0 + across * now.dt));
}
