// A quarter of every element's change of volume: what each corner's node_group gets of it.
@group(0) @binding(4) var<storage, read> quarters: array<f32>;
@group(0) @binding(5) var<storage, read_write> swollen: array<f32>;

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    let e = id.x;
    if e >= now.elements { return; }
    swollen[e] = quarters[e] * (deformation(e).j - 1.0);
}
