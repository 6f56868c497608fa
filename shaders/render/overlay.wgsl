// Draws overlay shapes: rays meet each in closed form inside its rectangle. Parts behind the scene
// are faint.

struct Item {
    tool: ToolShape,    // or an arrow from `tip` to `tail`: radii of its stem and of its head
    colour: vec4f,
}

@group(0) @binding(1) var<storage, read> items: array<Item>;
@group(0) @binding(2) var skull_hit: texture_2d<u32>;
@group(0) @binding(3) var brain_hit: texture_2d<u32>;

const ARROW = -1.0;          // look of an arrow
const HIDDEN: f32 = 0.25;   // share of alpha behind the scene
const NEAR: f32 = 0.5;      // nearest that a box is projected, mm

struct Place {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) item: u32,
}

// The rectangle around an item's box; the whole view if the box reaches behind the eye.
@vertex fn vertex(@builtin(vertex_index) i: u32) -> Place {
    let item = items[i / 6u];
    let radius = item.tool.look.z;
    var low = vec2f(NOTHING);
    var high = vec2f(-NOTHING);
    for (var n = 0u; n < 16u; n++) {
        let sides = vec3f(vec3u(n, n >> 1u, n >> 2u) & vec3u(1u)) * 2.0 - 1.0;
        let end = select(item.tool.tip.xyz, item.tool.tail.xyz, n >= 8u);
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

fn arrow(along: vec3f, tip: vec4f, tail: vec4f) -> Surface {
    let to = tail.xyz - tip.xyz;
    let down = -normalize(to);
    let depth = min(3.0 * tail.w, 0.6 * length(to));
    let neck = vec4f(tail.xyz + depth * down, tip.w);
    let t = shaft(scene.eye.xyz, along, tip, neck);
    let across = scene.eye.xyz + t * along - tip.xyz;
    let stem = Surface(t, normalize(across - down * dot(across, down)));
    return head(along, tail.xyz, down, depth, tail.w, stem);
}

@fragment fn fragment(v: Place) -> @location(0) vec4f {
    let along = ray_of(v.clip.xy);
    let item = items[v.item];
    var met = Surface(reach(along, item.tool), vec3f(0.0));
    if item.tool.look.x == ARROW { met = arrow(along, item.tool.tip, item.tool.tail); }
    if met.t >= NOTHING { discard; }
    if item.tool.look.x != ARROW { met.normal = tool_normal(scene.eye.xyz + met.t * along, item.tool); }
    let brain = unpacked(textureLoad(brain_hit, vec2i(v.clip.xy), 0)).w;
    let skull = unpacked(textureLoad(skull_hit, vec2i(v.clip.xy), 0)).w;
    let tools = min(reach(along, scene.tools[0]), reach(along, scene.tools[1]));
    let scene_t = min(min(skull, select(NOTHING, brain, brain > 0.0)), tools);
    let alpha = item.colour.w * select(1.0, HIDDEN, met.t > scene_t);
    let colour = lit(item.colour.xyz, met.normal, along, 1.0, 1.0, 0.3);
    return vec4f(pow(clamp(colour, vec3f(0.0), vec3f(1.0)), vec3f(1.0 / 2.2)), alpha);
}
