// What every pass of a TLED step knows. Forces in N, lengths in mm, times in ms.
struct Step {
    gravity: vec3f,
    dt: f32,
    // What multiplies velocity and acceleration.
    keep: f32,
    gain: f32,
    max_speed: f32,
    max_displacement: f32,
    // Springs on the tissue that share nodes.
    springs: u32,
    elements: u32,
    nodes: u32,
    node_groups: u32,
    // What the three terms of past stress keep and take up; the fourth number is unused.
    fade_keep: vec4f,
    fade_gain: vec4f,
    // Planes, behind all springs in their list.
    planes: u32,
    // Fluid around the body: pressure in an opening, MPa; unit vector against gravity, height of
    // the level along it, acceleration of what lies above.
    opening: f32,
    // Springs of one node that no other spring touches, behind the others and before the planes;
    // entries of the list of touched nodes.
    singles: u32,
    touched: u32,
    up: vec3f,
    level: f32,
    weight: vec3f,
}
@group(0) @binding(0) var<uniform> now: Step;
