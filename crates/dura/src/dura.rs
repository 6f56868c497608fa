//! The sheet in motion: a tool presses it, sutures draw it.
//!
//! # Theory
//! What is wanted is the shape at rest under what pulls and presses: it is found by dynamic
//! relaxation (Underwood 1983). Each node gets the mass with which a step of 0.1 ms is stable, a
//! thousand times its own, and motion is damped. So statics are exact, and the hand feels a mass of
//! some grams. No element has a frequency over the limit, so no sheet has (Irons and Treharne):
//! ```text
//! m_e = s K_e dt² / 4        v' = (v + dt f/m) / (1 + α dt)        x' = x + dt v'
//! ```
//! The brain below bears what lies lower on it than at rest, by a spring for each area; it feels
//! nothing of that. A tool's ball meets the sheet in the closest point, by a spring. It is above
//! the sheet if it came from there: what is below, as in the wound, does not meet it.

use crate::blade::Blade;
use crate::membrane::Law;
use crate::over::Grid;
use crate::sheet::{NONE, Node, Point, Sheet};
use crate::touch_force::TouchForce;
use std::ops::Range;
use trepan_geometry::{Vec3, closest_weights};
use trepan_measurements::{brain_membranes, dura, pulse};
use trepan_mesh::TetMesh;

/// Step, ms, numerical.
const DT_MS: f64 = 0.1;
/// Longest time between two calls that counts, ms, numerical.
const LONGEST_MS: f64 = 5.0;
/// Mass over the least with which a step is stable, numerical.
const SAFETY: f32 = 1.5;
/// Damping, 1/ms, numerical.
const DAMPING: f32 = 0.15;
/// Spring between tool and sheet, N/mm, numerical: what a hand's device renders stably.
const TOUCH: f32 = 1.0;
/// Spring of a suture, N/mm, numerical.
const SUTURE: f32 = 0.1;
/// Depth of a tool at first touch, and at which it has gone through, mm, numerical.
const DEPTHS_MM: [f32; 2] = [0.8, 6.0];
/// Distance from the sheet in which a tool is looked for, mm, numerical.
const REACH_MM: f32 = 7.0;
/// Pressure of the brain for a way inwards, N/mm³, numerical: it keeps a slack leaf in its place.
const BELOW: f32 = 2e-3;
/// Way of the brain below that moves the sheet, and one that sutures hold, mm, numerical.
const STIRS_MM: [f32; 2] = [0.05, 0.3];
/// Time for which the sheet moves on after the last touch, ms, numerical.
const AWAKE_MS: f64 = 500.0;
/// Time in which the tension goes once the sheet is open, ms, numerical.
const RELEASE_MS: f64 = 2000.0;

/// A tool's tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip {
    /// Middle of its ball, world mm.
    pub at: Vec3,
    /// Radius of its ball, mm.
    pub radius_mm: f32,
    /// Whether it incises what it presses.
    pub cuts: bool,
}

/// What was done to the sheet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Account {
    /// Length of all incisions at rest, mm.
    pub incised_mm: f32,
    /// Area that was cut out, mm².
    pub cut_out_mm2: f32,
    /// Places where it tore or a tool went through.
    pub torn: u32,
    /// When fluid could leave, ms.
    pub opened_ms: Option<f64>,
}

/// Where a tool meets the sheet.
#[derive(Clone, Copy, Debug)]
struct Touch {
    at: Point,
    /// Of the force on the tool, of length 1.
    direction: Vec3,
    tip: Tip,
    depth_mm: f32,
}

/// The dura over an opening.
#[derive(Clone, Debug)]
pub struct Dura {
    sheet: Sheet,
    law: Law,
    /// World place of the middle, and outward.
    middle: Vec3,
    outward: Vec3,
    edge_mm: f32,
    /// Live triangles with a node that bone does not hold.
    active: Vec<u32>,
    now_ms: f64,
    /// Time that no step has taken yet, ms.
    left_ms: f64,
    awake_ms: f64,
    forces: [TouchForce; 2],
    held_ms: Option<f64>,
    blade: Blade,
    account: Account,
    changes: u32,
}

