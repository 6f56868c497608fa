//! The moving surface near the tool: which triangles lie in a box, and which point of them is
//! closest.
//!
//! # Theory
//! Border triangles are sorted once along a Morton curve at rest and cut into clusters of 32, each
//! with a box. Every step fits some of the boxes anew to the moved nodes, in turn and spread over
//! the whole surface, and learns from them how far the surface moves between two fits. A box that
//! was not fitted in this step is taken wider by twice that motion; only where such a loose box is
//! near enough to matter is it fitted at once. So a step touches what lies near the tool and a
//! slice of the rest. A box that moved further than its margin is counted as stale: a contact there
//! could have come late by a few steps. Surfaces of up to 1024 triangles are fitted whole at every
//! step and are never stale.
//!
//! ```text
//!   [fit] [loose] [loose] [fit]  ( tool ) -> boxes near it fitted -> their triangles
//!                                         -> exact closest point
//! ```
//!
//! # Practice
//! Cost: 3 ns for each node of a fitted box, 3 ns for each group of 16 clusters, 10 ns for each
//! triangle near the tool. Triangles with a NaN corner are skipped.

use crate::{bounded::push_bounded, extent::Extent, narrow::NONE};
use glam::Vec3A;
use trepan_geometry::{Vec3, closest_weights};
use trepan_mesh::{Csr, FACES, Surface, TetMesh};

/// Triangles in one cluster.
const CLUSTER: usize = 32;
/// Clusters in one group.
const GROUP: usize = 16;
/// Clusters fitted at every step at least.
const SLICE: usize = 12;
/// Steps until an exposed face presses in full; numerical.
const GROWTH: f32 = 20.0;
/// Time of the fit of a cluster that is no border yet.
const UNUSED: u32 = u32::MAX;
/// Motion between two fits of a box that is always allowed for, mm.
const LEAST_MOTION: f32 = 0.5;

/// Closest point on the surface.
#[derive(Clone, Copy, Debug)]
pub struct Foot {
    /// The triangle.
    pub triangle: u32,
    /// Weights of the point on its corners.
    pub weights: [f32; 3],
    /// The point on it, world mm.
    pub point: Vec3,
    /// How far away it is, squared, mm².
    pub distance2: f32,
}

/// Border triangles of a moving mesh, in clusters with boxes.
pub struct MovingSurface {
    /// Node indices, counterclockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The tetrahedron behind each triangle.
    pub tet_of_triangle: Vec<u32>,
    /// Area of each triangle in the mesh as it was given, mm².
    pub rest_area_mm2: Vec<f32>,
    /// Whether each triangle is border now.
    pub live: Vec<bool>,
    /// Triangle of each face of each tetrahedron, or [`NONE`]; empty where nothing can be removed.
    triangle_of_face: Vec<[u32; 4]>,
    may_go: Vec<bool>,
    /// What is left of each tetrahedron, of 1; empty where nothing can be removed.
    left: Vec<f32>,
    /// How far each triangle presses by now, of 1, and those that do not press in full yet.
    grown: Vec<f32>,
    growing: Vec<u32>,
    /// Clusters that have been border, which alone have a box; those since the last fit.
    used: Vec<u32>,
    fresh: Vec<u32>,
    nodes_of_cluster: Csr,
    triangles_of_node: Csr,
    boxes: Vec<Extent>,
    /// Boxes around [`GROUP`] clusters each, at least as large as theirs.
    groups: Vec<Extent>,
    fitted_at: Vec<u32>,
    step: u32,
    motion: f32,
    /// Where the tool works in this step, and the triangles whose box meets it.
    region: Extent,
    here: Vec<(u32, Extent)>,
    /// Box around the whole surface.
    pub(crate) bounds: Extent,
    /// Boxes that were found outside their margin in this step.
    pub stale: u32,
}

impl MovingSurface {
    pub(crate) fn of(mesh: &TetMesh) -> Self {
        Self::over(mesh, &Surface::of(mesh), &[])
    }

