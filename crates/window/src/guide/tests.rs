use super::*;
use crate::surface::tests::slab;
use crate::surface::{Ray, SurfaceHit};
use trepan_render::Camera;

/// A hand over the slab, with a tool that goes wherever the hand goes outside bone.
struct Bench {
    guide: Guide,
    hand: Pose,
    tip: Pose,
    tool: Tool,
    view: View,
}

impl Bench {
    fn with(tool: Tool) -> Self {
        let view = Camera::viewed_from(Vec3::ZERO, Vec3::new(0.3, 0.5, 1.0), 200.0).view(1.0);
        let start = Pose::from_translation(Vec3::new(30.0, 5.0, 40.0));
        Self { guide: Guide::default(), hand: start, tip: start, tool, view }
    }

    /// The pointer over a world point for some pictures.
    fn point(&mut self, at: Vec3, pointer: Pointer, pictures: usize) {
        for _ in 0..pictures {
            self.picture(at, pointer, &slab);
            // Bone beside the hole stops the tool.
            if self.tip.translation.truncate().length() > 3.5 {
                self.tip.translation.z = self.tip.translation.z.max(self.tool.tip_radius_mm);
            }
        }
    }

    /// One picture with the surfaces that rays meet.
    fn picture(&mut self, at: Vec3, pointer: Pointer, cast: &dyn Fn(&Ray) -> Option<SurfaceHit>) {
        let pointer = Pointer { at: Some(self.view.project(at).0), ..pointer };
        let around = Around {
            surfaces: Surfaces::new(cast, [true; 2], None),
            view: &self.view,
            tool: self.tool,
            world_from_tool: self.tip,
            dt_s: 0.05,
            pedal: false,
        };
        self.guide.follow(&mut self.hand, &pointer, &around);
        self.tip = self.hand;
    }
}

const MOVES: Pointer = Pointer { moved: 20.0, ..Pointer::NONE };
const HOLDS: Pointer = Pointer { held: true, ..Pointer::NONE };

#[test]
fn the_tool_flies_over_what_is_under_the_pointer() {
    let mut bench = Bench::with(Tool::burr(3.0));
    bench.point(Vec3::new(-20.0, 8.0, 0.0), MOVES, 60);
    let at = bench.hand.translation;
    assert!((at.truncate() - Vec2::new(-20.0, 8.0)).length() < 0.5, "{at}");
    assert!((at.z - 3.0 - CLEARANCE_MM).abs() < 0.5 && !bench.guide.pedal(), "{at}");
    bench.hand.translation.z = -3.0;
    bench.hand.translation.x = 0.0;
    bench.hand.translation.y = 0.0;
    bench.tip = bench.hand;
    bench.point(Vec3::new(-20.0, 8.0, 0.0), MOVES, 1);
    assert!(bench.hand.translation.truncate().length() < 0.1, "first up, then across");
}

#[test]
fn a_held_button_lands_drills_and_pushes_gently_and_lets_the_tool_rise_again() {
    let mut bench = Bench::with(Tool::burr(3.0));
    let place = Vec3::new(20.0, 0.0, 0.0);
    bench.point(place, MOVES, 60);
    bench.point(place, HOLDS, 5);
    assert!(bench.guide.pedal());
    let before = bench.hand.translation.z;
    bench.guide.feed_mm_s = 0.5;
    bench.point(place, HOLDS, 4);
    assert!(before - bench.hand.translation.z < 0.11, "the feed is 0.5 mm/s");
    bench.point(place, HOLDS, 200);
    let lead = bench.tip.translation.z - bench.hand.translation.z;
    assert!((lead - FEED_LEAD_MM).abs() < 0.01, "{lead}");
    bench.guide.drills = false;
    assert!(!bench.guide.pedal(), "the switch is off");
    bench.point(place, Pointer::NONE, 40);
    assert!((bench.hand.translation.z - 3.0 - CLEARANCE_MM).abs() < 0.5 && !bench.guide.is_pressed());
}

/// Bone of 6 mm with a round hole of a ball's shape, whose deepest point is at a depth.
fn drilled(ray: &Ray, deep_mm: f32) -> Option<SurfaceHit> {
    let floor = |at: Vec3| {
        let aside = at.truncate().length();
        let rise = if deep_mm > 3.0 { 0.0 } else { 3.0 - deep_mm };
        let wide = (9.0 - rise * rise).max(0.0).sqrt();
        if aside < wide { -(deep_mm - 3.0 + (9.0 - aside * aside).max(0.0).sqrt()) } else { 0.0 }
    };
    let is_bone = |at: Vec3| ray.bone && at.z > -6.0 && at.z < floor(at);
    let mut last = is_bone(ray.from);
    for n in 1..(ray.reach_mm / 0.05) as usize {
        let now = is_bone(ray.from + 0.05 * n as f32 * ray.along);
        if now && !last {
            return Some(SurfaceHit { distance_mm: 0.05 * n as f32, normal: -ray.along });
        }
        last = now;
    }
    None
}

