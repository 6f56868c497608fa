//! A triangle mesh that is cut along its edges.
//!
//! # Practice
//! A node is copied where a cut leaves its triangles in two fans. There is room for as many copies
//! as there were nodes; after that nothing is cut. No call allocates.

use crate::membrane::Shape;
use crate::over::Foot;
use trepan_geometry::Vec3;

/// No triangle.
pub(crate) const NONE: u32 = u32::MAX;
/// Triangles around a node at most, numerical.
const FAN: usize = 24;

/// A node of the sheet. Places are relative to the sheet's middle, mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub rest: Vec3,
    pub place: Vec3,
    pub velocity: Vec3,
    pub force: Vec3,
    /// Outward, of length 1.
    pub normal: Vec3,
    /// What bears it at rest, N: the fluid below.
    pub support: Vec3,
    pub mass: f32,
    /// What bears it of the brain, and how far that has moved outwards, mm.
    pub foot: Option<Foot>,
    pub risen_mm: f32,
    /// Spring of the brain below, N/mm.
    pub below: f32,
    /// Whether bone holds it.
    pub pinned: bool,
    /// Whether it is on the sheet's own rim, which is always held.
    pub rim: bool,
    /// A triangle that it is a corner of.
    pub triangle: u32,
    /// Where a suture draws it.
    pub suture: Option<Vec3>,
}

/// A triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Nodes, counterclockwise from outside.
    pub corners: [u32; 3],
    /// The triangle across the edge from each corner to the next.
    pub beyond: [u32; 3],
    pub shape: Shape,
    pub live: bool,
}

/// A point of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub triangle: u32,
    /// Weights on the corners, which sum to 1.
    pub weights: [f32; 3],
}

/// The mesh.
#[derive(Clone, Debug)]
pub(crate) struct Sheet {
    /// Most nodes, with all copies.
    pub room: usize,
    pub nodes: Vec<Node>,
    pub triangles: Vec<Triangle>,
    /// Scratch of a search: whether each triangle was reached, and those to go on from.
    reached: Vec<bool>,
    open: Vec<u32>,
}

/// The triangles around a node that no cut parts.
pub(crate) struct Fan {
    triangles: [u32; FAN],
    count: usize,
    /// Whether they go all the way around.
    pub closed: bool,
}

impl Fan {
    pub fn triangles(&self) -> &[u32] {
        &self.triangles[..self.count]
    }

    fn push(&mut self, triangle: u32) {
        if self.count < FAN {
            self.triangles[self.count] = triangle;
            self.count += 1;
        }
    }
}

impl Sheet {
    /// Of places relative to the middle and triangles over them.
    pub fn of(rest: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut edges = std::collections::BTreeMap::new();
        for (t, corners) in triangles.iter().enumerate() {
            (0..3).for_each(|k| _ = edges.insert((corners[k], corners[(k + 1) % 3]), t as u32));
        }
        let beyond = |corners: &[u32; 3]| {
            [0, 1, 2].map(|k| edges.get(&(corners[(k + 1) % 3], corners[k])).copied().unwrap_or(NONE))
        };
        let triangle = |corners: &[u32; 3]| Triangle {
            corners: *corners,
            beyond: beyond(corners),
            shape: Shape::of(corners.map(|n| rest[n as usize])),
            live: true,
        };
        let mut nodes = Vec::with_capacity(2 * rest.len());
        nodes.extend(rest.iter().map(|&rest| Node {
            rest,
            place: rest,
            velocity: Vec3::ZERO,
            force: Vec3::ZERO,
            normal: Vec3::ZERO,
            support: Vec3::ZERO,
            mass: 1.0,
            below: 0.0,
            foot: None,
            risen_mm: 0.0,
            pinned: true,
            rim: true,
            triangle: NONE,
            suture: None,
        }));
        for (t, corners) in triangles.iter().enumerate() {
            corners.iter().for_each(|&n| nodes[n as usize].triangle = t as u32);
        }
        let (reached, open) = (vec![false; triangles.len()], Vec::with_capacity(triangles.len()));
        let mut sheet =
            Self { room: 2 * rest.len(), nodes, triangles: triangles.iter().map(triangle).collect(), reached, open };
        (0..rest.len()).for_each(|n| sheet.nodes[n].rim = !sheet.fan_of(n as u32).closed);
        sheet
    }

