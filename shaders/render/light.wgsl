// The 3-D view: takes the nearest of bone, brain and tool at each pixel and lights it.

@group(0) @binding(5) var skull_hit: texture_2d<u32>;
@group(0) @binding(6) var brain_hit: texture_2d<u32>;
@group(0) @binding(7) var brain_rest: texture_2d<u32>;
@group(0) @binding(8) var mri: texture_3d<f32>;

@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f { return cover(i); }

// Distance along the ray to a ball, or NOTHING.
fn ball(eye: vec3f, along: vec3f, centre: vec3f, radius: f32) -> f32 {
    let to = centre - eye;
    let middle = dot(to, along);
    let off = to - middle * along;
    let room = radius * radius - dot(off, off);
    let t = middle - sqrt(max(room, 0.0));
    return select(NOTHING, t, room > 0.0 && t > 0.0);
}

// Distance along the ray to a shaft's mantle, or NOTHING.
fn shaft(eye: vec3f, along: vec3f, tip: vec4f, tail: vec4f) -> f32 {
    let axis = tail.xyz - tip.xyz;
    let away = eye - tip.xyz;
    let length2 = dot(axis, axis);
    let a = length2 - dot(axis, along) * dot(axis, along);
    let b = length2 * dot(away, along) - dot(axis, away) * dot(axis, along);
    let c = length2 * (dot(away, away) - tail.w * tail.w) - dot(axis, away) * dot(axis, away);
    let room = b * b - a * c;
    let t = (-b - sqrt(max(room, 0.0))) / max(a, 1e-9);
    let at = dot(axis, away) + t * dot(axis, along);
    return select(NOTHING, t, room > 0.0 && t > 0.0 && at > 0.0 && at < length2);
}

// Distances along the ray to a tool's ball, shaft and far end; NOTHING without a tool.
fn reach(along: vec3f, tip: vec4f, tail: vec4f) -> vec3f {
    let eye = scene.eye.xyz;
    let met = vec3f(ball(eye, along, tip.xyz, tip.w), shaft(eye, along, tip, tail), ball(eye, along, tail.xyz, tail.w));
    return select(vec3f(NOTHING), met, tip.w > 0.0);
}

// Share of the lamp that passes a body at distance `gap` from the beam, `way` mm on: the lamp is a disc.
fn pass_by(gap: f32, way: f32) -> f32 { return smoothstep(-1.0, 1.0, gap / (0.10 * way + 0.3)); }

// Light that passes the tools on its way to a point: 0 in their shadow, 1 far from them.
fn past_tools(point: vec3f) -> f32 {
    return past(point, scene.tip, scene.tail) * past(point, scene.second_tip, scene.second_tail);
}

fn past(point: vec3f, tip: vec4f, tail: vec4f) -> f32 {
    if tip.w < 0.0 { return 1.0; }
    let to = tip.xyz - point;
    let way = max(dot(to, scene.light.xyz), 0.0);
    let ball = pass_by(length(to - way * scene.light.xyz) - tip.w, way);
    // Nearest points of the beam and the shaft's axis (Ericson 2005, 5.1.9, with a beam that begins at the point).
    let axis = tail.xyz - tip.xyz;
    let b = dot(scene.light.xyz, axis);
    let c = dot(axis, axis);
    let d = dot(scene.light.xyz, -to);
    let on_axis = clamp((dot(axis, -to) - b * d) / max(c - b * b, 1e-6), 0.0, 1.0);
    let on_beam = max(b * on_axis - d, 0.0);
    let gap = length(on_beam * scene.light.xyz - to - on_axis * axis) - tail.w;
    return ball * pass_by(gap, on_beam);
}

// Diffuse light from above left and from the sky, and a highlight.
fn lit(albedo: vec3f, normal: vec3f, along: vec3f, open: f32, key: f32, gloss: f32) -> vec3f {
    let facing = max(dot(normal, scene.light.xyz), 0.0) * key;
    let sky = 0.5 + 0.5 * dot(normal, normalize(scene.up.xyz));
    let ambient = open * mix(vec3f(0.10, 0.09, 0.085), vec3f(0.25, 0.28, 0.33), sky);
    let head = 0.12 * (0.25 + 0.75 * open) * max(-dot(normal, along), 0.0);
    let halfway = normalize(scene.light.xyz - along);
    let shine = gloss * pow(max(dot(normal, halfway), 0.0), 48.0) * key * open;
    return albedo * (ambient + head + facing * vec3f(0.66, 0.63, 0.57)) + shine;
}