impl Dura {
    /// Over the brain below a place, as far as a radius, mm; `None` where no brain is. All of it is
    /// held until [`pin`](Self::pin) lets it go.
    pub fn over(brain: &TetMesh, place: Vec3, outward: Vec3, radius_mm: f32) -> Option<Self> {
        let grid = Grid::over(brain, place, outward, radius_mm)?;
        let tears_at = 1e-2 * brain_membranes::DURA_FAILURE_STRAIN.f32();
        let stretch_n_per_mm = brain_membranes::DURA_YOUNG_MODULUS.f32() * dura::THICKNESS.f32();
        let poisson = dura::POISSON_RATIO.f32();
        // Tension of a ball under the pressure in the skull.
        let mmhg = 0.5 * (pulse::PRESSURE_SUPINE_LEAST.f32() + pulse::PRESSURE_SUPINE_MOST.f32());
        let tension = 0.5 * mmhg * pulse::MMHG.f32() * dura::RADIUS.f32();
        let strain = tension * (1.0 - poisson) / stretch_n_per_mm;
        let law =
            Law { stretch_n_per_mm, poisson, strain, tears_at: tears_at + 0.5 * tears_at * tears_at, below: BELOW };
        let mut sheet = Sheet::of(&grid.rest, &grid.triangles);
        sheet.nodes.iter_mut().zip(grid.feet).for_each(|(node, foot)| node.foot = foot);
        Some(Self::of(sheet, law, (grid.middle, outward.normalize(), grid.edge_mm)))
    }

    pub(crate) fn of(sheet: Sheet, law: Law, (middle, outward, edge_mm): (Vec3, Vec3, f32)) -> Self {
        let active = Vec::with_capacity(sheet.triangles.len());
        let mut made = Self {
            sheet,
            law,
            middle,
            outward,
            edge_mm,
            active,
            now_ms: f64::NAN,
            left_ms: 0.0,
            awake_ms: f64::NEG_INFINITY,
            forces: [TouchForce::default(); 2],
            held_ms: None,
            blade: Blade::default(),
            account: Account::default(),
            changes: 0,
        };
        made.active.extend(0..made.sheet.triangles.len() as u32);
        made.add_forces(1.0);
        made.sheet.nodes.iter_mut().for_each(|node| node.support = -node.force);
        made.changed();
        made.turn_normals();
        made
    }

    /// Number of nodes; a cut adds some.
    pub fn nodes(&self) -> usize {
        self.sheet.nodes.len()
    }

    /// Most nodes that there can be.
    pub fn room(&self) -> usize {
        self.sheet.room
    }

    /// Counts up when triangles or nodes changed.
    pub fn changes(&self) -> u32 {
        self.changes
    }

    /// World place of each node, mm.
    pub fn places(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.sheet.nodes.iter().map(|node| self.middle + node.place)
    }

    /// World place of each node at rest, mm.
    pub fn at_rest(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.sheet.nodes.iter().map(|node| self.middle + node.rest)
    }