    /// The border of a mesh of which some tetrahedra may be removed. Faces in front of those are
    /// listed from the start, after the border. Until one is removed every step has the
    /// same bits as without.
    pub(crate) fn resectable(mesh: &TetMesh, neighbours: &[[u32; 4]], may_go: impl Fn(u32) -> bool) -> Self {
        let mut faces = Surface::default();
        let (mut live, mut order) = (Vec::new(), Vec::new());
        for (tet, next) in neighbours.iter().enumerate() {
            for face in (0..4).filter(|&face| next[face] == NONE || may_go(next[face])) {
                faces.triangles.push(FACES[face].map(|corner| mesh.tets[tet][corner]));
                faces.tet_of_triangle.push(tet as u32);
                live.push(next[face] == NONE);
                order.push([tet as u32, face as u32]);
            }
        }
        let mut surface = Self::over(mesh, &faces, &live);
        surface.used.reserve(surface.boxes.len());
        surface.fresh.reserve(surface.boxes.len());
        surface.may_go = (0..mesh.tets.len() as u32).map(may_go).collect();
        surface.left = vec![1.0; mesh.tets.len()];
        surface.grown = vec![1.0; surface.triangles.len()];
        surface.growing.reserve(surface.triangles.len());
        surface.triangle_of_face = vec![[NONE; 4]; mesh.tets.len()];
        for (triangle, &number) in along_morton_curve(mesh, &faces, &live).iter().enumerate() {
            let [tet, face] = order[number as usize];
            surface.triangle_of_face[tet as usize][face as usize] = triangle as u32;
        }
        surface
    }

    /// Takes the corners of tetrahedra with more nodes than before. Boxes are fitted in the next
    /// step.
    pub(crate) fn follow(&mut self, tets: &[[u32; 4]], nodes: usize) {
        for (of_tet, corners) in self.triangle_of_face.iter().zip(tets) {
            for (triangle, face) in of_tet.iter().zip(&FACES) {
                if let Some(to) = self.triangles.get_mut(*triangle as usize) {
                    *to = face.map(|corner| corners[corner]);
                }
            }
        }
        (self.nodes_of_cluster, self.triangles_of_node) = rows(&self.triangles, nodes);
        self.reset();
    }

    /// Whether a tetrahedron may be removed.
    pub(crate) fn may_go(&self, tet: u32) -> bool {
        self.may_go.get(tet as usize).is_some_and(|may_go| *may_go)
    }

    /// A face is border no more.
    pub(crate) fn cover(&mut self, tet: u32, face: usize) {
        if let Some(live) = self.live.get_mut(self.triangle_of_face[tet as usize][face] as usize) {
            *live = false;
        }
    }

    /// A face becomes border; its cluster is fitted in the next step.
    pub(crate) fn expose(&mut self, tet: u32, face: usize) {
        let triangle = self.triangle_of_face[tet as usize][face];
        let Some(live) = self.live.get_mut(triangle as usize) else { return };
        if !std::mem::replace(live, true) {
            self.grown[triangle as usize] = 0.0;
            self.growing.push(triangle);
        }
        let cluster = triangle / CLUSTER as u32;
        if !self.is_used(cluster as usize) {
            self.used.push(cluster);
            self.fresh.push(cluster);
            self.fitted_at[cluster as usize] = 0;
        }
    }

    /// Tells what is left of a tetrahedron, of 1.
    pub(crate) fn thin(&mut self, tet: u32, left: f32) {
        self.left[tet as usize] = left;
    }

    /// How much a triangle presses, of 1: what is left of its tetrahedron, and less in the first
    /// steps after it was exposed. So no force jumps where a tetrahedron goes.
    pub(crate) fn share(&self, triangle: u32) -> f32 {
        let grown = self.grown.get(triangle as usize).copied().unwrap_or(1.0);
        let tet = self.tet_of_triangle[triangle as usize];
        grown * self.left.get(tet as usize).copied().unwrap_or(1.0)
    }

    fn grow(&mut self) {
        let grown = &mut self.grown;
        self.growing.retain(|&triangle| {
            let share = &mut grown[triangle as usize];
            *share = (*share + 1.0 / GROWTH).min(1.0);
            *share < 1.0
        });
    }

    /// Whether a cluster has been border.
    fn is_used(&self, cluster: usize) -> bool {
        self.fitted_at[cluster] != UNUSED
    }

