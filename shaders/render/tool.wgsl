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

// What a tool looks like, as in `tool.rs`; 0 is a ball on a shaft.
const BURR = 1;
const PERFORATOR = 2;
const CRANIOTOME = 3;
const SPATULA = 4;
const TUBE = 5;
const TINES = 6;
const SCALPEL = 7;

const NEAR_MM = 0.01;    // a ray that is so near has met a tool
const TOOL_STEPS = 64;
const BODY_MM = 13.0;    // length of a perforator's body with its hub
const BORE_MM = 8.0;     // depth of a tube's bore

// A direction in the tool's frame.
fn turned(v: vec3f, tool: ToolShape) -> vec3f {
    let axis = (tool.tail.xyz - tool.tip.xyz) / tool.look.w;
    return vec3f(dot(v, tool.across.xyz), dot(v, cross(axis, tool.across.xyz)), dot(v, axis));
}

fn capsule(p: vec3f, low: f32, high: f32) -> f32 { return length(vec3f(p.xy, p.z - clamp(p.z, low, high))); }

fn block(p: vec3f, half: vec3f) -> f32 {
    let away = abs(p) - half;
    return length(max(away, vec3f(0.0))) + min(max(away.x, max(away.y, away.z)), 0.0);
}

// How deep in a flute a place in the tool's frame is, 0 to 1.
fn groove(p: vec3f, tool: ToolShape) -> f32 {
    var flutes = vec2f(8.0, 3.0 / tool.tip.w);
    if i32(tool.look.x) == PERFORATOR { flutes = vec2f(3.0, 0.3); }
    if i32(tool.look.x) == CRANIOTOME { flutes = vec2f(4.0, 1.2); }
    return 0.5 - 0.5 * sin(flutes.x * (atan2(p.y, p.x) - tool.across.w) + flutes.y * p.z);
}

// Whether a place on a tool's surface is on its fluted part.
fn fluted(p: vec3f, tool: ToolShape) -> bool {
    let kind = i32(tool.look.x);
    if kind == BURR { return length(p) < 1.01 * tool.tip.w; }
    if kind == PERFORATOR { return p.z < BODY_MM; }
    return kind == CRANIOTOME && p.z < tool.look.y && capsule(p, 0.0, tool.look.y) < tool.tip.w + 0.02;
}

// At most the distance from a place in the tool's frame to the drawn surface, over 0.8; mm.
fn gap(p: vec3f, tool: ToolShape) -> f32 {
    let r = tool.tip.w;
    let s = tool.tail.w;
    let round = length(p.xy);
    let stem = capsule(p, 0.0, tool.look.w) - s;
    let cut = tool.look.y;
    switch i32(tool.look.x) {
        case BURR: { return min(length(p) - r + 0.12 * round * groove(p, tool), stem); }
        case PERFORATOR: {
            let body = max(capsule(p, 0.0, BODY_MM) - r, 0.6 * round + 0.8 * (p.z - BODY_MM));
            return min(body + 0.28 * round * groove(p, tool), stem);
        }
        case CRANIOTOME: {
            let mill = capsule(p, 0.0, cut) - r + 0.22 * round * groove(p, tool);
            let sleeve = max(round - 2.6, abs(p.z - cut - 6.0) - 5.0);
            let arm = block(p - vec3f(2.1, 0.0, 0.5 * (cut + 2.0 - r)), vec3f(0.4, 0.8, 0.5 * (cut + 2.0 + r)));
            let foot = block(p - vec3f(0.5, 0.0, 0.35 - r), vec3f(2.0, 1.0, 0.35));
            return min(min(mill, sleeve), min(min(arm, foot), stem + select(0.0, NOTHING, p.z < cut)));
        }
        case SPATULA: {
            let across = vec2f(length(vec2f(p.x, p.z - clamp(p.z, 0.0, tool.look.w))) - r, abs(p.y) - 0.5);
            return length(max(across, vec2f(0.0))) + min(max(across.x, across.y), 0.0);
        }
        case TUBE: { return max(min(length(p) - r, stem), -max(round - 0.55 * s, p.z - BORE_MM)); }
        case TINES: {
            let aside = 0.5 * s + clamp(0.1 * (p.z - 10.0), 0.0, 4.0);
            return capsule(vec3f(abs(p.x) - aside, p.yz), 0.5 * s - r, tool.look.w) - 0.5 * s - clamp(0.02 * p.z, 0.0, 0.8);
        }
        case SCALPEL: {
            let q = vec2f(p.x, p.z + r);
            let blade = max(max(dot(q, vec2f(-0.997, -0.080)), dot(q, vec2f(0.944, -0.330))), max(p.x - 2.2, p.z - 14.0));
            let handle = block(p - vec3f(0.6, 0.0, 0.5 * (tool.look.w + 13.0)), vec3f(1.6, 0.9, 0.5 * (tool.look.w - 13.0)));
            return min(max(blade, abs(p.y) - 0.2), handle);
        }
        default: { return min(length(p) - r, stem); }
    }
}

// Distance along the ray to a tool; NOTHING without one. Inside the round bound its axis is no
// farther than the bound's radius, so what is farther from the tool has left the bound.
fn reach(along: vec3f, tool: ToolShape) -> f32 {
    let eye = scene.eye.xyz;
    let far = tool.look.z;
    let tail = vec4f(tool.tail.xyz, far);
    let ends = min(ball(eye, along, tool.tip.xyz, far), ball(eye, along, tail.xyz, far));
    let bound = min(ends, shaft(eye, along, tool.tip, tail));
    if tool.tip.w < 0.0 || bound >= NOTHING { return NOTHING; }
    let start = turned(eye + bound * along - tool.tip.xyz, tool);
    let way = turned(along, tool);
    var t = 0.0;
    for (var n = 0; n < TOOL_STEPS; n++) {
        let left = gap(start + t * way, tool);
        if left < NEAR_MM { return bound + t; }
        if left > far + 0.1 { break; }
        t += 0.8 * left;
    }
    return NOTHING;
}

// Unit normal of a tool at a place on it: the slope of its distance, from four places around.
fn tool_normal(point: vec3f, tool: ToolShape) -> vec3f {
    let p = turned(point - tool.tip.xyz, tool);
    let h = vec2f(0.02, -0.02);
    let slope = h.xyy * gap(p + h.xyy, tool) + h.yyx * gap(p + h.yyx, tool) + h.yxy * gap(p + h.yxy, tool) + h.xxx * gap(p + h.xxx, tool);
    let axis = (tool.tail.xyz - tool.tip.xyz) / tool.look.w;
    return normalize(mat3x3f(tool.across.xyz, cross(axis, tool.across.xyz), axis) * slope);
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