    /// Every triangle, counterclockwise from outside; `[0; 3]` where one was taken away.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.sheet.triangles.iter().map(|t| if t.live { t.corners } else { [0; 3] })
    }

    /// Two lines on the sheet at rest that cross in its middle, world mm.
    ///
    /// They go from rim to rim of a circle of a radius, mm, with so many parts each.
    pub fn cross(&self, radius_mm: f32, parts: u8) -> [Vec<Vec3>; 2] {
        let (x, y) = self.outward.any_orthonormal_pair();
        [x, y].map(|axis| {
            let along = |part: u8| radius_mm * (2.0 * f32::from(part) / f32::from(parts) - 1.0) * axis;
            (0..=parts).filter_map(|part| self.below(along(part))).collect()
        })
    }

    /// The place of the sheet at rest on the line along the outward direction through a place,
    /// relative to its middle; `None` beside it.
    fn below(&self, place: Vec3) -> Option<Vec3> {
        let flat = |p: Vec3| p.reject_from_normalized(self.outward);
        self.sheet.triangles.iter().find_map(|triangle| {
            let rest = triangle.corners.map(|n| self.sheet.nodes[n as usize].rest);
            let weights = closest_weights(rest.map(flat), flat(place));
            let at =
                |of: fn(Vec3, Vec3) -> Vec3| -> Vec3 { (0..3).map(|k| weights[k] * of(rest[k], self.outward)).sum() };
            let is_here = at(|p, up| p.reject_from_normalized(up)).distance(flat(place)) < 1e-3;
            is_here.then(|| self.middle + at(|p, _| p))
        })
    }

    /// What was done so far.
    pub fn account(&self) -> &Account {
        &self.account
    }

    /// Whether fluid can leave.
    pub fn is_open(&self) -> bool {
        self.account.opened_ms.is_some()
    }

    /// Whether it moved in the last step.
    pub fn moves(&self) -> bool {
        self.now_ms <= self.awake_ms
    }

    /// Force on the tool in the last step, N.
    pub fn force(&self) -> Vec3 {
        self.forces[0].force
    }

    /// Lets the second hand's tip go on where the first one's was, as when an arm takes the tool.
    pub fn hand_over(&mut self) {
        self.forces = [TouchForce::default(), self.forces[0]];
    }

    /// Lets bone hold some nodes, by the place of each at rest, world mm, and the outward
    /// direction.
    pub fn pin(&mut self, nodes: Range<usize>, mut is_held: impl FnMut(Vec3, Vec3) -> bool) {
        let (middle, outward) = (self.middle, self.outward);
        let mut is_other = false;
        for node in self.sheet.nodes.get_mut(nodes).unwrap_or_default() {
            let pinned = node.rim || is_held(middle + node.rest, outward);
            is_other |= std::mem::replace(&mut node.pinned, pinned) != pinned;
            node.velocity = if pinned { Vec3::ZERO } else { node.velocity };
        }
        if is_other {
            self.changed();
        }
    }

    /// Lets the sheet rest on the brain as it is now, by the places of its nodes, world mm.
    ///
    /// Without all of the nodes nothing changes.
    pub fn rest_on(&mut self, brain: &[Vec3]) {
        let stirs_mm = STIRS_MM[usize::from(self.held_ms.is_some())];
        let outward = self.outward;
        let rises = |node: &Node| node.foot.filter(|_| !node.pinned).and_then(|foot| foot.risen_mm(brain, outward));
        let stirs = |node: &Node| rises(node).is_some_and(|mm| (mm - node.risen_mm).abs() > stirs_mm);
        if !self.sheet.nodes.iter().any(stirs) {
            return;
        }
        // All at once: one after the other would keep it awake all the time.
        for node in &mut self.sheet.nodes {
            node.risen_mm = rises(node).unwrap_or(node.risen_mm);
        }
        self.awake_ms = self.awake_ms.max(self.now_ms + AWAKE_MS);
    }

    /// Draws the leaves of the incisions outwards from now on and holds them, as sutures do.
    pub fn hold_back(&mut self) {
        if self.account.incised_mm <= 0.0 {
            return;
        }
        self.held_ms = self.held_ms.or(Some(self.now_ms));
        self.awake_ms = self.now_ms + AWAKE_MS + 1e3 * dura::SUTURE_TIME.value;
        for n in 0..self.sheet.nodes.len() {
            let Node { rest, pinned, .. } = self.sheet.nodes[n];
            let fan = self.sheet.fan_of(n as u32);
            if pinned || fan.closed || fan.triangles().is_empty() {
                continue;
            }
            let inner =
                |t: &u32| self.sheet.triangles[*t as usize].corners.map(|c| self.sheet.nodes[c as usize].rest - rest);
            let across: Vec3 = fan.triangles().iter().flat_map(inner).sum();
            let across = across.reject_from_normalized(self.outward).normalize_or_zero();
            // The held node that lies nearest along that way.
            let near = |node: &&Node| (node.rest - rest).dot(across) / (node.rest - rest).length_squared();
            let rim = self.sheet.nodes.iter().filter(|node| node.pinned).max_by(|a, b| near(a).total_cmp(&near(b)));
            let target = rim.map(|rim| {
                let long_mm = rim.rest.distance(rest);
                rim.rest + long_mm * (UPRIGHT.0 * self.outward + UPRIGHT.1 * across)
            });
            self.sheet.nodes[n].suture = target;
        }
    }

    /// Words that [`save`](Self::save) appends at most.
    pub fn most_words(&self) -> usize {
        8 + self.sheet.most_words()
    }

    /// Appends the sheet's state for [`restore`](Self::restore).
    pub fn save(&self, to: &mut Vec<u64>) {
        let Account { incised_mm, cut_out_mm2, torn, opened_ms } = self.account;
        to.extend([incised_mm, cut_out_mm2].map(|of| u64::from(of.to_bits())));
        to.push(torn.into());
        to.extend([opened_ms, self.held_ms].map(|ms| ms.unwrap_or(f64::NAN).to_bits()));
        self.sheet.save(to);
    }

    /// Takes over what a sheet over the same place saved; times are `later_ms` later here. `None`,
    /// and no change, if it does not fit.
    pub fn restore(&mut self, words: &mut impl Iterator<Item = u64>, later_ms: f64) -> Option<()> {
        let [incised_mm, cut_out_mm2] = [f32::from_bits(words.next()? as u32), f32::from_bits(words.next()? as u32)];
        let torn = words.next()? as u32;
        let mut ms = || words.next().map(|bits| Some(f64::from_bits(bits) + later_ms).filter(|ms| ms.is_finite()));
        let [opened_ms, held_ms] = [ms()?, ms()?];
        self.sheet.restore(words)?;
        self.account = Account { incised_mm, cut_out_mm2, torn, opened_ms };
        (self.held_ms, self.blade) = (held_ms, Blade::default());
        self.changed();
        self.turn_normals();
        Some(())
    }

    /// Goes on to a time, ms, with the tips of two tools, of which the first may cut.
    ///
    /// Returns the forces on them, N. Costs 25 ns for each free triangle and 0.1 ms while anything
    /// moves.
    pub fn step(&mut self, now_ms: f64, tips: [Option<Tip>; 2]) -> [Vec3; 2] {
        let before_ms = std::mem::replace(&mut self.now_ms, now_ms);
        let passed_ms = if before_ms.is_nan() { 0.0 } else { (now_ms - before_ms).clamp(0.0, LONGEST_MS) };
        let touches = [0, 1].map(|hand| {
            let touch = tips[hand].filter(|tip| tip.at.is_finite()).and_then(|tip| self.find(hand, &tip));
            self.forces[hand].touched = touch.is_some();
            touch
        });
        if self.forces.iter().any(|on_tool| on_tool.touched) {
            self.awake_ms = now_ms + AWAKE_MS;
        }
        if now_ms > self.awake_ms {
            self.forces.iter_mut().for_each(TouchForce::sleep);
            self.left_ms = 0.0;
            return [Vec3::ZERO; 2];
        }
        self.left_ms += passed_ms;
        let (mut sums, mut steps, mut worst) = ([Vec3::ZERO; 2], 0.0f32, (self.law.tears_at, None));
        while self.left_ms >= DT_MS {
            self.left_ms -= DT_MS;
            steps += 1.0;
            self.advance(&touches, &mut sums, &mut worst);
        }
        for ((on_tool, touch), sum) in self.forces.iter_mut().zip(&touches).zip(sums) {
            let mean = (steps > 0.0).then(|| sum / steps);
            on_tool.feel(touch.map(|touch| touch.at.triangle), mean, self.changes, passed_ms);
        }
        self.turn_normals();
        let through = touches.iter().flatten().find(|touch| touch.depth_mm > DEPTHS_MM[1]);
        match worst.1.or(through.map(|touch| touch.at.triangle)) {
            Some(triangle) => self.tear(triangle),
            None => self.incise(touches[0].as_ref(), tips[0].is_some_and(|tip| tip.cuts)),
        }
        self.forces.map(|on_tool| on_tool.force)
    }

    fn tear(&mut self, triangle: u32) {
        self.sheet.remove(triangle);
        self.account.torn += 1;
        self.account.opened_ms = self.account.opened_ms.or(Some(self.now_ms));
        self.changed();
    }

    /// Cuts on to where a blade touches. The first edge takes a force: the sheet is taut. Later it
    /// is slack, and cut where the blade touches it, as with scissors.
    fn incise(&mut self, touch: Option<&Touch>, cuts: bool) {
        let pierces = self.account.incised_mm > 0.0 || self.forces[0].force.length() >= dura::INCISION_FORCE.f32();
        let work = match touch {
            _ if !cuts => self.blade.lift(&mut self.sheet, self.edge_mm),
            Some(touch) if pierces => self.blade.follow(&mut self.sheet, self.edge_mm, &touch.at),
            _ => return,
        };
        if work.cut_mm > 0.0 {
            let account = &mut self.account;
            account.incised_mm += work.cut_mm;
            account.cut_out_mm2 += self.sheet.remove_loose();
            if account.incised_mm >= dura::OPEN_LENGTH.f32() {
                account.opened_ms = account.opened_ms.or(Some(self.now_ms));
            }
        }
        if work.cut_mm > 0.0 || work.moved {
            self.changed();
        }
    }

    /// Weighs the nodes anew and finds what moves.
    fn changed(&mut self) {
        self.changes += 1;
        self.awake_ms = self.awake_ms.max(self.now_ms + AWAKE_MS);
        let Sheet { nodes, triangles, .. } = &mut self.sheet;
        let share = 0.25 * SAFETY * (DT_MS * DT_MS) as f32;
        nodes.iter_mut().for_each(|node| (node.mass, node.below) = (share * (2.0 * TOUCH + SUTURE), 0.0));
        self.active.clear();
        for (t, triangle) in triangles.iter().enumerate().filter(|(_, triangle)| triangle.live) {
            let mass = share * triangle.shape.stiffest(&self.law);
            let below = self.law.below * triangle.shape.area_mm2() / 3.0;
            for &n in &triangle.corners {
                nodes[n as usize].mass += mass;
                nodes[n as usize].below += below;
            }
            if triangle.corners.iter().any(|&n| !nodes[n as usize].pinned) {
                self.active.push(t as u32);
            }
        }
    }

    /// Adds the sheet's own forces to those of the nodes; returns the most strained triangle.
    fn add_forces(&mut self, closed: f32) -> (f32, Option<u32>) {
        let mut worst = (0.0, None);
        for &t in &self.active {
            let triangle = &self.sheet.triangles[t as usize];
            let (forces, strain) = triangle.shape.forces(&self.law, closed, self.sheet.places(t));
            for (corner, force) in triangle.corners.into_iter().zip(forces) {
                self.sheet.nodes[corner as usize].force += force;
            }
            if strain > worst.0 {
                worst = (strain, Some(t));
            }
        }
        worst
    }

    /// One step; adds the forces on the tools.
    fn advance(&mut self, touches: &[Option<Touch>; 2], sums: &mut [Vec3; 2], worst: &mut (f32, Option<u32>)) {
        let (dt, now_ms) = (DT_MS as f32, self.now_ms);
        let since =
            |ms: Option<f64>, over_ms: f64| ms.map_or(0.0, |ms| ((now_ms - ms) / over_ms).clamp(0.0, 1.0) as f32);
        let closed = 1.0 - since(self.account.opened_ms, RELEASE_MS);
        let pull_n = dura::SUTURE_FORCE.f32() * since(self.held_ms, 1e3 * dura::SUTURE_TIME.value);
        for node in &mut self.sheet.nodes {
            let suture = node.suture.map(|to| (SUTURE * (to - node.place)).clamp_length_max(pull_n));
            let inwards_mm = ((node.rest - node.place).dot(self.outward) + node.risen_mm).max(0.0);
            let below = node.below * inwards_mm * self.outward;
            node.force = node.support * closed + below + suture.unwrap_or(Vec3::ZERO);
        }
        let strained = self.add_forces(closed);
        if strained.0 > worst.0 {
            *worst = strained;
        }
        for (touch, sum) in touches.iter().zip(sums) {
            let Some(touch) = touch else { continue };
            let corners = self.sheet.triangles[touch.at.triangle as usize].corners;
            let at: Vec3 = (0..3).map(|k| touch.at.weights[k] * self.sheet.nodes[corners[k] as usize].place).sum();
            let depth_mm = touch.tip.radius_mm - (touch.tip.at - self.middle - at).dot(touch.direction);
            let on_tool = TOUCH * depth_mm.max(0.0) * touch.direction;
            *sum += on_tool;
            for (corner, weight) in corners.into_iter().zip(touch.at.weights) {
                self.sheet.nodes[corner as usize].force -= weight * on_tool;
            }
        }
        for node in self.sheet.nodes.iter_mut().filter(|node| !node.pinned) {
            node.velocity = (node.velocity + dt / node.mass * node.force) / (1.0 + DAMPING * dt);
            node.place += dt * node.velocity;
        }
    }

    /// Finds where a hand's tool meets the sheet, and follows from which side.
    fn find(&self, hand: usize, tip: &Tip) -> Option<Touch> {
        let at = tip.at - self.middle;
        let far_mm = tip.radius_mm + REACH_MM + 2.0 * self.edge_mm;
        let mut best: Option<(f32, u32, [f32; 3], Vec3)> = None;
        for (t, _) in (0u32..).zip(&self.sheet.triangles).filter(|(_, triangle)| triangle.live) {
            let places = self.sheet.places(t);
            if places[0].distance_squared(at) < far_mm * far_mm {
                let weights = closest_weights(places, at);
                let away = at - (0..3).map(|k| weights[k] * places[k]).sum::<Vec3>();
                let mm = away.length();
                if mm < tip.radius_mm + REACH_MM && best.is_none_or(|best| mm < best.0) {
                    best = Some((mm, t, weights, away));
                }
            }
        }
        let found = best.and_then(|(mm, triangle, weights, away)| {
            let at = Point { triangle, weights };
            let normal = self.sheet.mean(&at).normal;
            // A blunt tool feels the edge of a leaf from any side, a blade does not.
            let is_edge = self.is_free_edge(&at);
            let aside = away + (0.3 * tip.radius_mm - mm).max(0.0) * normal;
            let direction = if is_edge { aside.normalize_or(normal) } else { normal };
            let depth_mm = tip.radius_mm - if is_edge { mm } else { away.dot(normal) };
            (!is_edge || !tip.cuts).then_some(Touch { at, direction, tip: *tip, depth_mm })
        });
        // A blade that is in an incision meets its end from the side.
        let most_mm = if self.forces[hand].touched || tip.cuts { f32::INFINITY } else { DEPTHS_MM[0] };
        found.filter(|touch| touch.depth_mm > 0.0 && touch.depth_mm < most_mm)
    }

    /// Whether a point of a triangle is on an edge that joins nothing.
    fn is_free_edge(&self, at: &Point) -> bool {
        let beyond = self.sheet.triangles[at.triangle as usize].beyond;
        (0..3).any(|k| at.weights[(k + 2) % 3] == 0.0 && beyond[k] == NONE)
    }

    /// Turns the normals after the sheet.
    fn turn_normals(&mut self) {
        self.sheet.nodes.iter_mut().for_each(|node| node.normal = Vec3::ZERO);
        for t in 0..self.sheet.triangles.len() as u32 {
            let triangle = self.sheet.triangles[t as usize];
            if triangle.live {
                let [a, b, c] = self.sheet.places(t);
                let twice = (b - a).cross(c - a);
                triangle.corners.iter().for_each(|&n| self.sheet.nodes[n as usize].normal += twice);
            }
        }
        self.sheet.nodes.iter_mut().for_each(|node| node.normal = node.normal.normalize_or_zero());
    }
}

