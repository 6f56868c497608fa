//! The operations at a site, as moves that share the total time.

use super::ScriptError;
use super::path::Path;
use trepan_geometry::{Buttons, Quat, ToolKind, Vec3};

/// Where to operate.
///
/// ```text
///      tool ↓ inward
///   ────────●──────── entry: outer surface of the bone
///   ▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒ bone_mm thick
///   ─────────────────
///        gap
///   ~~~~~~~~~~~~~~~~~ brain_mm below the entry
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Point on the outer surface of the bone, world mm.
    pub entry: Vec3,
    /// Unit direction into the head.
    pub inward: Vec3,
    /// Thickness of the bone along `inward`, mm.
    pub bone_mm: f32,
    /// Depth of the brain's surface below `entry` along `inward`, mm.
    pub brain_mm: f32,
}

impl Site {
    pub(super) fn check(&self) -> Result<(), ScriptError> {
        let wrong = |field, value: String, wanted| Err(ScriptError::Site { field, value, wanted });
        if !self.entry.is_finite() {
            return wrong("entry", self.entry.to_string(), "a finite point");
        }
        if !(0.999..=1.001).contains(&self.inward.length()) {
            return wrong("inward", self.inward.to_string(), "a direction of length 1");
        }
        if !(0.0..=50.0).contains(&self.bone_mm) {
            return wrong("bone_mm", self.bone_mm.to_string(), "from 0 to 50 mm");
        }
        if !(0.0..=100.0).contains(&self.brain_mm) {
            return wrong("brain_mm", self.brain_mm.to_string(), "from 0 to 100 mm");
        }
        Ok(())
    }

    /// The point `depth_mm` below the entry.
    fn below(&self, depth_mm: f32) -> Vec3 {
        self.entry + self.inward * depth_mm
    }
}

/// A point of a bone flap's outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rim {
    /// On the outer surface of the bone, world mm.
    pub outer: Vec3,
    /// Thickness of the bone there along [`Site::inward`], mm.
    pub bone_mm: f32,
}

/// A ball of tissue to resect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Its centre, world mm.
    pub centre: Vec3,
    /// Its radius, mm.
    pub radius_mm: f32,
    /// How far it sinks along the way in once the dura is open, mm.
    pub sinks_mm: f32,
}

/// Tool sizes and path lengths of an operation.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Radius of the burr's ball, mm.
    pub burr_radius_mm: f32,
    /// Radius of the probe's ball, mm.
    pub probe_radius_mm: f32,
    /// Where a tool starts its approach, mm outside the bone.
    pub start_mm: f32,
    /// Where a tool is changed, mm outside the bone.
    pub away_mm: f32,
    /// How far past the inner side of the bone the burr's centre goes if there is room, mm.
    pub breakthrough_mm: f32,
    /// How far behind the hand a burr stays that has cut its way, mm: it only rubs under a least
    /// force.
    pub burr_lag_mm: f32,
    /// Distance of the burr's foremost point from the brain if there is room, mm.
    pub burr_clearance_mm: f32,
    /// Largest depth of the burr's foremost point in the brain, mm, to make a hole wide enough for
    /// the probe.
    pub burr_overlap_mm: f32,
    /// Radius of the aspirator's tip, mm.
    pub aspirator_radius_mm: f32,
    /// How deep each press of the probe goes into the brain, mm.
    pub presses_mm: [f32; 3],
    /// Radius of the spatula's end, mm.
    pub spatula_radius_mm: f32,
    /// How deep the spatula goes into the brain, and how far it then draws it aside, mm.
    pub retract_mm: [f32; 2],
    /// Closed outline of the flap that the craniotome follows; empty for a circle of 10 mm on flat
    /// bone.
    pub outline: Vec<Rim>,
    /// Depth of the centre of the craniotome's foot below the bone, mm.
    pub foot_mm: f32,
    /// Whether the bone is open from the start.
    pub is_open: bool,
    /// Whether a flap's operation goes on to the brain.
    pub presses_after_flap: bool,
    /// Lines along which the dura is incised before a resection, world mm; none where it is open.
    pub incisions: Vec<Vec<Vec3>>,
    /// What is resected; `None` for a small ball of brain below the entry.
    pub target: Option<Target>,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            burr_radius_mm: 3.0,
            probe_radius_mm: 2.0,
            start_mm: 35.0,
            away_mm: 40.0,
            breakthrough_mm: 0.75,
            burr_lag_mm: 0.5,
            burr_clearance_mm: 0.3,
            burr_overlap_mm: 0.8,
            aspirator_radius_mm: 1.5,
            presses_mm: [4.0, 5.0, 6.0],
            spatula_radius_mm: 3.0,
            retract_mm: [3.0, 4.0],
            outline: Vec::new(),
            foot_mm: 0.8,
            is_open: false,
            presses_after_flap: true,
            incisions: Vec::new(),
            target: None,
        }
    }
}

