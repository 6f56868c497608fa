// The 3-D view: shades the nearest of bone, brain and tool at each pixel.

@group(0) @binding(7) var skull_hit: texture_2d<u32>;
@group(0) @binding(8) var brain_hit: texture_2d<u32>;
@group(0) @binding(9) var brain_rest: texture_2d<u32>;
@group(0) @binding(10) var mri: texture_3d<f32>;
@group(0) @binding(11) var bone_coat: texture_3d<f32>;    // colours over bone, alpha multiplied in
@group(0) @binding(12) var brain_coat: texture_3d<f32>;
@group(0) @binding(13) var picture: texture_storage_2d<rgba8unorm, write>;

// Fraction of the lamp's light that passes a body at distance `gap` from the beam, `way` mm away:
// the lamp is a disc.
fn pass_by(gap: f32, way: f32) -> f32 { return smoothstep(-1.0, 1.0, gap / (0.10 * way + 0.3)); }

// Fraction of light that the tools let pass to a point: 0 in their shadow, 1 far from them.
fn past_tools(point: vec3f) -> f32 {
    return past(point, scene.tools[0].tip, scene.tools[0].tail) * past(point, scene.tools[1].tip, scene.tools[1].tail);
}

fn past(point: vec3f, tip: vec4f, tail: vec4f) -> f32 {
    if tip.w < 0.0 { return 1.0; }
    let to = tip.xyz - point;
    let way = max(dot(to, scene.light.xyz), 0.0);
    let ball = pass_by(length(to - way * scene.light.xyz) - tip.w, way);
    // Nearest points of the beam and the shaft's axis (Ericson 2005, 5.1.9, with a beam that starts
    // at the point).
    let axis = tail.xyz - tip.xyz;
    let b = dot(scene.light.xyz, axis);
    let c = dot(axis, axis);
    let d = dot(scene.light.xyz, -to);
    let on_axis = clamp((dot(axis, -to) - b * d) / max(c - b * b, 1e-6), 0.0, 1.0);
    let on_beam = max(b * on_axis - d, 0.0);
    let gap = length(on_beam * scene.light.xyz - to - on_axis * axis) - tail.w;
    return ball * pass_by(gap, on_beam);
}

const DIPLOE_HU = vec2f(800.0, 1350.0);    // up to the first it is diploe, from the second on a table

fn bone_colour(point: vec3f, normal: vec3f) -> vec3f {
    let inside = hu(grid_of(point - normal * 1.2));
    let grown = mix(vec3f(0.80, 0.62, 0.50), vec3f(0.93, 0.89, 0.80), smoothstep(scene.dims.w, scene.dims.w + 500.0, inside));
    // The CT is denser than the isovalue where a tool made the surface: pale tables, red diploe.
    let here = hu(grid_of(point));
    let cut = mix(vec3f(0.58, 0.27, 0.21), vec3f(0.92, 0.85, 0.73), smoothstep(DIPLOE_HU.x, DIPLOE_HU.y, here));
    return mix(grown, cut, smoothstep(scene.dims.w + 80.0, scene.dims.w + 240.0, here));
}

// Tissue without its pia, as in the walls of a hole: grey matter is pink, white matter cream.
fn bare_colour(rest: vec3f) -> vec3f {
    let signal = windowed(textureSampleLevel(mri, linear, (scene.mri_from_world * vec4f(rest, 1.0)).xyz, 0.0));
    let flesh = mix(vec3f(0.66, 0.38, 0.34), vec3f(0.92, 0.78, 0.64), smoothstep(0.35, 0.75, signal.w));
    return tinted(flesh, signal);
}

fn brain_colour(rest: vec3f) -> vec3f {
    let at = (scene.mri_from_world * vec4f(rest, 1.0)).xyz;
    let signal = windowed(textureSampleLevel(mri, linear, at, 0.0));
    let flesh = vec3f(0.90, 0.53, 0.45);
    if scene.eye.w == 0.0 { return flesh * 0.85; }
    return tinted(flesh * (0.42 + 0.68 * smoothstep(0.05, 0.60, signal.w)), signal);
}