    /// A triangle's corners at their present places.
    pub fn places(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].corners.map(|n| self.nodes[n as usize].place)
    }

    /// A triangle's corners at rest.
    fn at_rest(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].corners.map(|n| self.nodes[n as usize].rest)
    }

    fn corner(&self, triangle: u32, node: u32) -> usize {
        self.triangles[triangle as usize].corners.iter().position(|&n| n == node).unwrap_or_default()
    }

    /// The triangles around a node, from one of them on.
    pub fn fan(&self, node: u32, from: u32) -> Fan {
        let mut fan = Fan { triangles: [NONE; FAN], count: 0, closed: false };
        let mut at = from;
        while at != NONE && fan.count < FAN {
            fan.push(at);
            at = self.triangles[at as usize].beyond[(self.corner(at, node) + 2) % 3];
            if at == from {
                fan.closed = true;
                return fan;
            }
        }
        at = self.triangles[from as usize].beyond[self.corner(from, node)];
        while at != NONE && fan.count < FAN {
            fan.push(at);
            at = self.triangles[at as usize].beyond[self.corner(at, node)];
        }
        fan
    }

    /// The fan of a node around the triangle that it keeps.
    pub fn fan_of(&self, node: u32) -> Fan {
        match self.nodes[node as usize].triangle {
            NONE => Fan { triangles: [NONE; FAN], count: 0, closed: false },
            from => self.fan(node, from),
        }
    }

    /// Cuts the edge between two nodes of one fan; returns its length at rest, mm, or 0 where there
    /// is none that joins two triangles.
    pub fn cut(&mut self, from: u32, to: u32) -> f32 {
        let joins = |t: u32| {
            let corners = self.triangles[t as usize].corners;
            (0..3).find(|&k| {
                corners[k] == from && corners[(k + 1) % 3] == to || corners[k] == to && corners[(k + 1) % 3] == from
            })
        };
        let found = self.fan_of(from).triangles().iter().find_map(|&t| joins(t).map(|edge| (t, edge)));
        let Some((left, edge)) = found else { return 0.0 };
        let right = self.triangles[left as usize].beyond[edge];
        if right == NONE || self.nodes.len() + 2 > self.room {
            return 0.0;
        }
        self.part(left, right);
        for node in [from, to] {
            let fan = self.fan(node, right);
            if !fan.triangles().contains(&left) {
                let copy = self.nodes.len() as u32;
                self.nodes.push(Node { triangle: right, ..self.nodes[node as usize] });
                self.nodes[node as usize].triangle = left;
                for &t in fan.triangles() {
                    let corner = self.corner(t, node);
                    self.triangles[t as usize].corners[corner] = copy;
                }
            }
        }
        self.nodes[from as usize].rest.distance(self.nodes[to as usize].rest)
    }

    /// Parts two triangles.
    fn part(&mut self, one: u32, other: u32) {
        for (at, from) in [(one, other), (other, one)] {
            self.triangles[at as usize].beyond.iter_mut().filter(|next| **next == from).for_each(|next| *next = NONE);
        }
    }

    /// Takes a triangle away.
    pub fn remove(&mut self, triangle: u32) {
        let Triangle { corners, beyond, .. } = self.triangles[triangle as usize];
        self.triangles[triangle as usize].live = false;
        for next in beyond.into_iter().filter(|next| *next != NONE) {
            self.part(triangle, next);
        }
        for node in corners {
            let others = |t: &Triangle| t.live && t.corners.contains(&node);
            if self.nodes[node as usize].triangle == triangle {
                self.nodes[node as usize].triangle = self.triangles.iter().position(others).map_or(NONE, |t| t as u32);
            }
        }
    }

    /// Mean of a triangle's nodes in a point; its normal has length 1.
    pub fn mean(&self, at: &Point) -> Node {
        let corners = self.triangles[at.triangle as usize].corners.map(|n| self.nodes[n as usize]);
        let mean = |of: fn(&Node) -> Vec3| -> Vec3 { (0..3).map(|k| at.weights[k] * of(&corners[k])).sum() };
        let normal = mean(|node| node.normal).normalize_or_zero();
        Node { rest: mean(|node| node.rest), place: mean(|node| node.place), normal, ..corners[0] }
    }

    /// Whether a node lies on an incision.
    pub fn is_incised(&self, node: u32) -> bool {
        !self.nodes[node as usize].rim && !self.fan_of(node).closed
    }

    /// Nodes that an edge joins to one.
    pub fn beside(&self, node: u32) -> impl Iterator<Item = u32> + '_ {
        let fan = self.fan_of(node);
        let corners = move |k: usize| self.triangles[fan.triangles()[k] as usize].corners;
        (0..self.fan_of(node).triangles().len()).flat_map(corners).filter(move |&n| n != node)
    }

    /// Moves a node in the sheet to a point of it, unless a triangle would become a sliver.
    ///
    /// Returns whether it did. A node of the border stays.
    pub fn snap(&mut self, node: u32, at: &Point) -> bool {
        let Node { rest, place, .. } = self.mean(at);
        let fan = self.fan_of(node);
        if !fan.closed || self.nodes[node as usize].pinned {
            return false;
        }
        let old = std::mem::replace(&mut self.nodes[node as usize].rest, rest);
        let is_sound = |&t: &u32| {
            let [a, b, c] = self.at_rest(t);
            let corners = self.triangles[t as usize].corners;
            let before = corners.map(|n| if n == node { old } else { self.nodes[n as usize].rest });
            let was = (before[1] - before[0]).cross(before[2] - before[0]);
            let now = (b - a).cross(c - a);
            let longest = [a.distance(b), b.distance(c), c.distance(a)].into_iter().fold(0.0, f32::max);
            now.dot(was) > 0.0 && now.length() > SLIVER * longest * longest
        };
        if !fan.triangles().iter().all(is_sound) {
            self.nodes[node as usize].rest = old;
            return false;
        }
        self.nodes[node as usize].place = place;
        for &t in fan.triangles() {
            self.triangles[t as usize].shape = Shape::of(self.at_rest(t));
        }
        true
    }

    /// Words that [`save`](Self::save) appends at most.
    pub fn most_words(&self) -> usize {
        1 + 6 * self.room + 4 * self.triangles.len()
    }

    /// Appends nodes and triangles.
    pub fn save(&self, to: &mut Vec<u64>) {
        let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
        let floats = |a: f32, b: f32| pair(a.to_bits(), b.to_bits());
        to.push(self.nodes.len() as u64);
        for Node { rest, place, pinned, rim, triangle, suture, .. } in &self.nodes {
            to.extend([floats(rest.x, rest.y), floats(rest.z, place.x), floats(place.y, place.z)]);
            let flags = [*pinned, *rim, suture.is_some()].iter().fold(0, |flags, flag| 2 * flags + u32::from(*flag));
            to.push(pair(flags, *triangle));
            let suture = suture.unwrap_or(Vec3::ZERO);
            to.extend([floats(suture.x, suture.y), floats(suture.z, 0.0)]);
        }
        for Triangle { corners: [a, b, c], beyond: [d, e, f], live, .. } in &self.triangles {
            to.extend([pair(*a, *b), pair(*c, *d), pair(*e, *f), u64::from(*live)]);
        }
    }

    /// Takes over what a sheet over the same place saved; `None`, and no change, if it does not
    /// fit.
    pub fn restore(&mut self, words: &mut impl Iterator<Item = u64>) -> Option<()> {
        let mut pair = || words.next().map(|word| [(word >> 32) as u32, word as u32]);
        let count = pair()?[1];
        let first = *self.nodes.first()?;
        let mut nodes = Vec::with_capacity(2 * self.room);
        for _ in 0..count.min(self.room as u32) {
            let all = [pair()?, pair()?, pair()?];
            let [rx, ry, rz, px, py, pz] = all.as_flattened() else { return None };
            let [rest, place] = [[rx, ry, rz], [px, py, pz]].map(|at| Vec3::from(at.map(|bits| f32::from_bits(*bits))));
            let [flags, triangle] = pair()?;
            let [[sx, sy], [sz, _]] = [pair()?, pair()?];
            let suture = (flags & 1 == 1).then(|| Vec3::from([sx, sy, sz].map(f32::from_bits)));
            let (pinned, rim) = (flags >> 2 & 1 == 1, flags >> 1 & 1 == 1);
            let foot = self.nodes.get(nodes.len()).and_then(|node| node.foot);
            nodes.push(Node { rest, place, pinned, rim, triangle, suture, foot, support: Vec3::ZERO, ..first });
        }
        let mut triangles = Vec::with_capacity(self.triangles.len());
        for _ in 0..self.triangles.len() {
            let [[a, b], [c, d], [e, f], [_, live]] = [pair()?, pair()?, pair()?, pair()?];
            let (corners, beyond) = ([a, b, c], [d, e, f]);
            if corners.iter().any(|&n| n >= count) {
                return None;
            }
            let shape = Shape::of(corners.map(|n| nodes[n as usize].rest));
            triangles.push(Triangle { corners, beyond, shape, live: live == 1 });
        }
        let known = |t: u32| t == NONE || (t as usize) < triangles.len();
        let is_sound =
            nodes.iter().all(|node: &Node| known(node.triangle) && node.rest.is_finite() && node.place.is_finite())
                && nodes.len() == count as usize
                && triangles.iter().all(|t| t.beyond.into_iter().all(known));
        is_sound.then(|| (self.nodes, self.triangles) = (nodes, triangles))
    }

    /// Takes away what no pinned node holds any more; returns its area, mm².
    pub fn remove_loose(&mut self) -> f32 {
        self.reached.fill(false);
        self.open.clear();
        for (t, triangle) in self.triangles.iter().enumerate() {
            if triangle.live && triangle.corners.iter().any(|&n| self.nodes[n as usize].pinned) {
                self.reached[t] = true;
                self.open.push(t as u32);
            }
        }
        while let Some(t) = self.open.pop() {
            for next in self.triangles[t as usize].beyond.into_iter().filter(|next| *next != NONE) {
                if !std::mem::replace(&mut self.reached[next as usize], true) {
                    self.open.push(next);
                }
            }
        }
        let mut area_mm2 = 0.0;
        for (triangle, _) in self.triangles.iter_mut().zip(&self.reached).filter(|(t, reached)| t.live && !**reached) {
            triangle.live = false;
            area_mm2 += triangle.shape.area_mm2();
        }
        area_mm2
    }
}