impl Plan {
    /// An operation that ends at the bone: no tool comes to the brain, and no probe needs room.
    pub fn of_bone() -> Self {
        let usual = Self::default();
        Self { burr_overlap_mm: -usual.burr_clearance_mm, presses_after_flap: false, ..usual }
    }
}

impl Plan {
    /// Final depth of the hand that holds the burr below the entry, mm.
    ///
    /// The burr's centre lags behind the hand. It goes `breakthrough_mm` past the bone. If the
    /// brain is nearer, it stops before the brain. If the hole at the bone's inner side would then
    /// be too narrow for the probe, it continues into the brain, at most by the overlap.
    pub fn burr_depth_mm(&self, site: &Site) -> f32 {
        const ROOM_MM: f32 = 0.5;
        let wanted = site.bone_mm + self.breakthrough_mm;
        let clear_of_brain = site.brain_mm - self.burr_clearance_mm - self.burr_radius_mm;
        let (burr, hole) = (self.burr_radius_mm, self.probe_radius_mm + ROOM_MM);
        let wide_enough = site.bone_mm - (burr * burr - hole * hole).max(0.0).sqrt();
        let deepest = site.brain_mm + self.burr_overlap_mm - self.burr_radius_mm;
        wanted.min(clear_of_brain.max(wide_enough)).min(deepest) + self.burr_lag_mm
    }
}