// Vessels of the pia over a colour, by the ways to them, of 2 mm: veins keep to the sulci, arteries
// and their branches cross the gyri.
fn vessels_over(colour: vec3f, ways: vec3f, in_sulcus: f32) -> vec3f {
    let line = 1.0 - smoothstep(vec3f(0.20, 0.10, 0.03), vec3f(0.32, 0.20, 0.08), abs(ways));
    let fine = mix(colour, vec3f(0.66, 0.20, 0.17), 0.30 * line.z);
    let red = mix(fine, vec3f(0.58, 0.09, 0.08), 0.6 * line.y);
    return mix(red, vec3f(0.27, 0.07, 0.13), 0.85 * line.x * in_sulcus);
}

const BELOW_MM = 2.0;    // below the surface, where the grey matter is

// The MRI on the cut brain, as grey as in the slices.
fn cut_colour(rest: vec3f) -> vec3f {
    let signal = windowed(textureSampleLevel(mri, linear, (scene.mri_from_world * vec4f(rest, 1.0)).xyz, 0.0));
    if scene.eye.w == 0.0 { return vec3f(0.62, 0.32, 0.29); }
    return pow(tinted(vec3f(signal.w), signal), vec3f(2.2));
}

// Blends paint over a colour, at a position in the paint's box, 0 to 1.
fn painted(colour: vec3f, at: vec3f, paint: vec4f) -> vec3f {
    let inside = all(at >= vec3f(0.0)) && all(at <= vec3f(1.0));
    return select(colour, colour * (1.0 - paint.w) + paint.xyz, inside);
}

fn painted_bone(colour: vec3f, point: vec3f) -> vec3f {
    if scene.bone_paint[0].w == 0.0 { return colour; }
    let at = (point - scene.bone_paint[0].xyz) * scene.bone_paint[1].xyz;
    return painted(colour, at, textureSampleLevel(bone_coat, linear, at, 0.0));
}

fn painted_brain(colour: vec3f, rest: vec3f) -> vec3f {
    if scene.brain_paint[0].w == 0.0 { return colour; }
    let at = (rest - scene.brain_paint[0].xyz) * scene.brain_paint[1].xyz;
    return painted(colour, at, textureSampleLevel(brain_coat, linear, at, 0.0));
}

// Wetness of bone: while the burr turns, a film of water and blood covers its surroundings.
fn wetness(point: vec3f) -> f32 {
    return scene.light.w * (1.0 - smoothstep(1.0, 7.0, distance(point, scene.tools[0].tip.xyz) - scene.tools[0].tip.w));
}

// Whether there is a grain of bone dust at a point: one cell of 0.5 mm in twelve.
fn dusty(point: vec3f) -> bool {
    let cell = vec3u(vec3i(floor(point * 2.0)));
    let mixed = (cell.x * 73856093u) ^ (cell.y * 19349663u) ^ (cell.z * 83492791u);
    return ((mixed * 2654435761u) >> 16u) % 12u == 0u;
}

fn shade_bone(point: vec3f, along: vec3f, skull: vec4f) -> vec3f {
    let normal = unfold(skull.xy);
    var colour = painted_bone(bone_colour(point, normal), point);
    let wet = wetness(point);
    if wet > 0.0 {
        colour = mix(colour, colour * vec3f(0.72, 0.48, 0.42), wet);
        if dusty(point) { colour = mix(colour, vec3f(0.95, 0.92, 0.86), 0.6 * wet); }
    }
    return lit(colour, normal, along, fract(skull.z), past_tools(point) * floor(skull.z), 0.06 + 0.4 * wet);
}

fn wave(p: vec3f) -> f32 {
    return abs(sin(p.x + 1.7 * sin(p.y) + 0.8 * sin(1.7 * p.z)));
}

// Colour of the dura: pale, with vessels that branch; by the place at rest, mm.
fn dura_colour(rest: vec3f) -> vec3f {
    let vessel = 1.0 - smoothstep(0.02, 0.10, min(wave(0.16 * rest), wave(0.29 * rest.yzx)));
    return mix(vec3f(0.80, 0.68, 0.62), vec3f(0.55, 0.22, 0.22), 0.7 * vessel);
}

