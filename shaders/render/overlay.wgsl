// Draws overlay shapes: rays meet each in closed form inside its rectangle. Parts behind the scene
// are faint.

struct Item {
    tip: vec4f,      // a tool's ball, or an arrow's begin; w: radius
    tail: vec4f,     // the shaft's far end, or an arrow's point; w: radius of the shaft, or of the arrow's head
    colour: vec4f,
    kind: vec4f,     // x: 1 for an arrow, 0 for a tool
}

@group(0) @binding(1) var<storage, read> items: array<Item>;
@group(0) @binding(2) var skull_hit: texture_2d<u32>;
@group(0) @binding(3) var brain_hit: texture_2d<u32>;

const HIDDEN: f32 = 0.25;   // share of alpha behind the scene
const NEAR: f32 = 0.5;      // nearest that a box is projected, mm

struct Place {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) item: u32,
}

// The rectangle around an item's box; the whole view if the box reaches behind the eye.
@vertex fn vertex(@builtin(vertex_index) i: u32) -> Place {
    let item = items[i / 6u];
    let radius = max(abs(item.tip.w), abs(item.tail.w));
    var low = vec2f(NOTHING);
    var high = vec2f(-NOTHING);
    for (var n = 0u; n < 16u; n++) {
        let sides = vec3f(vec3u(n, n >> 1u, n >> 2u) & vec3u(1u)) * 2.0 - 1.0;
        let end = select(item.tip.xyz, item.tail.xyz, n >= 8u);
        let clip = scene.clip_from_world * vec4f(end + radius * sides, 1.0);
        if clip.w < NEAR {
            low = vec2f(-1.0);
            high = vec2f(1.0);
            break;
        }
        low = min(low, clip.xy / clip.w);
        high = max(high, clip.xy / clip.w);
    }
    let corners = array<vec2f, 6>(low, vec2f(high.x, low.y), high, low, high, vec2f(low.x, high.y));
    return Place(vec4f(corners[i % 6u], 0.0, 1.0), i / 6u);
}

struct Surface { t: f32, normal: vec3f }

// The nearer of a given surface and an arrow's head: a cone around `down` from its apex, with
// height `depth` and base radius `radius`.
fn head(along: vec3f, apex: vec3f, down: vec3f, depth: f32, radius: f32, other: Surface) -> Surface {
    var nearest = other;
    let away = scene.eye.xyz - apex;
    let slope = depth * depth / (depth * depth + radius * radius);
    let d = dot(along, down);
    let o = dot(away, down);
    let a = d * d - slope;
    let b = d * o - slope * dot(along, away);
    let c = o * o - slope * dot(away, away);
    let room = b * b - a * c;
    for (var side = -1.0; side < 2.0; side += 2.0) {
        let t = (-b + side * sqrt(max(room, 0.0))) / a;
        let deep = o + t * d;
        if room > 0.0 && t > 0.0 && t < nearest.t && deep > 0.0 && deep < depth {
            nearest = Surface(t, normalize(slope * (away + t * along) - deep * down));
        }
    }
    let t = (depth - o) / d;
    let flat = away + t * along - depth * down;
    if t > 0.0 && t < nearest.t && dot(flat, flat) < radius * radius { nearest = Surface(t, down); }
    return nearest;
}

fn arrow(along: vec3f, item: Item) -> Surface {
    let to = item.tail.xyz - item.tip.xyz;
    let down = -normalize(to);
    let depth = min(3.0 * item.tail.w, 0.6 * length(to));
    let neck = vec4f(item.tail.xyz + depth * down, item.tip.w);
    let t = shaft(scene.eye.xyz, along, item.tip, neck);
    let across = scene.eye.xyz + t * along - item.tip.xyz;
    let stem = Surface(t, normalize(across - down * dot(across, down)));
    return head(along, item.tail.xyz, down, depth, item.tail.w, stem);
}

fn tool(along: vec3f, item: Item) -> Surface {
    let met = reach(along, item.tip, item.tail);
    let t = min(met.x, min(met.y, met.z));
    return Surface(t, tool_normal(scene.eye.xyz + t * along, item.tip, item.tail, met));
}

@fragment fn fragment(v: Place) -> @location(0) vec4f {
    let along = ray_of(v.clip.xy);
    let item = items[v.item];
    var met = Surface(NOTHING, vec3f(0.0));
    if item.kind.x > 0.5 { met = arrow(along, item); } else { met = tool(along, item); }
    if met.t >= NOTHING { discard; }
    let brain = unpacked(textureLoad(brain_hit, vec2i(v.clip.xy), 0)).w;
    let skull = unpacked(textureLoad(skull_hit, vec2i(v.clip.xy), 0)).w;
    let first = reach(along, scene.tip, scene.tail);
    let second = reach(along, scene.second_tip, scene.second_tail);
    let tools = min(min(first.x, min(first.y, first.z)), min(second.x, min(second.y, second.z)));
    let scene_t = min(min(skull, select(NOTHING, brain, brain > 0.0)), tools);
    let alpha = item.colour.w * select(1.0, HIDDEN, met.t > scene_t);
    let colour = lit(item.colour.xyz, met.normal, along, 1.0, 1.0, 0.3);
    return vec4f(pow(clamp(colour, vec3f(0.0), vec3f(1.0)), vec3f(1.0 / 2.2)), alpha);
}
