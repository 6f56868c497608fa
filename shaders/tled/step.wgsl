// What every pass of a TLED step knows. Forces in N, lengths in mm, times in ms.
struct Step {
    gravity: vec3f,
    dt: f32,
    // Unit vector out of the tissue, and what multiplies velocity and acceleration.
    normal: vec3f,
    keep: f32,
    gain: f32,
    max_speed: f32,
    max_displacement: f32,
    // The tool's spring, already scaled to what is stable.
    stiffness: f32,
    damping: f32,
    rest_depth: f32,
    tool_velocity: f32,
    pressed: u32,
    elements: u32,
    nodes: u32,
}
@group(0) @binding(0) var<uniform> now: Step;