#[test]
fn a_held_drill_stops_where_the_bone_is_through_and_goes_on_with_a_new_press() {
    let mut bench = Bench::with(Tool::burr(3.0));
    bench.hand = Pose::from_translation(3.5 * Vec3::Z);
    bench.tip = bench.hand;
    let (mut deep_mm, mut stops) = (0.0f32, Vec::new());
    for pointer in [HOLDS, Pointer::NONE, HOLDS, Pointer::NONE, HOLDS] {
        for _ in 0..400 {
            let cast = |ray: &Ray| drilled(ray, deep_mm);
            let pointer = Pointer { at: Some(bench.view.project(Vec3::ZERO).0), ..pointer };
            let around = Around {
                surfaces: Surfaces::new(&cast, [true; 2], None),
                view: &bench.view,
                tool: bench.tool,
                world_from_tool: bench.tip,
                dt_s: 0.05,
                pedal: false,
            };
            bench.guide.follow(&mut bench.hand, &pointer, &around);
            // It yields as fast as it is pushed, all at once where nothing is left.
            let yields_mm =
                if !bench.guide.pedal() { 0.0 } else { 0.05 * (bench.tip.translation.z - bench.hand.translation.z) };
            let bottom = if deep_mm - 3.0 > 6.0 { f32::NEG_INFINITY } else { 3.0 - deep_mm - yields_mm };
            bench.tip.translation = bench.hand.translation.with_z(bench.hand.translation.z.max(bottom));
            deep_mm = deep_mm.max(3.0 - bench.tip.translation.z);
        }
        stops.push((bench.guide.through(), 3.0 - bench.tip.translation.z));
    }
    let (texts, deep): (Vec<_>, Vec<_>) = stops.into_iter().unzip();
    assert!(
        texts[0].is_some_and(|text| text.starts_with("through")) && (5.9..6.6).contains(&deep[0]),
        "{texts:?} {deep:?}"
    );
    assert!(
        texts[2].is_some_and(|text| text.starts_with("the hole")) && (6.6..9.6).contains(&deep[2]),
        "{texts:?} {deep:?}"
    );
    assert!(texts[4].is_none() && deep[1] < 0.0, "{texts:?} {deep:?}");
    assert!((deep[4] - 7.5).abs() < 0.1, "a third press ends at the inner table: {deep:?}");
}

#[test]
fn a_drag_slides_on_the_surface() {
    let mut bench = Bench::with(Tool::probe(2.0));
    bench.point(Vec3::new(20.0, 0.0, 0.0), MOVES, 60);
    bench.point(Vec3::new(20.0, 0.0, 0.0), HOLDS, 20);
    let drag = Pointer { left: Vec2::ONE, ..HOLDS };
    for n in 0..40 {
        bench.point(Vec3::new(20.0 + 0.2 * n as f32, 0.0, 0.0), drag, 1);
    }
    let at = bench.tip.translation;
    assert!(at.x > 26.0 && (at.z - 2.0).abs() < 0.01, "{at}");
    assert!(bench.hand.translation.z > 2.0 - FEED_LEAD_MM);
}

#[test]
fn a_quick_drag_is_followed_on_its_way_by_a_slow_burr() {
    let mut bench = Bench::with(Tool::burr(3.0));
    bench.point(Vec3::new(20.0, 0.0, 0.0), MOVES, 60);
    bench.point(Vec3::new(20.0, 0.0, 0.0), HOLDS, 20);
    let drag = Pointer { left: Vec2::ONE, ..HOLDS };
    let corner = (0..20).map(|n| Vec2::new(20.0 + 0.5 * n as f32, 0.0));
    let corner = corner.chain((0..20).map(|n| Vec2::new(30.0, 0.5 * n as f32)));
    corner.for_each(|at| bench.point(at.extend(0.0), drag, 1));
    let mut off = 0.0f32;
    for _ in 0..120 {
        bench.point(Vec3::new(30.0, 9.5, 0.0), HOLDS, 1);
        let at = bench.tip.translation;
        off = off.max(at.y.abs().min((at.x - 30.0).abs()));
    }
    let at = bench.tip.translation;
    assert!(off < 0.7 && (at.truncate() - Vec2::new(30.0, 9.5)).length() < 0.7, "{off} mm off, ends at {at}");
}