    /// Clusters of triangles; all of them are border unless `live` says which.
    fn over(mesh: &TetMesh, surface: &Surface, live: &[bool]) -> Self {
        let order = along_morton_curve(mesh, surface, live);
        let triangles: Vec<_> = order.iter().map(|&t| surface.triangles[t as usize]).collect();
        let tet_of_triangle = order.iter().map(|&t| surface.tet_of_triangle[t as usize]).collect();
        let area = |corners: [Vec3; 3]| 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
        let rest_area_mm2 = triangles.iter().map(|nodes| area(nodes.map(|n| mesh.positions[n as usize]))).collect();
        let (nodes_of_cluster, triangles_of_node) = rows(&triangles, mesh.positions.len());
        let clusters = nodes_of_cluster.len();
        let live: Vec<bool> = order.iter().map(|&t| live.get(t as usize).is_none_or(|live| *live)).collect();
        Self {
            triangles_of_node,
            boxes: vec![Extent::EMPTY; clusters],
            groups: vec![Extent::EMPTY; clusters.div_ceil(GROUP)],
            fitted_at: live.chunks(CLUSTER).map(|c| if c.contains(&true) { 0 } else { UNUSED }).collect(),
            step: 0,
            motion: LEAST_MOTION,
            region: Extent::EMPTY,
            here: Vec::with_capacity(triangles.len()),
            stale: 0,
            used: (0..clusters as u32)
                .filter(|c| live[*c as usize * CLUSTER..].iter().take(CLUSTER).any(|l| *l))
                .collect(),
            fresh: Vec::new(),
            may_go: Vec::new(),
            left: Vec::new(),
            grown: Vec::new(),
            growing: Vec::new(),
            triangle_of_face: Vec::new(),
            live,
            nodes_of_cluster,
            triangles,
            tet_of_triangle,
            rest_area_mm2,
            bounds: Extent::EMPTY,
        }
    }

    /// Forgets all boxes; the next step fits them all.
    pub fn reset(&mut self) {
        (self.step, self.motion) = (0, LEAST_MOTION);
    }

    /// Begins a step: fits a slice of the boxes to the moved nodes, all of them in the first step,
    /// and those that meet `region`.
    pub fn refit(&mut self, positions: &[Vec3], region: Extent) {
        if self.step == u32::MAX {
            self.reset();
        }
        let turns = if self.step == 0 { 1 } else { self.used.len().div_ceil(SLICE).max(1) };
        self.step += 1;
        self.grow();
        (self.stale, self.motion) = (0, LEAST_MOTION.max(0.9 * self.motion));
        for at in (self.step as usize % turns..self.used.len()).step_by(turns) {
            self.fit(positions, self.used[at] as usize);
        }
        while let Some(cluster) = self.fresh.pop() {
            self.fitted(positions, cluster as usize);
        }
        self.tighten(self.step as usize % self.groups.len().max(1));
        (self.region, self.bounds) = (region, Extent::EMPTY);
        self.groups.iter().for_each(|group| self.bounds.merge(group));
        self.bounds = self.bounds.widened(2.0 * self.motion);
        self.here.clear();
        for group in 0..self.groups.len() {
            for cluster in self.clusters_near(group, &region) {
                if self.is_near(positions, cluster, &region) {
                    self.list_here(positions, cluster);
                }
            }
        }
    }

    /// The clusters of a group, none when its loose box does not meet a region.
    fn clusters_near(&self, group: usize, region: &Extent) -> core::ops::Range<usize> {
        match self.groups[group].widened(2.0 * self.motion).overlaps(region) {
            true => group * GROUP..((group + 1) * GROUP).min(self.boxes.len()),
            false => 0..0,
        }
    }

    /// Whether a cluster's box, fitted in this step, meets a region.
    fn is_near(&mut self, positions: &[Vec3], cluster: usize, region: &Extent) -> bool {
        self.is_used(cluster)
            && self.loose(cluster).overlaps(region)
            && self.fitted(positions, cluster).overlaps(region)
    }

    /// Takes a group's box from its clusters anew; between such turns it only grows.
    fn tighten(&mut self, group: usize) {
        let members = group * GROUP..((group + 1) * GROUP).min(self.boxes.len());
        let mut bounds = Extent::EMPTY;
        self.boxes[members].iter().for_each(|b| bounds.merge(b));
        if let Some(of_group) = self.groups.get_mut(group) {
            *of_group = bounds;
        }
    }

    fn list_here(&mut self, positions: &[Vec3], cluster: usize) {
        for t in self.triangles_of(cluster) {
            let bounds = self.box_of(positions, t);
            if bounds.overlaps(&self.region) {
                self.here.push((t, bounds));
            }
        }
    }