// Colour of tissue under blood or burnt, and how much of it the blood covers (w).
fn stained(colour: vec3f, stain: f32) -> vec4f {
    let film = 1.0 - exp(-max(stain, 0.0) / 0.15);
    let burnt = mix(colour, vec3f(0.10, 0.07, 0.05), 0.85 * clamp(-stain, 0.0, 1.0));
    return vec4f(mix(burnt, vec3f(0.36, 0.02, 0.02), film), film);
}

fn shade_brain(point: vec3f, along: vec3f, brain: vec4f, look: vec4f, at_rest: vec4f) -> vec3f {
    let rest = at_rest.xyz;
    let normal = unfold(brain.xy);
    var key = past_tools(point);
    if look.w > 0.75 { return painted_brain(cut_colour(rest), rest) * (0.6 + 0.4 * key); }
    let g = grid_of(point);
    var open = min(2.0 * look.w, 1.0);
    key *= open;
    if scene.forward.w > 0.0 {
        open *= openness(g, normal);
        key *= select(1.0, 0.25, shadowed(g, normal, lift()));
    }
    if at_rest.w < -1.5 {
        return lit(dura_colour(rest), select(normal, -normal, dot(normal, along) > 0.0), along, open, key, 0.25);
    }
    let in_sulcus = 1.0 - smoothstep(0.65, 0.95, 2.0 * look.w);
    var flesh = vessels_over(brain_colour(rest - BELOW_MM * normal), look.xyz, in_sulcus);
    if look.w > 0.5 && scene.eye.w != 0.0 { flesh = bare_colour(rest); }
    let colour = stained(painted_brain(flesh, rest), at_rest.w);
    return lit(colour.xyz, normal, along, open, key, 0.35 + 0.15 * colour.w);
}

// Steel, dark in flutes and in a tube's bore; tines are insulated above their tips.
fn tool_colour(p: vec3f, tool: ToolShape) -> vec3f {
    let kind = i32(tool.look.x);
    if fluted(p, tool) { return mix(vec3f(0.80, 0.80, 0.78), vec3f(0.30, 0.32, 0.36), groove(p, tool)); }
    if kind == TUBE && p.z < BORE_MM && length(p.xy) < 0.56 * tool.tail.w { return vec3f(0.02); }
    return select(vec3f(0.62, 0.66, 0.72), vec3f(0.13, 0.22, 0.42), kind == TINES && p.z > 8.0);
}

fn shade_tool(point: vec3f, along: vec3f, tool: ToolShape) -> vec3f {
    let colour = tool_colour(turned(point - tool.tip.xyz, tool), tool);
    return lit(colour, tool_normal(point, tool), along, 1.0, 1.0, 0.7);
}

fn seen(at: vec2u) -> vec3f {
    let pixel = vec2f(at) + 0.5;
    let along = ray_of(pixel);
    let skull = unpacked(textureLoad(skull_hit, at, 0));
    let met = textureLoad(brain_hit, at, 0);
    var brain = unpacked(met);
    let look = unpack4x8snorm(met.z);
    brain.w = select(NOTHING, brain.w, brain.w > 0.0);
    // Where one plane cuts both, the depths are equal: bone is shown, even if the mesh reaches into
    // it.
    if look.w > 0.75 && on_cut(scene.eye.xyz + skull.w * along) { brain.w = NOTHING; }
    let near = vec2f(reach(along, scene.tools[0]), reach(along, scene.tools[1]));
    let t = min(min(skull.w, brain.w), min(near.x, near.y));
    let point = scene.eye.xyz + t * along;
    let back = pixel.y / scene.up.w;
    var colour = mix(vec3f(0.105, 0.125, 0.155), vec3f(0.035, 0.04, 0.05), back);
    if t >= NOTHING {
    } else if t == near.x {
        colour = shade_tool(point, along, scene.tools[0]);
    } else if t == near.y {
        colour = shade_tool(point, along, scene.tools[1]);
    } else if t == brain.w {
        colour = shade_brain(point, along, brain, look, unpacked(textureLoad(brain_rest, at, 0)));
    } else {
        colour = shade_bone(point, along, skull);
    }
    return pow(clamp(colour, vec3f(0.0), vec3f(1.0)), vec3f(1.0 / 2.2));
}

@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(skull_hit)) { textureStore(picture, id.xy, vec4f(seen(id.xy), 1.0)); }
}