/// Twice the area of a triangle over the square of its longest edge, at least, numerical.
const SLIVER: f32 = 0.3;

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A flat hexagon of triangles of a unit edge, `rings` around the middle, node 0.
    pub(crate) fn hexagon(rings: i32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (mut places, mut number) = (Vec::new(), std::collections::BTreeMap::new());
        let mut cells: Vec<(i32, i32)> = (-rings..=rings)
            .flat_map(|i| (-rings..=rings).map(move |j| (i, j)))
            .filter(|(i, j)| (i + j).abs() <= rings)
            .collect();
        cells.sort_by_key(|(i, j)| i.abs().max(j.abs()).max((i + j).abs()));
        for (i, j) in cells {
            number.insert((i, j), places.len() as u32);
            places.push(Vec3::new(i as f32 + 0.5 * j as f32, 0.75f32.sqrt() * j as f32, 0.0));
        }
        let mut triangles = Vec::new();
        for &(i, j) in number.keys() {
            for others in [[(i + 1, j), (i, j + 1)], [(i + 1, j - 1), (i + 1, j)]] {
                let all = [Some(number[&(i, j)]), number.get(&others[0]).copied(), number.get(&others[1]).copied()];
                if let [Some(a), Some(b), Some(c)] = all {
                    triangles.push([a, b, c]);
                }
            }
        }
        (places, triangles)
    }

    /// Sets which nodes are pinned: those of the outermost ring.
    pub(crate) fn pinned_at_rim(rings: i32) -> Sheet {
        let (places, triangles) = hexagon(rings);
        let mut sheet = Sheet::of(&places, &triangles);
        sheet.nodes.iter_mut().for_each(|node| node.pinned = node.rim);
        sheet
    }

    fn edges(sheet: &Sheet) -> usize {
        sheet.triangles.iter().filter(|t| t.live).flat_map(|t| t.beyond).filter(|next| *next == NONE).count()
    }

    #[test]
    fn a_cut_parts_the_sheet_and_a_closed_one_sets_a_piece_free() {
        let mut sheet = pinned_at_rim(3);
        let (nodes, border) = (sheet.nodes.len(), edges(&sheet));
        assert_eq!((nodes, border, sheet.triangles.len()), (37, 18, 54));
        // Around the middle: the six nodes of the first ring, in order.
        let ring: Vec<u32> = {
            let mut ring: Vec<u32> = (1..7).collect();
            ring.sort_by(|a, b| {
                let angle = |n: &u32| sheet.nodes[*n as usize].rest.truncate().to_angle();
                angle(a).total_cmp(&angle(b))
            });
            ring
        };
        for k in 0..5 {
            assert_eq!(sheet.cut(ring[k], ring[k + 1]), 1.0, "{k}");
            assert_eq!(edges(&sheet), border + 2 * (k + 1));
            assert_eq!(sheet.nodes.len(), nodes + k, "the ends of a cut are whole");
            assert_eq!(sheet.remove_loose(), 0.0);
        }
        assert_eq!(sheet.cut(ring[0], ring[1]), 0.0, "cut already");
        // The last edge joins its ends by whichever copies still share a fan.
        let copies = [ring[5], ring[0]].map(|node| {
            let rest = sheet.nodes[node as usize].rest;
            (0..sheet.nodes.len() as u32).filter(|&n| sheet.nodes[n as usize].rest == rest).collect::<Vec<_>>()
        });
        let pairs: Vec<(u32, u32)> = copies[0].iter().flat_map(|&a| copies[1].iter().map(move |&b| (a, b))).collect();
        assert_eq!(pairs.iter().map(|&(a, b)| sheet.cut(a, b)).sum::<f32>(), 1.0);
        let loose = sheet.remove_loose();
        assert!((loose - 6.0 * 0.75f32.sqrt() / 2.0).abs() < 1e-5, "{loose}");
        assert_eq!(edges(&sheet), border + 6, "a hole is left");
    }

    #[test]
    fn a_node_moves_in_the_sheet_but_makes_no_sliver_and_leaves_no_border() {
        let mut sheet = pinned_at_rim(2);
        let area = |sheet: &Sheet| sheet.triangles.iter().map(|t| t.shape.area_mm2()).sum::<f32>();
        let whole = area(&sheet);
        // Towards the second corner of a triangle of the middle.
        let triangle = sheet.fan_of(0).triangles()[0];
        let middle = sheet.corner(triangle, 0);
        let at = |share: f32| {
            let mut weights = [0.0; 3];
            (weights[middle], weights[(middle + 1) % 3]) = (1.0 - share, share);
            Point { triangle, weights }
        };
        assert!(sheet.snap(0, &at(0.3)) && sheet.nodes[0].rest.length() > 0.29);
        assert!((area(&sheet) - whole).abs() < 1e-5);
        assert!(!sheet.snap(0, &at(0.95)), "a sliver");
        let rim = (0..sheet.nodes.len() as u32).find(|n| sheet.nodes[*n as usize].rim).unwrap();
        assert!(!sheet.snap(rim, &at(0.1)), "a node of the rim");
    }
}