    /// Adds the triangles whose boxes meet `region` to `near`, up to its capacity; returns how many
    /// did not fit.
    pub fn gather(&mut self, positions: &[Vec3], region: &Extent, near: &mut Vec<u32>) -> u32 {
        let mut overflow = 0;
        let mut take = |t: u32| overflow += push_bounded(near, t);
        if self.region.holds(region) {
            self.here.iter().filter(|(_, bounds)| bounds.overlaps(region)).for_each(|&(t, _)| take(t));
            return overflow;
        }
        for group in 0..self.groups.len() {
            for cluster in self.clusters_near(group, region) {
                if self.is_near(positions, cluster, region) {
                    let met = |t: &u32| self.box_of(positions, *t).overlaps(region);
                    self.triangles_of(cluster).filter(met).for_each(&mut take);
                }
            }
        }
        overflow
    }

    /// Box of a triangle; empty when a corner is not finite, or it is no border.
    #[inline]
    fn box_of(&self, positions: &[Vec3], t: u32) -> Extent {
        let [a, b, c] = self.corners(positions, t).map(Vec3A::from);
        match self.live[t as usize] && (a + b + c).is_finite() {
            true => Extent { low: a.min(b).min(c), high: a.max(b).max(c) },
            false => Extent::EMPTY,
        }
    }

    /// The closest point of the surface that lies in the region given to [`refit`](Self::refit) and
    /// is nearer than `within` mm.
    pub(crate) fn closest_here(&self, positions: &[Vec3], to: Vec3, within: f32) -> Option<Foot> {
        let (mut best, mut bound): (Option<Foot>, _) = (None, within * within);
        for (t, bounds) in &self.here {
            if bounds.distance2(to) < bound {
                best = self.closest_among(positions, [*t].into_iter(), to, best);
                bound = best.map_or(bound, |b| b.distance2.min(bound));
            }
        }
        best.filter(|b| b.distance2 < within * within)
    }

    /// The closest point of the whole surface; the nearest box first, then only boxes nearer than
    /// the best so far.
    pub fn closest(&mut self, positions: &[Vec3], to: Vec3) -> Option<Foot> {
        let (mut first, mut nearest) = (None, f32::INFINITY);
        for cluster in 0..self.boxes.len() {
            let distance2 = self.loose(cluster).distance2(to);
            if distance2 < nearest && self.is_used(cluster) {
                (first, nearest) = (Some(cluster), distance2);
            }
        }
        let mut best = self.closest_among(positions, self.triangles_of(first?), to, None);
        for cluster in 0..self.boxes.len() {
            let bound = best.map_or(f32::INFINITY, |b| b.distance2);
            let may_be_nearer = self.is_used(cluster) && self.loose(cluster).distance2(to) < bound;
            if may_be_nearer && self.fitted(positions, cluster).distance2(to) < bound {
                best = self.closest_among(positions, self.triangles_of(cluster), to, best);
            }
        }
        best
    }

    /// The closest point on the given triangles, or `best` when none is nearer.
    pub(crate) fn closest_among(
        &self,
        positions: &[Vec3],
        among: impl Iterator<Item = u32>,
        to: Vec3,
        best: Option<Foot>,
    ) -> Option<Foot> {
        among.filter(|&t| self.live[t as usize]).fold(best, |best, t| {
            let foot = self.foot(positions, t, to);
            match best {
                Some(b) if b.distance2 <= foot.distance2 => Some(b),
                _ if foot.distance2.is_finite() => Some(foot),
                _ => best,
            }
        })
    }

    /// Walks from a triangle over those that share a node with it to a local minimum of the
    /// distance.
    pub(crate) fn descend(&self, positions: &[Vec3], from: u32, to: Vec3) -> Option<Foot> {
        let mut best = Some(self.foot(positions, from, to)).filter(|f| f.distance2.is_finite());
        for _ in 0..MAX_DESCENT {
            let here = best?.triangle;
            let around =
                self.triangles[here as usize].into_iter().flat_map(|n| self.triangles_of_node.row(n as usize)).copied();
            best = self.closest_among(positions, around, to, best);
            if best?.triangle == here {
                break;
            }
        }
        best
    }

    /// The nodes around a foot, with their weights.
    pub fn weights_at(&self, foot: &Foot) -> [(u32, f32); 3] {
        let nodes = self.triangles[foot.triangle as usize];
        core::array::from_fn(|c| (nodes[c], foot.weights[c]))
    }

