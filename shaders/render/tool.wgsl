// Tools in closed form, and their lighting.

// Distance along the ray to a ball, or NOTHING.
fn ball(eye: vec3f, along: vec3f, centre: vec3f, radius: f32) -> f32 {
    let to = centre - eye;
    let middle = dot(to, along);
    let off = to - middle * along;
    let room = radius * radius - dot(off, off);
    let t = middle - sqrt(max(room, 0.0));
    return select(NOTHING, t, room > 0.0 && t > 0.0);
}

// Distance along the ray to a shaft's lateral surface, or NOTHING.
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

// Unit normal of a tool at a hit.
fn tool_normal(point: vec3f, tip: vec4f, tail: vec4f, met: vec3f) -> vec3f {
    let t = min(met.x, min(met.y, met.z));
    let axis = tail.xyz - tip.xyz;
    let away = point - select(tip.xyz, tail.xyz, t == met.z);
    let across = away - axis * (dot(away, axis) / max(dot(axis, axis), 1e-9));
    return normalize(select(across, away, t == met.x || t == met.z));
}

// Diffuse light from the upper left and the sky, and a highlight.
fn lit(albedo: vec3f, normal: vec3f, along: vec3f, open: f32, key: f32, gloss: f32) -> vec3f {
    let facing = max(dot(normal, scene.light.xyz), 0.0) * key;
    let sky = 0.5 + 0.5 * dot(normal, normalize(scene.up.xyz));
    let ambient = open * mix(vec3f(0.10, 0.09, 0.085), vec3f(0.25, 0.28, 0.33), sky);
    let head = 0.12 * (0.25 + 0.75 * open) * max(-dot(normal, along), 0.0);
    let halfway = normalize(scene.light.xyz - along);
    let shine = gloss * pow(max(dot(normal, halfway), 0.0), 48.0) * key * open;
    return albedo * (ambient + head + facing * vec3f(0.66, 0.63, 0.57)) + shine;
}