/// Where sutures draw a leaf, over its length: upwards and beyond its foot.
const UPRIGHT: (f32, f32) = (0.95, 0.3);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::tests::hexagon;

    const LAW: Law = Law { stretch_n_per_mm: 40.0, poisson: 0.3, strain: 0.0, tears_at: 0.2, below: 0.0 };
    const RADIUS_MM: f32 = 12.0;

    /// A flat round sheet of edges of 1.2 mm or less, held at its rim; node 0 is its middle.
    fn disc(law: Law, rings: i32) -> Dura {
        let (places, triangles) = hexagon(rings);
        // The rings of the hexagon become circles.
        let round = |p: &Vec3| {
            let sixth = std::f32::consts::FRAC_PI_6;
            let (angle, long) = (p.truncate().to_angle(), p.length());
            let off = angle.rem_euclid(2.0 * sixth) - sixth;
            let ring = long * off.cos() / sixth.cos();
            p.normalize_or_zero() * ring * RADIUS_MM / rings as f32
        };
        let rest: Vec<Vec3> = places.iter().map(round).collect();
        let mut dura = Dura::of(Sheet::of(&rest, &triangles), law, (Vec3::ZERO, Vec3::Z, RADIUS_MM / rings as f32));
        dura.pin(0..rest.len(), |_, _| false);
        dura
    }

    /// Moves a tip from a to b in a time, ms, and goes on for as long again; the largest force.
    fn led(dura: &mut Dura, (a, b): (Vec3, Vec3), ms: u32, cuts: bool) -> f32 {
        let from_ms = if dura.now_ms.is_nan() { 0.0 } else { dura.now_ms };
        let mut most_n = 0.0f32;
        for step in 1..=2 * ms {
            let at = a.lerp(b, (step as f32 / ms as f32).min(1.0));
            let tip = Tip { at, radius_mm: 0.4, cuts };
            most_n = most_n.max(dura.step(from_ms + f64::from(step), [Some(tip), None])[0].length());
        }
        most_n
    }

    /// Central load on a clamped sheet without tension.
    ///
    /// `F = E h q³ w³ / a²` with `q = 1 / (1.05 - 0.15 ν - 0.16 ν²)` (Komaragiri, Begley and
    /// Simmonds 2005).
    #[test]
    fn a_tip_that_presses_the_middle_feels_what_theory_says() {
        let q = 1.0 / (1.05 - 0.15 * 0.3 - 0.16 * 0.09f32);
        let over = |rings: i32, deep_mm: f32| {
            let mut dura = disc(LAW, rings);
            led(&mut dura, (Vec3::Z, Vec3::Z * -deep_mm), 1500, false);
            assert_eq!(dura.account().torn, 0);
            let sunk_mm = -dura.sheet.nodes[0].place.z;
            dura.force().z / (40.0 * (q * sunk_mm).powi(3) / RADIUS_MM.powi(2)) - 1.0
        };
        let [coarse, fine] = [6, 24].map(|rings| over(rings, 1.5));
        assert!((0.0..0.1).contains(&fine) && fine < 0.4 * coarse && coarse < 0.3, "{coarse} {fine}");
        assert!((over(6, 2.5) - coarse).abs() < 0.01, "the force grows with the third power");
    }

    /// A clamped sheet under an even pressure rises by `0.653 a (q a / E h)^(1/3)` (Hencky 1915).
    #[test]
    fn under_pressure_the_sheet_bulges_as_hencky_found() {
        let mut dura = disc(LAW, 10);
        let pressure = 2e-3;
        let areas: Vec<f32> = (0..dura.nodes() as u32)
            .map(|n| {
                dura.sheet.triangles.iter().filter(|t| t.corners.contains(&n)).map(|t| t.shape.area_mm2() / 3.0).sum()
            })
            .collect();
        dura.sheet.nodes.iter_mut().zip(areas).for_each(|(node, area)| node.support = pressure * area * Vec3::Z);
        dura.step(0.0, [None; 2]);
        dura.changed();
        (1..400).for_each(|ms| _ = dura.step(f64::from(ms), [None; 2]));
        let theory_mm = 0.653 * RADIUS_MM * (pressure * RADIUS_MM / 40.0).cbrt();
        let mm = dura.sheet.nodes[0].place.z;
        assert!((mm / theory_mm - 1.0).abs() < 0.04, "{mm} mm against {theory_mm}");
    }

    #[test]
    fn a_closed_sheet_stays_and_what_touches_nothing_costs_nothing() {
        let mut dura = disc(Law { strain: 1e-3, ..LAW }, 6);
        (0..2000).for_each(|ms| _ = dura.step(f64::from(ms), [None; 2]));
        assert!(dura.places().zip(&dura.sheet.nodes).all(|(place, node)| place.distance(node.rest) < 1e-4));
        let below = Tip { at: Vec3::Z * -3.0, radius_mm: 1.0, cuts: false };
        assert_eq!(dura.step(2001.0, [Some(below), None]), [Vec3::ZERO; 2], "it did not come from above");
        assert_eq!(dura.step(2002.0, [Some(Tip { at: Vec3::NAN, ..below }), None]), [Vec3::ZERO; 2]);
    }

    /// Two incisions make a cross; its leaves are held back.
    #[test]
    fn a_cross_is_incised_and_its_leaves_leave_a_hole() {
        let run = || {
            let mut dura = disc(Law { strain: 1e-3, below: BELOW, ..LAW }, 8);
            let through = |x: f32, y: f32| Vec3::new(x, y, -1.2);
            led(&mut dura, (Vec3::new(-9.0, 0.3, 1.0), through(-9.0, 0.3)), 200, false);
            assert_eq!(dura.account().incised_mm, 0.0, "it presses and does not cut");
            for (a, b) in [(through(-9.0, 0.3), through(9.0, 0.3)), (through(0.2, -9.0), through(0.2, 9.0))] {
                led(&mut dura, (a + 2.0 * Vec3::Z, a), 100, true);
                led(&mut dura, (a, b), 1500, true);
                led(&mut dura, (b, b + 3.0 * Vec3::Z), 100, false);
            }
            dura
        };
        let mut dura = run();
        let account = *dura.account();
        assert!((34.0..40.0).contains(&account.incised_mm) && account.torn == 0, "{account:?}");
        assert!(dura.is_open() && account.cut_out_mm2 == 0.0, "{account:?}");
        // The middle is four leaves.
        let middle = dura.sheet.nodes.iter().filter(|node| node.rest.distance(Vec3::new(0.2, 0.3, 0.0)) < 0.8).count();
        assert!(middle >= 4, "{middle} corners in the middle");
        let mut words = Vec::with_capacity(dura.most_words());
        dura.save(&mut words);
        assert!(words.len() <= dura.most_words());
        let mut taken = disc(Law { strain: 1e-3, below: BELOW, ..LAW }, 8);
        assert!(taken.restore(&mut words[..words.len() - 1].iter().copied(), 0.0).is_none() && !taken.is_open());
        taken.restore(&mut words.into_iter(), 5.0).unwrap();
        assert!(taken.places().eq(dura.places()) && taken.triangles().eq(dura.triangles()));
        assert_eq!(taken.account().opened_ms, account.opened_ms.map(|ms| ms + 5.0));
        assert!(disc(LAW, 7).restore(&mut [0; 4].into_iter(), 0.0).is_none());
        dura.hold_back();
        let (from_ms, again) = (dura.now_ms, run());
        assert!(dura.places().eq(again.places()), "the same bits again");
        (0..5000).for_each(|ms| _ = dura.step(from_ms + f64::from(ms), [None; 2]));
        let places: Vec<Vec3> = dura.places().collect();
        let over = dura.triangles().filter(|t| {
            let middle: Vec3 = t.iter().map(|n| places[*n as usize]).sum::<Vec3>() / 3.0;
            middle.truncate().length() < 5.0
        });
        assert_eq!((over.count(), dura.account().torn), (0, 0), "the middle is free");
        assert!(places.iter().all(|place| place.is_finite() && place.length() < 25.0));
    }

    /// A sheet on a ball of 75 mm with edges of 2 mm over an opening of 12 mm, as over a flap.
    #[test]
    fn a_cross_over_a_vault_is_incised_from_rim_to_rim() {
        let (places, triangles) = hexagon(10);
        let rest: Vec<Vec3> =
            places.iter().map(|p| 2.0 * *p).map(|p| p - Vec3::Z * p.length_squared() / 150.0).collect();
        let mut dura = Dura::of(
            Sheet::of(&rest, &triangles),
            Law { strain: 8e-4, below: BELOW, ..LAW },
            (Vec3::ZERO, Vec3::Z, 2.0),
        );
        dura.pin(0..rest.len(), |place, _| place.truncate().length() > 12.0);
        for line in dura.cross(10.2, 10) {
            let at = |place: Vec3| place - 1.2 * Vec3::Z;
            led(&mut dura, (line[0] + 5.0 * Vec3::Z, at(line[0])), 100, true);
            for pair in line.windows(2) {
                led(&mut dura, (at(pair[0]), at(pair[1])), 150, true);
            }
            led(&mut dura, (at(line[10]), line[10] + 5.0 * Vec3::Z), 100, false);
        }
        let account = *dura.account();
        assert!((36.0..44.0).contains(&account.incised_mm) && account.torn == 0, "{account:?}");
    }

    #[test]
    fn a_tip_that_is_pushed_on_goes_through_and_lets_fluid_out() {
        let mut dura = disc(LAW, 8);
        led(&mut dura, (Vec3::Z, Vec3::Z * -12.0), 500, false);
        assert!(dura.account().torn > 0 && dura.is_open());
        assert!(dura.places().all(|place| place.is_finite()));
    }

    /// Presses at one or both of two places that the axis mirrors; the forces.
    fn pressed_at(places: [Option<f32>; 2]) -> [f32; 2] {
        let mut dura = disc(LAW, 6);
        let tip = |x: f32, ms: u32| {
            let at = Vec3::new(x, 0.0, 0.4 - 1e-3 * ms.min(600) as f32);
            Tip { at, radius_mm: 0.4, cuts: false }
        };
        let mut forces = [Vec3::ZERO; 2];
        for ms in 0..1500 {
            forces = dura.step(f64::from(ms), places.map(|x| x.map(|x| tip(x, ms))));
        }
        forces.map(|force| force.z)
    }

    #[test]
    fn two_tools_press_the_sheet_each_with_its_force() {
        let both = pressed_at([Some(4.0), Some(-4.0)]);
        let [first, second] = [pressed_at([Some(4.0), None]), pressed_at([None, Some(4.0)])];
        assert!(first == [second[1], second[0]] && first[0] > 0.05 && first[1] == 0.0, "{first:?} {second:?}");
        assert!((both[0] / both[1] - 1.0).abs() < 0.02, "mirrored: {both:?}");
        assert!((both[0] / first[0] - 1.0).abs() > 0.001, "each feels the other: {both:?} {first:?}");
    }
}