    /// Unit normal of the flat triangle, outwards; zero when it has no area.
    pub fn flat_normal(&self, positions: &[Vec3], t: u32) -> Vec3 {
        let [a, b, c] = self.corners(positions, t);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Corners of a border triangle, mm.
    #[inline]
    pub fn corners(&self, positions: &[Vec3], t: u32) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[t as usize];
        [positions[a as usize], positions[b as usize], positions[c as usize]]
    }

    /// The box of a cluster, widened by what it may have moved since it was fitted.
    #[inline]
    fn loose(&self, cluster: usize) -> Extent {
        let is_fitted = self.fitted_at[cluster] == self.step;
        self.boxes[cluster].widened(if is_fitted { 0.0 } else { 2.0 * self.motion })
    }

    /// The box of a cluster, fitted in this step.
    fn fitted(&mut self, positions: &[Vec3], cluster: usize) -> Extent {
        if self.fitted_at[cluster] != self.step {
            self.fit(positions, cluster);
        }
        self.boxes[cluster]
    }

    fn fit(&mut self, positions: &[Vec3], cluster: usize) {
        let mut fitted = Extent::EMPTY;
        for &n in self.nodes_of_cluster.row(cluster) {
            fitted.grow(positions[n as usize]);
        }
        if self.step > 1 && self.fitted_at[cluster] > 0 {
            let moved = fitted.moved_from(&self.boxes[cluster]);
            self.stale += u32::from(moved > 2.0 * self.motion && self.step - self.fitted_at[cluster] > 1);
            self.motion = self.motion.max(moved);
        }
        (self.boxes[cluster], self.fitted_at[cluster]) = (fitted, self.step);
        self.groups[cluster / GROUP].merge(&fitted);
    }

    fn foot(&self, positions: &[Vec3], t: u32, to: Vec3) -> Foot {
        let corners = self.corners(positions, t);
        let weights = closest_weights(corners, to);
        let point = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
        Foot { triangle: t, weights, point, distance2: point.distance_squared(to) }
    }

    fn triangles_of(&self, cluster: usize) -> core::ops::Range<u32> {
        (cluster * CLUSTER) as u32..((cluster + 1) * CLUSTER).min(self.triangles.len()) as u32
    }
}

/// Nodes of each cluster of triangles, and triangles of each of so many nodes.
fn rows(triangles: &[[u32; 3]], nodes: usize) -> (Csr, Csr) {
    let around = triangles.iter().enumerate().flat_map(|(t, nodes)| nodes.map(|n| (n, t as u32)));
    let clusters = triangles.chunks(CLUSTER).map(|cluster| cluster.iter().flatten().copied());
    (distinct_rows(clusters), Csr::of_pairs(nodes, around))
}

/// Most triangles crossed in one descent.
const MAX_DESCENT: usize = 64;

/// Triangle numbers sorted by the Morton code of their centre at rest, the border first. So the
/// border has the numbers that it has without those that are no border yet.
fn along_morton_curve(mesh: &TetMesh, surface: &Surface, live: &[bool]) -> Vec<u32> {
    let bounds = mesh.bounds();
    let scale = 1023.0 / bounds.size().max_element().max(f32::MIN_POSITIVE);
    let code = |t: &u32| {
        let [a, b, c] = surface.triangles[*t as usize].map(|n| mesh.positions[n as usize]);
        let cell = (((a + b + c) / 3.0 - bounds.min) * scale).as_uvec3();
        let is_hidden = live.get(*t as usize).is_some_and(|live| !live);
        (is_hidden, spread_bits(cell.x) | spread_bits(cell.y) << 1 | spread_bits(cell.z) << 2)
    };
    let mut order: Vec<u32> = (0..surface.triangles.len() as u32).collect();
    order.sort_by_cached_key(code);
    order
}

/// Ten bits, two zeros between each.
fn spread_bits(x: u32) -> u32 {
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

/// Rows of numbers, each sorted and without repetition.
pub fn distinct_rows(rows: impl Iterator<Item = impl Iterator<Item = u32>>) -> Csr {
    let mut csr = Csr { starts: vec![0], items: Vec::new() };
    for row in rows {
        let mut row: Vec<u32> = row.collect();
        row.sort_unstable();
        row.dedup();
        csr.items.extend(row);
        csr.starts.push(csr.items.len() as u32);
    }
    csr
}

const _: () = assert!(NONE == trepan_mesh::NONE);
