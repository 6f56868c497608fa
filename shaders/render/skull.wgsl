// The bone's isosurface at every pixel. Output: octahedral normal (xy), ambient light fraction,
// plus 1 if lit by the lamp (z), distance along the ray in mm (w).

@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return cover(i); }

// Differences between the corners of a cube of 3.2 voxels: smooths the steps of thick slices and of
// drilled voxels.
fn outward_normal(g: vec3f, along: vec3f) -> vec3f {
    var gradient = vec3f(0.0);
    for (var i = 0u; i < 8u; i++) {
        let corner = vec3f(vec3u(i, i >> 1u, i >> 2u) & vec3u(1u)) * 2.0 - 1.0;
        gradient += corner * hu(g + 1.6 * corner);
    }
    return select(-normalize(gradient), -along, dot(gradient, gradient) < 1e-6);
}

@fragment fn fragment(@builtin(position) pixel: vec4f) -> @location(0) vec4u {
    let along = ray_of(pixel.xy);
    let o = grid_of(scene.eye.xyz);
    let d = along / scene.origin.w;
    let t = meet(o, d, NOTHING);
    if t >= NOTHING { return packed(vec4f(0.0, 0.0, 1.0, NOTHING)); }
    let g = o + d * t;
    let normal = select(outward_normal(g, along), scene.bone_cut.xyz, on_cut(scene.eye.xyz + t * along));
    let facing = dot(normal, scene.light.xyz) > 0.0 && !shadowed(g, normal);
    return packed(vec4f(fold(normal), 0.999 * openness(g, normal) + select(0.0, 1.0, facing), t));
}