fn bone_colour(point: vec3f, normal: vec3f) -> vec3f {
    let inside = hu(grid_of(point - normal * 1.2));
    return mix(vec3f(0.80, 0.62, 0.50), vec3f(0.93, 0.89, 0.80), smoothstep(scene.dims.w, scene.dims.w + 500.0, inside));
}

fn brain_colour(rest: vec3f) -> vec3f {
    let at = (scene.mri_from_world * vec4f(rest, 1.0)).xyz;
    let signal = textureSampleLevel(mri, linear, at, 0.0);
    let flesh = vec3f(0.90, 0.50, 0.45);
    if scene.eye.w == 0.0 { return flesh * 0.85; }
    return tinted(flesh * (0.42 + 0.68 * smoothstep(0.05, 0.60, signal.w)), signal);
}

fn burr_colour(point: vec3f) -> vec3f {
    let axis = normalize(scene.tail.xyz - scene.tip.xyz);
    let away = point - scene.tip.xyz;
    let angle = atan2(dot(away, cross(axis, scene.spin.xyz)), dot(away, scene.spin.xyz));
    let flute = smoothstep(-0.2, 0.5, sin(8.0 * angle + 3.0 * dot(away, axis) / scene.tip.w));
    return mix(vec3f(0.34, 0.36, 0.40), vec3f(0.80, 0.80, 0.78), flute);
}

// A tool where the ray meets it at `met`; `first` may be a burr.
fn shade_tool(point: vec3f, along: vec3f, tip: vec4f, tail: vec4f, met: vec3f, first: bool) -> vec3f {
    let t = min(met.x, min(met.y, met.z));
    let axis = normalize(tail.xyz - tip.xyz);
    let away = point - select(tip.xyz, tail.xyz, t == met.z);
    let normal = normalize(select(away - axis * dot(away, axis), away, t == met.x || t == met.z));
    var colour = vec3f(0.62, 0.66, 0.72);
    if first && t == met.x && scene.spin.w > 0.5 { colour = burr_colour(point); }
    return lit(colour, normal, along, 1.0, 1.0, 0.7);
}

@fragment fn fragment(@builtin(position) pixel: vec4f) -> @location(0) vec4f {
    let along = ray_of(pixel.xy);
    let at = vec2i(pixel.xy);
    let skull = unpacked(textureLoad(skull_hit, at, 0));
    var brain = unpacked(textureLoad(brain_hit, at, 0));
    brain.w = select(NOTHING, brain.w, brain.w > 0.0);
    let first = reach(along, scene.tip, scene.tail);
    let second = reach(along, scene.second_tip, scene.second_tail);
    let near = vec2f(min(first.x, min(first.y, first.z)), min(second.x, min(second.y, second.z)));
    let t = min(min(skull.w, brain.w), min(near.x, near.y));
    let point = scene.eye.xyz + t * along;
    let back = pixel.y / scene.up.w;
    var colour = mix(vec3f(0.105, 0.125, 0.155), vec3f(0.035, 0.04, 0.05), back);
    if t >= NOTHING {
    } else if t == near.x {
        colour = shade_tool(point, along, scene.tip, scene.tail, first, true);
    } else if t == near.y {
        colour = shade_tool(point, along, scene.second_tip, scene.second_tail, second, false);
    } else if t == brain.w {
        let normal = unfold(brain.xy);
        let g = grid_of(point);
        let rest = unpacked(textureLoad(brain_rest, at, 0)).xyz - 3.5 * normal;
        var open = 1.0;
        var key = past_tools(point);
        if scene.forward.w > 0.0 {
            open = openness(g, normal);
            key *= select(1.0, 0.25, shadowed(g, normal));
        }
        colour = lit(brain_colour(rest), normal, along, open, key, 0.20);
    } else {
        let normal = unfold(skull.xy);
        colour = lit(bone_colour(point, normal), normal, along, fract(skull.z), past_tools(point) * floor(skull.z), 0.06);
    }
    return vec4f(pow(clamp(colour, vec3f(0.0), vec3f(1.0)), vec3f(1.0 / 2.2)), 1.0);
}
