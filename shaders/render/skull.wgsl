// The bone's isosurface at every pixel. Output: octahedral normal (xy), ambient light fraction,
// plus 1 if lit by the lamp (z), distance along the ray in mm (w).

// A surface: its unit normal, outwards, and the height over it at which shadow rays start, voxels.
struct Surface { normal: vec3f, lift: f32 }

@group(0) @binding(7) var smooth_ct: texture_3d<f32>;   // the CT behind a Gaussian, on a coarser lattice
@group(0) @binding(8) var<uniform> part: vec4u;        // pixels to cast: the upper left one, width, height
@group(0) @binding(9) var hits: texture_storage_2d<rgba32uint, write>;

const REACH_MM: f32 = 0.5;   // from the middle to the corners of the cube whose differences are the gradient

// The smoothed CT at continuous padded grid coordinates, HU.
fn smoothed(g: vec3f) -> f32 {
    let at = (g / scene.steps.y + 0.5) / vec3f(textureDimensions(smooth_ct));
    return textureSampleLevel(smooth_ct, linear, at, 0.0).x;
}

// The surface of the CT or of the cut, whichever is nearer. That of the CT by differences between
// the corners of a cube in the smoothed CT, towards the eye: a wall thinner than the Gaussian may
// show its far side's.
fn surface(g: vec3f, along: vec3f) -> Surface {
    let reach = max(0.5, REACH_MM / scene.origin.w);
    var gradient = vec3f(0.0);
    for (var i = 0u; i < 8u; i++) {
        let corner = vec3f(vec3u(i, i >> 1u, i >> 2u) & vec3u(1u)) * 2.0 - 1.0;
        gradient += corner * smoothed(g + reach * corner);
    }
    var normal = -along;
    if dot(gradient, gradient) >= 1e-6 {
        normal = -normalize(gradient);
        normal -= 2.0 * max(dot(normal, along), 0.0) * along;
    }
    let scanned = Surface(normal, lift());
    let depth = drilled(g);
    if depth == FAR { return scanned; }
    // Eight differences over the cube, two of which go by each edge.
    let slope = length(gradient) / (8.0 * reach);
    let node = 2.0 / scene.steps.x;
    if abs(depth) * node * slope > abs(hu(g) - scene.dims.w) { return scanned; }
    let h = vec2f(0.5 * node, 0.0);
    let rise = vec3f(drilled(g + h.xyy) - drilled(g - h.xyy), drilled(g + h.yxy) - drilled(g - h.yxy),
                     drilled(g + h.yyx) - drilled(g - h.yyx));
    if dot(rise, rise) < 1e-12 { return scanned; }
    return Surface(normalize(rise), 0.2 * node);
}

fn hit(along: vec3f) -> vec4f {
    let o = grid_of(scene.eye.xyz);
    let d = along / scene.origin.w;
    let t = meet(o, d, NOTHING);
    if t >= NOTHING { return vec4f(0.0, 0.0, 1.0, NOTHING); }
    let g = o + d * t;
    var met = Surface(scene.bone_cut.xyz, lift());
    if !on_cut(scene.eye.xyz + t * along) { met = surface(g, along); }
    let normal = met.normal;
    let facing = dot(normal, scene.light.xyz) > 0.0 && !shadowed(g, normal, met.lift);
    return vec4f(fold(normal), 0.999 * openness(g, normal) + select(0.0, 1.0, facing), t);
}

@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= part.zw) { return; }
    let at = part.xy + id.xy;
    textureStore(hits, at, packed(hit(ray_of(vec2f(at) + 0.5))));
}
