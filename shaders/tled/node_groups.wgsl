// Mean J - 1 of the elements of one material around a node: the sum of their shares, in the order
// of their slots, over the node_group's volume.
// Slots are loaded some at a time, since each load waits as long as many.
const AT_ONCE = 8u;
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// The element of every slot; slots lie sorted by node_group.
@group(0) @binding(2) var<storage, read> owners: array<u32>;
@group(0) @binding(3) var<storage, read> swollen: array<f32>;
@group(0) @binding(4) var<storage, read> inverse_volumes: array<f32>;
@group(0) @binding(5) var<storage, read_write> volume_change: array<f32>;

@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
    let node_group = id.x;
    if node_group >= now.node_groups { return; }
    var sum = 0.0;
    let end = starts[node_group + 1u];
    for (var slot = starts[node_group]; slot < end; slot += AT_ONCE) {
        var some: array<f32, AT_ONCE>;
        for (var i = 0u; i < AT_ONCE; i++) { some[i] = swollen[owners[min(slot + i, end - 1u)]]; }
        for (var i = 0u; i < AT_ONCE; i++) { sum += select(0.0, some[i], slot + i < end); }
    }
    volume_change[node_group] = sum * inverse_volumes[node_group];
}