#[test]
fn a_craniotome_goes_under_the_bone_and_is_drawn_out_when_the_button_is_let_go() {
    let mut bench = Bench::with(Tool::craniotome());
    bench.point(Vec3::new(0.0, 0.0, -7.0), MOVES, 80);
    bench.point(Vec3::new(0.0, 0.0, -7.0), HOLDS, 60);
    let deep = bench.tip.translation;
    assert!(deep.z < -5.0 && deep.truncate().length() < 1.0, "{deep}");
    bench.hand.translation = Vec3::new(2.6, 0.0, -6.8);
    bench.tip = bench.hand;
    bench.point(Vec3::ZERO, Pointer::NONE, 20);
    assert!(bench.hand.translation.z > 3.0, "{}", bench.hand.translation);
}

type Cast<'a> = &'a dyn Fn(&Ray) -> Option<SurfaceHit>;

#[test]
fn a_held_button_ends_every_feed_at_the_inner_table_or_a_set_depth_in_the_brain() {
    let no_brain = |ray: &Ray| slab(&Ray { brain: false, ..*ray });
    let wide = |ray: &Ray| no_brain(ray).filter(|hit| (ray.from + hit.distance_mm * ray.along).x < 3.0);
    let without: [Cast<'_>; 2] = [&no_brain, &wide];
    let deepest = |tool, cast: Cast<'_>| {
        let mut bench = Bench::with(tool);
        bench.hand.translation = Vec3::new(0.0, 0.0, 3.0);
        bench.tip = bench.hand;
        for _ in 0..400 {
            bench.picture(Vec3::new(0.0, 0.0, -7.0), HOLDS, cast);
        }
        bench.tip.translation.z
    };
    let foot = -6.0 - FOOT_MM;
    for cast in without.into_iter().chain([&slab as &dyn Fn(&Ray) -> Option<SurfaceHit>]) {
        let z = deepest(Tool::craniotome(), cast);
        assert!((z - foot).abs() < 0.3, "the foot at the start of a lap, and where its side is open: {z}");
    }
    let burr = deepest(Tool::burr(2.0), &slab);
    assert!(burr > -5.2, "a burr stops at the brain at the latest: {burr}");
    let burr = deepest(Tool::burr(2.0), &no_brain);
    assert!(burr > -5.3, "a burr at the inner table: {burr}");
    let probe = deepest(Tool::probe(2.0), &slab);
    assert!((probe + 5.0 + PRESS_MM).abs() < 0.2, "the probe's depth of a press: {probe}");
    let mut snips = Bench::with(Tool::scissors());
    snips.hand.translation = Vec3::new(0.0, 0.0, 3.0);
    snips.tip = snips.hand;
    let closes = (0..400).find(|_| {
        snips.picture(Vec3::new(0.0, 0.0, -7.0), HOLDS, &slab);
        snips.guide.pedal()
    });
    assert!(closes.is_some() && (snips.tip.translation.z + 5.5 + SNIP_MM).abs() < 0.3, "{}", snips.tip.translation.z);
    let scalpel = deepest(Tool::scalpel(), &slab);
    assert!((scalpel + 6.5 + INCISE_MM).abs() < 0.2, "through the dura and no further: {scalpel}");
    let spatula = deepest(Tool::spatula(), &no_brain);
    assert!((spatula + 4.5).abs() < 0.3, "nothing to press: {spatula}");
    let nothing = deepest(Tool::probe(2.0), &|_: &Ray| None);
    assert_eq!(nothing, 3.0, "no surface at all");
}

#[test]
fn the_wheel_moves_finely_and_the_tool_stays_until_the_pointer_leaves() {
    let mut bench = Bench::with(Tool::burr(3.0));
    let place = Vec3::new(20.0, 0.0, 0.0);
    bench.point(place, MOVES, 60);
    let before = bench.hand.translation;
    bench.point(place, Pointer { wheel: 3.0 * NOTCH, ..Pointer::NONE }, 1);
    bench.point(place, Pointer { moved: 1.0, ..Pointer::NONE }, 3);
    assert!(((before - bench.hand.translation).length() - 3.0 * WHEEL_MM).abs() < 1e-3);
    bench.point(place, MOVES, 10);
    assert!((bench.hand.translation - before).length() < 0.6);
}