/// One move: share of the total time, where the tip ends, pressed buttons.
struct Move(&'static str, f64, Vec3, Buttons);

const HANDS_OFF: Buttons = Buttons(0);

/// The path of an operation listed in [`super::NAMES`].
pub(super) fn path(name: &str, site: &Site, plan: &Plan, duration_ms: f64) -> Path {
    let upright = Quat::from_rotation_arc(Vec3::Z, -site.inward.normalize());
    let start = site.below(-plan.start_mm);
    let (start, rotation, moves) = match name {
        "aspirate" => aspirate(site, plan),
        "suck" => (start, upright, suck(site, plan)),
        "arm" => (start, upright, arm(site, plan)),
        "flap" => {
            let (start, moves) = flap(site, plan);
            (start, upright, moves)
        }
        "resect" | "bleed" => {
            let (start, moves) = opened(site, plan);
            let small = Target { centre: site.below(site.brain_mm + 1.5), radius_mm: 3.5, sinks_mm: 0.0 };
            let plan = &Plan { target: if name == "bleed" { Some(small) } else { plan.target }, ..plan.clone() };
            let at_brain = incise(site, plan).into_iter().chain(resect(site, plan)).chain(coagulate(site, plan));
            (start, upright, moves.into_iter().chain(at_brain.filter(|_| plan.presses_after_flap)).collect())
        }
        "craniotomy" => (start, upright, craniotomy(site, plan)),
        "probe" => (start, upright, probe(site, plan)),
        "press" => (start, upright, press(site, plan)),
        "retract" => (start, upright, retract(site, plan)),
        "cut" => (start, upright, cut(site, plan, upright * Vec3::X)),
        _ => {
            let moves = [craniotomy(site, plan), change(site, plan), probe(site, plan)];
            (start, upright, moves.into_iter().flatten().collect())
        }
    };
    let whole: f64 = moves.iter().map(|m| m.1).sum();
    let mut path = Path::from(start, rotation);
    for Move(label, share, tip, buttons) in moves {
        if matches!(
            buttons.taken(),
            Some(ToolKind::Aspirator | ToolKind::Bipolar | ToolKind::Scalpel | ToolKind::Scissors)
        ) {
            path.through(site.entry);
        }
        path.to(label, duration_ms * share / whole, tip, buttons);
    }
    path.end_at(duration_ms);
    path
}

/// Bone that the usual share of the time is enough for, mm; thicker bone gets more.
const USUAL_BONE_MM: f32 = 7.0;

impl Site {
    /// Time for drilling here relative to bone of up to 7 mm.
    pub fn drilling_share(&self) -> f64 {
        f64::from((self.bone_mm / USUAL_BONE_MM).max(1.0))
    }
}

fn craniotomy(site: &Site, plan: &Plan) -> Vec<Move> {
    let deepest = site.below(plan.burr_depth_mm(site));
    vec![
        Move("approach with the burr", 8.0, site.below(-plan.burr_radius_mm - 1.0), HANDS_OFF),
        Move("drill", 43.0 * site.drilling_share(), deepest, Buttons::PEDAL),
        Move("clean the hole", 7.0, deepest, Buttons::PEDAL),
        Move("retreat", 7.0, site.below(-plan.away_mm), HANDS_OFF),
    ]
}

/// The aspirator beside the burr, its shaft tilted away: rests on the bone, moves to the hole,
/// lifts off and leaves.
fn aspirate(site: &Site, plan: &Plan) -> (Vec3, Quat, Vec<Move>) {
    const LEAN_RAD: f32 = 0.5;
    let outward = -site.inward.normalize();
    let side = -outward.cross(Vec3::Z).try_normalize().unwrap_or(outward.any_orthonormal_vector());
    let (near_mm, over_mm) = (plan.burr_radius_mm + plan.aspirator_radius_mm + 3.0, -plan.aspirator_radius_mm);
    let rotation = Quat::from_rotation_arc(Vec3::Z, (outward + LEAN_RAD * side).normalize());
    let at = |aside_mm: f32, depth_mm: f32| site.below(depth_mm) + aside_mm * side;
    let moves = [
        ("approach with the aspirator", 15.0, at(near_mm + 4.0, over_mm - 1.0)),
        ("touch the bone", 5.0, at(near_mm + 4.0, over_mm + 0.5)),
        ("follow the burr", 20.0, at(near_mm, over_mm + 0.5)),
        ("rest on the bone", 30.0, at(near_mm, over_mm + 0.5)),
        ("lift", 5.0, at(near_mm, over_mm - 2.0)),
        ("leave", 25.0, at(near_mm + 30.0, -plan.away_mm)),
    ];
    let moves = moves.map(|(label, share, tip)| Move(label, share, tip, HANDS_OFF));
    (at(near_mm + 30.0, -plan.start_mm), rotation, moves.into())
}

/// Drills a burr hole at the rim, cuts around the flap with the craniotome, lifts it, and presses
/// the brain in the middle.
fn flap(site: &Site, plan: &Plan) -> (Vec3, Vec<Move>) {
    let outline = if plan.outline.is_empty() { circle(site) } else { plan.outline.clone() };
    let gap_mm = site.brain_mm - site.bone_mm;
    let hole =
        Site { entry: outline[0].outer, bone_mm: outline[0].bone_mm, brain_mm: outline[0].bone_mm + gap_mm, ..*site };
    let foot = |rim: &Rim| rim.outer + site.inward * (rim.bone_mm + plan.foot_mm);
    let (out, over) = (outline[0].outer - site.inward * plan.away_mm, outline[0].outer - site.inward * 4.0);
    let mut moves = craniotomy(&hole, plan);
    moves[1].1 *= 0.35;
    // Its hole is for the craniotome's foot, not for the probe.
    moves[2].1 = 2.0;
    moves.extend([
        Move("take the craniotome", 1.5, out, Buttons::take(ToolKind::Craniotome)),
        Move("come to the hole", 3.0, over, HANDS_OFF),
        Move("enter the hole", 4.0, foot(&outline[0]), Buttons::PEDAL),
    ]);
    let around = outline.iter().cycle().skip(1).take(outline.len());
    let share = 60.0 / outline.len() as f64;
    moves.extend(around.map(|rim| Move("cut around the flap", share, foot(rim), Buttons::PEDAL)));
    moves.extend([
        Move("leave the cut", 4.0, over, HANDS_OFF),
        Move("draw back", 3.0, out, HANDS_OFF),
        Move("lift the flap", 2.0, out, Buttons::FLAP),
    ]);
    let brain = [change(site, plan), probe(site, plan)].into_iter().flatten().filter(|_| plan.presses_after_flap);
    moves.extend(brain.map(|m| Move(m.0, 0.8 * m.1, m.2, m.3)));
    (hole.below(-plan.start_mm), moves)
}

/// Opens the bone by the planned flap or a burr hole; nothing where it is open.
fn opened(site: &Site, plan: &Plan) -> (Vec3, Vec<Move>) {
    match (plan.is_open, plan.outline.is_empty()) {
        (true, _) => (site.below(-plan.start_mm), Vec::new()),
        (_, true) => (site.below(-plan.start_mm), craniotomy(site, plan)),
        _ => flap(site, &Plan { presses_after_flap: false, ..plan.clone() }),
    }
}

/// Share of the time for a millimetre of the scalpel's way, numerical: some 3 mm/s.
const INCISING_SHARE: f64 = 0.65;
/// Depth of the scalpel's middle below the dura, and above it between two incisions, mm, numerical.
const INCISION_MM: [f32; 2] = [1.2, 5.0];

/// Incises the dura along the planned lines with the scalpel; nothing without any.
fn incise(site: &Site, plan: &Plan) -> Vec<Move> {
    let away = site.below(-plan.away_mm);
    let mut moves = Vec::new();
    for line in &plan.incisions {
        let [Some(first), Some(last)] = [line.first(), line.last()] else { continue };
        let [over_first, over_last] = [first, last].map(|place| *place - INCISION_MM[1] * site.inward);
        moves.push(Move("come to the dura", 5.0, over_first, HANDS_OFF));
        let mut before = *first;
        for place in line {
            let share = INCISING_SHARE * f64::from(place.distance(before)).max(1.5);
            moves.push(Move("incise the dura", share, *place + INCISION_MM[0] * site.inward, Buttons::PEDAL));
            before = *place;
        }
        moves.push(Move("lift the scalpel", 1.5, over_last, HANDS_OFF));
    }
    if !moves.is_empty() {
        moves.insert(0, Move("take the scalpel", 1.5, away, Buttons::take(ToolKind::Scalpel)));
        moves.push(Move("leave", 4.0, away, HANDS_OFF));
    }
    moves
}

/// Share of the time for a millimetre of the aspirator's way, numerical; a flap takes 110.
const ASPIRATING_SHARE: f64 = 0.5;
/// Distance between layers and between the circles of a layer, mm: less than the tip is wide.
const LAYER_MM: f32 = 1.5;
/// Corners of a circle.
const CORNERS: u8 = 12;

/// Corners of a circle across the approach.
fn corners(site: &Site, middle: Vec3, radius_mm: f32) -> impl Iterator<Item = Vec3> {
    let turn = Quat::from_rotation_arc(Vec3::NEG_Z, site.inward.normalize());
    (0..=CORNERS).map(move |corner| {
        let (sin, cos) = (f32::from(corner) / f32::from(CORNERS) * std::f32::consts::TAU).sin_cos();
        middle + turn * (radius_mm * Vec3::new(cos, sin, 0.0))
    })
}

/// What is resected, and a place above it in the opening.
fn target(site: &Site, plan: &Plan) -> (Target, Vec3) {
    let usual = Target { centre: site.below(site.brain_mm + 2.0), radius_mm: 5.0, sinks_mm: 0.0 };
    let target = plan.target.unwrap_or(usual);
    let deep_mm = (target.centre - site.entry).dot(site.inward);
    (target, target.centre - site.inward * (deep_mm - site.brain_mm + plan.aspirator_radius_mm + 1.0))
}

/// Takes the target away with the aspirator, layer by layer from above, each from the middle. The
/// target may lie anywhere between its place at rest and where it sinks to.
fn resect(site: &Site, plan: &Plan) -> Vec<Move> {
    let (target, top) = target(site, plan);
    let away = site.below(-plan.away_mm);
    let mut moves = vec![
        Move("take the aspirator", 1.5, away, Buttons::take(ToolKind::Aspirator)),
        Move("come to the brain", 6.0, top, HANDS_OFF),
    ];
    let mut last = top;
    let Target { centre, sinks_mm, .. } = target;
    let reach_mm = (target.radius_mm - plan.aspirator_radius_mm).max(0.0);
    let long_mm = 2.0 * reach_mm + sinks_mm;
    let layers = (long_mm / LAYER_MM).ceil().max(1.0) as u8;
    for layer in 0..=layers {
        let below_mm = long_mm * f32::from(layer) / f32::from(layers) - reach_mm;
        let from_middle_mm = below_mm.min(0.0) + (below_mm - sinks_mm).max(0.0);
        let wide_mm = (reach_mm * reach_mm - from_middle_mm * from_middle_mm).max(0.0).sqrt();
        let middle = centre + below_mm * site.inward;
        let circles = (wide_mm / LAYER_MM).ceil() as u8;
        let radius = |circle: u8| wide_mm * f32::from(circle) / f32::from(circles);
        for tip in [middle].into_iter().chain((1..=circles).flat_map(|c| corners(site, middle, radius(c)))) {
            let share = ASPIRATING_SHARE * f64::from(tip.distance(last).max(0.2));
            moves.push(Move("aspirate", share, tip, Buttons::PEDAL));
            last = tip;
        }
    }
    moves.extend([Move("draw back", 4.0, top, HANDS_OFF), Move("leave", 4.0, away, HANDS_OFF)]);
    moves
}

/// Waits until `retract` holds the brain aside, and takes a small ball of it away, as deep as the
/// spatula may have drawn it.
fn suck(site: &Site, plan: &Plan) -> Vec<Move> {
    let small = Target { centre: site.below(site.brain_mm + 1.5), radius_mm: 3.5, sinks_mm: 8.0 };
    let mut moves = resect(site, &Plan { target: Some(small), ..plan.clone() });
    let whole: f64 = moves.iter().map(|each| each.1).sum();
    moves.iter_mut().for_each(|each| each.1 /= whole);
    moves[0] = Move("wait", 1.0, site.below(-plan.start_mm), HANDS_OFF);
    moves
}

/// Presses the spatula beside the target, leaves it with an arm, and takes the target away.
fn arm(site: &Site, plan: &Plan) -> Vec<Move> {
    let (target, top) = target(site, plan);
    let aside = (target.radius_mm + plan.spatula_radius_mm + 2.0) * site.inward.any_orthonormal_vector();
    let over = top + aside;
    let deep = over + (2.0 * plan.retract_mm[0] + 1.0) * site.inward;
    let mut moves = vec![
        Move("take the spatula", 1.5, site.below(-plan.start_mm), Buttons::take(ToolKind::Spatula)),
        Move("approach with the spatula", 6.0, over, HANDS_OFF),
        Move("press", 5.0, deep, HANDS_OFF),
        Move("leave it with an arm", 1.0, deep, Buttons::ARM),
        Move("draw back", 4.0, over - 10.0 * site.inward, HANDS_OFF),
    ];
    moves.extend(resect(site, plan).into_iter().skip(1));
    moves
}

/// Share of the time for a millimetre of the bipolar's way, numerical: some 3 mm/s.
const COAGULATING_SHARE: f64 = 0.65;
/// Distance between the circles of the bipolar, mm: less than twice its reach.
const COAGULATED_MM: f32 = 2.5;

/// Goes with the bipolar along the wall of what was taken away, from above. It goes where the
/// aspirator's middle was, so that its tips come near the wall and do not press it.
fn coagulate(site: &Site, plan: &Plan) -> Vec<Move> {
    let (target, top) = target(site, plan);
    let away = site.below(-plan.away_mm);
    let mut moves = vec![
        Move("take the bipolar", 1.5, away, Buttons::take(ToolKind::Bipolar)),
        Move("come to the wound", 6.0, top, HANDS_OFF),
    ];
    let mut last = top;
    let Target { centre, sinks_mm, .. } = target;
    let radius_mm = (target.radius_mm - plan.aspirator_radius_mm).max(0.5);
    let quarter_mm = radius_mm * std::f32::consts::FRAC_PI_2;
    let circles = ((2.0 * quarter_mm + sinks_mm) / COAGULATED_MM).ceil() as u8;
    let wall = (0..=circles).flat_map(|circle| {
        let way_mm = (2.0 * quarter_mm + sinks_mm) * f32::from(circle) / f32::from(circles);
        let (upper, lower) = (way_mm.min(quarter_mm), (way_mm - quarter_mm - sinks_mm).max(0.0));
        let below_mm = (way_mm - quarter_mm).clamp(0.0, sinks_mm) - radius_mm * (upper / radius_mm).cos();
        let middle = centre + (below_mm + radius_mm * (lower / radius_mm).sin()) * site.inward;
        corners(site, middle, radius_mm * (upper / radius_mm).sin() * (lower / radius_mm).cos())
    });
    for tip in wall {
        let share = COAGULATING_SHARE * f64::from(tip.distance(last).max(0.2));
        moves.push(Move("coagulate", share, tip, Buttons::PEDAL));
        last = tip;
    }
    moves.extend([Move("draw back", 4.0, top, HANDS_OFF), Move("leave", 4.0, away, HANDS_OFF)]);
    moves
}

/// A circular outline on flat bone.
fn circle(site: &Site) -> Vec<Rim> {
    let turn = Quat::from_rotation_arc(Vec3::Z, -site.inward.normalize());
    let rim = |at: u8| {
        let (sin, cos) = (f32::from(at) / 24.0 * std::f32::consts::TAU).sin_cos();
        Rim { outer: site.entry + turn * (10.0 * Vec3::new(cos, sin, 0.0)), bone_mm: site.bone_mm }
    };
    (0..24).map(rim).collect()
}

fn change(site: &Site, plan: &Plan) -> Vec<Move> {
    let away = site.below(-plan.away_mm);
    vec![
        Move("change the tool", 1.5, away, Buttons::take(ToolKind::Probe)),
        Move("take the probe", 1.5, away, HANDS_OFF),
    ]
}

fn probe(site: &Site, plan: &Plan) -> Vec<Move> {
    let over_brain = site.brain_mm - plan.probe_radius_mm;
    let over = site.below(over_brain - 1.0);
    let mut moves = vec![Move("approach with the probe", 8.0, over, HANDS_OFF)];
    for press_mm in plan.presses_mm {
        let deep = site.below(over_brain + press_mm);
        moves.extend([
            Move("press", 3.0, deep, HANDS_OFF),
            Move("hold", 1.5, deep, HANDS_OFF),
            Move("withdraw", 2.5, over, HANDS_OFF),
        ]);
    }
    moves.push(Move("leave", 8.0, site.below(-plan.away_mm), HANDS_OFF));
    moves
}

/// One press of the probe, held for a third of the time.
fn press(site: &Site, plan: &Plan) -> Vec<Move> {
    let over_mm = site.brain_mm - plan.probe_radius_mm;
    let (over, deep) = (site.below(over_mm - 1.0), site.below(over_mm + plan.presses_mm[0]));
    vec![
        Move("approach with the probe", 7.0, over, HANDS_OFF),
        Move("press", 6.0, deep, HANDS_OFF),
        Move("hold", 9.0, deep, HANDS_OFF),
        Move("withdraw", 4.0, over, HANDS_OFF),
        Move("leave", 4.0, site.below(-plan.away_mm), HANDS_OFF),
    ]
}

/// The spatula presses, draws the brain aside and holds it there.
fn retract(site: &Site, plan: &Plan) -> Vec<Move> {
    let over_mm = site.brain_mm - plan.spatula_radius_mm;
    let aside = plan.retract_mm[1] * site.inward.any_orthonormal_vector();
    let (over, deep) = (site.below(over_mm - 1.0), site.below(over_mm + plan.retract_mm[0]));
    vec![
        Move("take the spatula", 1.5, site.below(-plan.start_mm), Buttons::take(ToolKind::Spatula)),
        Move("approach with the spatula", 6.0, over, HANDS_OFF),
        Move("press", 5.0, deep, HANDS_OFF),
        Move("draw aside", 5.0, deep + aside, HANDS_OFF),
        Move("hold", 9.0, deep + aside, HANDS_OFF),
        Move("withdraw", 4.0, over + aside, HANDS_OFF),
        Move("leave", 4.0, site.below(-plan.away_mm), HANDS_OFF),
    ]
}

/// Places of closings in a row along the blades, and their depths in the brain, mm, numerical.
/// Scissors cut some 8 mm wide and 10 mm high.
const SNIPS_MM: ([f32; 5], [f32; 2]) = ([-12.0, -6.0, 0.0, 6.0, 12.0], [5.0, 11.0]);

/// Cuts the brain along a line in two depths, then presses the spatula into the slit and draws it
/// across.
fn cut(site: &Site, plan: &Plan, along: Vec3) -> Vec<Move> {
    let above = |aside_mm: f32| site.below(site.brain_mm - 2.0) + aside_mm * along;
    let mut moves = vec![Move("take the scissors", 1.5, site.below(-plan.start_mm), Buttons::take(ToolKind::Scissors))];
    for (deep_mm, aside_mm) in SNIPS_MM.1.into_iter().flat_map(|deep| SNIPS_MM.0.map(|aside| (deep, aside))) {
        let place = above(aside_mm) + (2.0 + deep_mm) * site.inward;
        moves.extend([
            Move("come to the brain", 1.5, above(aside_mm), HANDS_OFF),
            Move("go in", 1.0, place, HANDS_OFF),
            Move("close the scissors", 0.3, place, Buttons::PEDAL),
            Move("draw back", 1.0, above(aside_mm), HANDS_OFF),
        ]);
    }
    let deep = site.below(site.brain_mm + SNIPS_MM.1[1] - plan.spatula_radius_mm);
    let aside = plan.retract_mm[1] * site.inward.cross(along);
    moves.extend([
        Move("take the spatula", 2.0, site.below(-plan.away_mm), Buttons::take(ToolKind::Spatula)),
        Move("come to the slit", 4.0, site.below(site.brain_mm - plan.spatula_radius_mm - 1.0), HANDS_OFF),
        Move("go into the slit", 5.0, deep, HANDS_OFF),
        Move("draw aside", 5.0, deep + aside, HANDS_OFF),
        Move("hold", 5.0, deep + aside, HANDS_OFF),
        Move("leave", 4.0, site.below(-plan.away_mm), HANDS_OFF),
    ]);
    moves
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_burr_spares_the_brain_and_makes_room_for_the_probe(bone_mm in 1.0f32..12.0, gap_mm in 0.0f32..8.0,
                                                                  burr_radius_mm in 2.5f32..4.0) {
            let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm, brain_mm: bone_mm + gap_mm };
            let plan = Plan { burr_radius_mm, probe_radius_mm: 0.6 * burr_radius_mm, ..Plan::default() };
            // Of the burr's centre, which stays behind the hand.
            let depth_mm = plan.burr_depth_mm(&site) - plan.burr_lag_mm;
            let into_brain_mm = depth_mm + burr_radius_mm - site.brain_mm;
            prop_assert!(into_brain_mm <= plan.burr_overlap_mm + 1e-5);
            prop_assert!(depth_mm <= bone_mm + plan.breakthrough_mm + 1e-5);
            let short_mm = (bone_mm - depth_mm).max(0.0);
            let hole_mm = (burr_radius_mm.powi(2) - short_mm.powi(2)).max(0.0).sqrt();
            // With no gap at all the overlap is what limits the hole.
            let limited = into_brain_mm > plan.burr_overlap_mm - 1e-4;
            prop_assert!(limited || hole_mm > plan.probe_radius_mm, "hole of {} mm", hole_mm);
            prop_assert!(hole_mm > 0.0, "no break-through");
        }
    }
}
