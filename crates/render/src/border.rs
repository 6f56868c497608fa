//! What is seen of the brain: a cortex, or the boundary of the tetrahedra, with smooth normals.
//!
//! # Practice
//! With a cortex its vertices sit in the tetrahedra and move with them; the faces that a resection
//! bares are the tetrahedra's. Without one the boundary of what is left is shown.

use crate::chunks::{self, Chunk, MANY};
use crate::cut::height;
use crate::embedding::{Embedding, embeddings};
use crate::frame::Cortex;
use crate::touch::touch;
use crate::walls::Walls;
use crate::{Leaves, RenderError};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use trepan_mesh::{NONE, Split, Surface, TetMesh};

/// The tetrahedra and their boundary, current and at rest.
#[derive(Clone, Debug)]
pub(crate) struct Border {
    /// The whole brain, before a resection.
    whole: Arc<Whole>,
    /// Which of its tetrahedra are gone; empty where none is.
    gone: Vec<bool>,
    /// Nodes that were split.
    splits: Vec<Split>,
    /// Vertices of what is shown, in the tetrahedra.
    embeddings: Vec<Embedding>,
    /// Triangles over the vertices.
    pub triangles: Vec<[u32; 3]>,
    /// All triangles in chunks.
    pub chunks: Vec<Chunk>,
    /// The longest way of a vertex of the brain from rest, mm.
    pub moved_mm: f32,
    /// The tetrahedra that are left, over all nodes.
    pub tets: Vec<[u32; 4]>,
    /// Boundary of what is left, over all nodes; empty without a cortex.
    faces: Vec<[u32; 3]>,
    /// Walls of a hole in a cortex; their vertices come after those of the cortex.
    walls: Walls,
    first_wall: usize,
    /// All nodes at rest, world mm.
    pub rest: Vec<Vec3>,
    /// All current nodes, world mm.
    pub now: Vec<Vec3>,
    /// Vertices at rest, world mm.
    pub at_rest: Vec<Vec3>,
    /// Current vertices, world mm.
    pub places: Vec<Vec3>,
    /// Current unit normals of vertices.
    pub normals: Vec<Vec3>,
    /// Blood on vertices, mm; -1 for a burn, [`DURA`] on the dura.
    pub stains: Vec<f32>,
    /// Ways to vessels at each vertex, and the light of the surroundings there, 0 to 1.
    pub looks: Vec<Vec4>,
    /// The brain's own triangles, before those of the dura.
    pub own: usize,
    /// Vertices of the dura, after the brain's.
    leaves: usize,
    /// Way from nodes of the boundary to the cortex at rest, mm, where walls ended.
    to_cortex: BTreeMap<u32, Vec3>,
    /// Whether walls with these nodes lie within the cortex.
    within: BTreeMap<[u32; 3], bool>,
    /// Vertices that lie on what a tool touches.
    touched: Vec<u32>,
    /// The nodes' stains, as they were given last.
    stained: Option<Vec<u8>>,
    /// What changed since `settle`.
    pub changes: Changes,
}

/// What of a border looks different than before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    /// Whether nothing is as it was, or nobody knows.
    pub all: bool,
    /// Whether each vertex moved.
    pub moved: Vec<bool>,
    /// Whether each vertex looks different: its normal or its stain.
    turned: Vec<bool>,
    /// The triangles that look different, in order.
    pub triangles: Vec<u32>,
}

/// Motion of a node that is not followed, mm, numerical: a third of a pixel of 1280x800 where the
/// view is 75 mm wide.
const STILL_MM: f32 = 0.03;

/// All nodes or triangles count as changed once one in so many did, numerical.
const MOST: usize = 2;

/// Whether a place is so near to where it was that it may stay there.
fn is_still(was: Vec3, is: Vec3) -> bool {
    was.distance_squared(is) < STILL_MM * STILL_MM
}

/// The whole brain.
#[derive(Debug)]
struct Whole {
    nodes: usize,
    tets: Vec<[u32; 4]>,
    /// Faces of the boundary, and the same in order; empty without a cortex.
    faces: Vec<[u32; 3]>,
    known: BTreeSet<[u32; 3]>,
    /// Whether each node is on the boundary; empty without a cortex.
    is_rim: Vec<bool>,
    /// The cortex at rest, its places and normals.
    cortex: Vec<(Vec3, Vec3)>,
    embeddings: Vec<Embedding>,
    triangles: Vec<[u32; 3]>,
    looks: Vec<Vec4>,
}

/// What is shown of a cortex.
struct CortexParts {
    embeddings: Vec<Embedding>,
    looks: Vec<Vec4>,
    triangles: Vec<[u32; 3]>,
}

/// How far outside the cortex the middle of a wall's triangle may be, mm, numerical.
const OUTSIDE_MM: f32 = 0.5;

/// Stain of the dura.
pub(crate) const DURA: f32 = -2.0;
/// Depth in a sulcus over which the light of the surroundings falls by 63 %, mm, numerical.
const DARK_MM: f32 = 3.5;
/// Light of the surroundings deep in a sulcus, numerical.
const DARKEST: f32 = 0.25;

/// Look of what bears no vessels; that of walls has more light.
const BARE: Vec4 = Vec4::new(1.0, 1.0, 1.0, PIA);
/// Light of the surroundings that reaches what lies open under its pia; bare tissue has more.
pub(crate) const PIA: f32 = 0.99;
/// Numbers of waves of veins, arteries and their branches, 1/mm, numerical: veins lie some 20 mm
/// apart, branches 5 mm.
const WAVES: [f32; 3] = [0.16, 0.19, 0.57];
/// Distance from a vessel that counts, mm, numerical.
const BESIDE_MM: f32 = 2.0;

/// Ways along the surface to a vein, an artery and a branch, of 2 mm, from -1 to 1.
///
/// By the place at rest, mm, and the normal there.
fn vessels(rest: Vec3, normal: Vec3) -> Vec3 {
    let Vec3 { x, y, z } = rest;
    let Vec3 { x: nx, y: ny, z: nz } = normal;
    let all = [
        (Vec3::new(x, y, z), normal),
        (Vec3::new(y, z, x), Vec3::new(ny, nz, nx)),
        (Vec3::new(z, x, y), Vec3::new(nz, nx, ny)),
    ];
    [0, 1, 2]
        .map(|n| {
            let (value, slope) = wave(WAVES[n] * all[n].0);
            let along = WAVES[n] * slope.reject_from(all[n].1).length();
            (value / along.max(1e-3) / BESIDE_MM).clamp(-1.0, 1.0)
        })
        .into()
}

/// A wave whose zeros wind and branch, from -1 to 1, and its slope.
pub(crate) fn wave(p: Vec3) -> (f32, Vec3) {
    let (sin, cos) = (p.x + 1.7 * p.y.sin() + 0.8 * (1.7 * p.z).sin()).sin_cos();
    (sin, cos * Vec3::new(1.0, 1.7 * p.y.cos(), 1.36 * (1.7 * p.z).cos()))
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

impl Whole {
    fn of(mesh: &TetMesh, cortex: Option<&Cortex>) -> Self {
        let surface = Surface::of(mesh);
        let (tets, nodes) = (mesh.tets.clone(), mesh.positions.len());
        if let Some(Cortex { surface: fine, depth_mm }) = cortex {
            let mut triangles = fine.triangles.clone();
            chunks::sort(&mut triangles, &fine.positions);
            let mut normals = vec![Vec3::ZERO; fine.positions.len()];
            smooth_normals(&fine.positions, &triangles, &mut normals, &Changes { all: true, ..Changes::default() });
            let look = |(n, (place, normal)): (usize, (&Vec3, &Vec3))| {
                let depth_mm = depth_mm.get(n).copied().unwrap_or_default();
                let open = DARKEST + (PIA - DARKEST) * (-depth_mm / DARK_MM).exp();
                vessels(*place, normal.normalize_or(Vec3::Z)).extend(open)
            };
            let looks = fine.positions.iter().zip(&normals).enumerate().map(look).collect();
            let known = surface.triangles.iter().copied().map(sorted).collect();
            let embeddings = embeddings(mesh, &fine.positions);
            let mut is_rim = vec![false; mesh.positions.len()];
            surface.triangles.iter().flatten().for_each(|n| is_rim[*n as usize] = true);
            let cortex = fine.positions.iter().copied().zip(normals).collect();
            return Self { nodes, tets, faces: surface.triangles, known, is_rim, cortex, embeddings, triangles, looks };
        }
        let (embeddings, triangles) = on_nodes(&surface.triangles);
        let looks = vec![BARE; embeddings.len()];
        let (known, is_rim, cortex) = Default::default();
        Self { nodes, tets, faces: Vec::new(), known, is_rim, cortex, embeddings, triangles, looks }
    }
}

impl Whole {
    /// The cortex in a mesh of which nodes were split, without the triangles of which all corners
    /// are in tetrahedra that are gone. What straddles a cut goes with one side of it, what
    /// straddles the edge of a hole stays: it covers the gap to the wall.
    fn cortex(&self, mesh: &TetMesh, splits: &[Split], is_gone: impl Fn(u32) -> bool) -> CortexParts {
        let mut made =
            CortexParts { embeddings: self.embeddings.clone(), looks: self.looks.clone(), triangles: Vec::new() };
        let mut is_cut = vec![false; self.tets.len()];
        splits
            .iter()
            .map(|split| split.place().0)
            .filter(|tet| *tet < self.tets.len())
            .for_each(|tet| is_cut[tet] = true);
        let is_cut = |tet: u32| is_cut.get(tet as usize).is_some_and(|is_cut| *is_cut);
        for embedding in made.embeddings.iter_mut().filter(|embedding| is_cut(embedding.tet)) {
            let (before, now) = (self.tets[embedding.tet as usize], mesh.tets[embedding.tet as usize]);
            let node = |n: u32| before.iter().position(|m| *m == n).map_or(n, |corner| now[corner]);
            embedding.nodes = embedding.nodes.map(node);
        }
        for corners in &self.triangles {
            let tets = corners.map(|n| self.embeddings[n as usize].tet);
            let Some(side) = tets.into_iter().find(|tet| !is_gone(*tet)) else { continue };
            let pairs = [[0, 1], [1, 2], [2, 0]].map(|pair| pair.map(|n| tets[n]));
            let straddles =
                tets.into_iter().any(is_cut) && pairs.into_iter().any(|pair| self.are_apart(pair, &mesh.tets));
            let mut of_side = |n: u32| {
                let embedding = self.embeddings[n as usize];
                let place = embedding.place(&mesh.positions);
                let wanted = straddles && embedding.tet != side && side != NONE;
                let Some(own) = wanted.then(|| Embedding::within(side, mesh, place)).flatten() else { return n };
                made.embeddings.push(own);
                made.looks.push(self.looks[n as usize]);
                made.embeddings.len() as u32 - 1
            };
            made.triangles.push(corners.map(&mut of_side));
        }
        made
    }

    /// The way from a place at rest to the nearest vertex of the cortex, and how far outside of it
    /// the place is, mm.
    fn to_cortex(&self, from: Vec3) -> (Vec3, f32) {
        let ways = self.cortex.iter().map(|(place, normal)| (*place - from, normal));
        let nearest = ways.min_by(|a, b| a.0.length_squared().total_cmp(&b.0.length_squared()));
        nearest.map_or((Vec3::ZERO, 0.0), |(way, normal)| (way, -way.dot(*normal)))
    }

    /// Whether two tetrahedra share a node at first and not any more.
    fn are_apart(&self, pair: [u32; 2], tets: &[[u32; 4]]) -> bool {
        let [a, b] = pair.map(|tet| tet as usize);
        let Some((of_a, of_b)) = self.tets.get(a).zip(self.tets.get(b)) else { return false };
        let differs =
            |(i, n): (usize, &u32)| of_b.iter().position(|m| m == n).is_some_and(|k| tets[a][i] != tets[b][k]);
        a != b && of_a.iter().enumerate().any(differs)
    }
}

/// Triangles over nodes as triangles over embeddings.
fn on_nodes(triangles: &[[u32; 3]]) -> (Vec<Embedding>, Vec<[u32; 3]>) {
    let mut nodes: Vec<u32> = triangles.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    // Every corner is in the sorted list, which was made from the corners.
    let local = |n: u32| nodes.partition_point(|&m| m < n) as u32;
    let triangles = triangles.iter().map(|t| t.map(local)).collect();
    (nodes.into_iter().map(Embedding::node).collect(), triangles)
}

impl Border {
    /// The brain at rest, of tetrahedra and, if there is one, a cortex.
    pub fn of(mesh: &TetMesh, cortex: Option<&Cortex>) -> Self {
        let whole = Arc::new(Whole::of(mesh, cortex));
        let (rest, now, tets) = (mesh.positions.clone(), mesh.positions.clone(), mesh.tets.clone());
        let mut made = Self {
            gone: Vec::new(),
            splits: Vec::new(),
            embeddings: whole.embeddings.clone(),
            triangles: whole.triangles.clone(),
            chunks: Vec::new(),
            moved_mm: 0.0,
            looks: whole.looks.clone(),
            faces: whole.faces.clone(),
            walls: Walls::default(),
            first_wall: whole.embeddings.len(),
            whole,
            tets,
            rest,
            now,
            at_rest: Vec::new(),
            places: Vec::new(),
            normals: Vec::new(),
            stains: Vec::new(),
            own: 0,
            leaves: 0,
            to_cortex: BTreeMap::new(),
            within: BTreeMap::new(),
            touched: Vec::new(),
            stained: None,
            changes: Changes::default(),
        };
        made.shown();
        made
    }

    /// Makes the values of all vertices anew, without the dura.
    fn shown(&mut self) {
        self.at_rest = self.embeddings.iter().map(|embedding| embedding.place(&self.rest)).collect();
        self.places = self.embeddings.iter().map(|embedding| embedding.place(&self.now)).collect();
        let cortex = self.first_wall.min(self.places.len());
        self.walls.smooth(&mut self.at_rest[cortex..]);
        self.walls.smooth(&mut self.places[cortex..]);
        self.normals = vec![Vec3::ZERO; self.embeddings.len()];
        self.stains = vec![0.0; self.embeddings.len()];
        (self.own, self.leaves) = (self.triangles.len(), 0);
        self.chunks = Chunk::all(&self.triangles, &self.at_rest);
        self.renew();
    }

    /// Marks all as changed.
    fn renew(&mut self) {
        self.changes.all = true;
        self.touched.clear();
        self.stained = None;
    }

    /// Begins to note changes: all that is now has been seen.
    pub fn settle(&mut self) {
        let Changes { all, moved, turned, triangles } = &mut self.changes;
        *all = false;
        for flags in [moved, turned] {
            flags.clear();
            flags.resize(self.places.len(), false);
        }
        triangles.clear();
    }

    /// Shows the mesh without the tetrahedra that are `gone` and opened where nodes were split;
    /// returns whether that differs from before. Then it costs 5 ms for the built-in head
    /// (`validate render/cortex`).
    pub fn leave_out(&mut self, gone: Option<&[bool]>, splits: &[Split]) -> bool {
        let gone = gone.filter(|gone| gone.contains(&true)).unwrap_or_default();
        if gone == self.gone && splits == self.splits {
            return false;
        }
        (self.gone, self.splits) = (gone.to_vec(), splits.to_vec());
        let whole = Arc::clone(&self.whole);
        let is_gone = |tet: u32| gone.get(tet as usize).is_some_and(|gone| *gone);
        let mut mesh = TetMesh { positions: std::mem::take(&mut self.rest), tets: whole.tets.clone() };
        mesh.positions.truncate(whole.nodes);
        let opens = mesh.split(splits).is_some();
        let mut node_of: Vec<u32> = (0..whole.nodes as u32).collect();
        for split in splits.iter().filter(|_| opens) {
            node_of.resize(node_of.len().max(split.node as usize + 1), node_of[split.from as usize]);
        }
        self.now.truncate(whole.nodes);
        self.now.extend(node_of[whole.nodes..].iter().map(|n| mesh.positions[*n as usize]));
        let mut cortex = whole.cortex(&mesh, splits, is_gone);
        let left = (0u32..).zip(&mesh.tets).filter(|(t, _)| !is_gone(*t)).map(|(_, tet)| *tet);
        mesh.tets = left.collect();
        let mut bared = Surface::of(&mesh).triangles;
        (self.rest, self.tets) = (mesh.positions, mesh.tets);
        if whole.faces.is_empty() {
            (self.embeddings, self.triangles) = on_nodes(&bared);
            self.looks = vec![BARE; self.embeddings.len()];
        } else {
            self.faces.clone_from(&bared);
            bared.retain(|face| !whole.known.contains(&sorted(face.map(|n| node_of[n as usize]))));
            let (mut walls, mut faces) = on_nodes(&bared);
            let rim = self.end_walls(&mut walls, &mut faces, &node_of);
            self.walls = Walls::of(&faces, walls.len(), |n| rim[n]);
            self.first_wall = cortex.embeddings.len();
            let first = self.first_wall as u32;
            cortex.triangles.extend(faces.into_iter().map(|corners| corners.map(|n| n + first)));
            cortex.embeddings.extend(walls);
            cortex.looks.resize(cortex.embeddings.len(), Vec4::ONE);
            (self.triangles, self.embeddings, self.looks) = (cortex.triangles, cortex.embeddings, cortex.looks);
        }
        self.shown();
        true
    }

    /// Lets walls end at the cortex, over which and over whose furrows the tetrahedra reach; there
    /// they would stand out. Returns which of their vertices are on the boundary.
    ///
    /// Costs 0.14 ms for each new triangle, and for each new vertex at the boundary.
    fn end_walls(&mut self, walls: &mut [Embedding], faces: &mut Vec<[u32; 3]>, node_of: &[u32]) -> Vec<bool> {
        let (whole, rest) = (&self.whole, &self.rest);
        let nodes: Vec<u32> = walls.iter().map(|wall| node_of[wall.nodes[0] as usize]).collect();
        let rim: Vec<bool> = nodes.iter().map(|node| whole.is_rim[*node as usize]).collect();
        let at_rim = || nodes.par_iter().zip(&rim).filter(|(_, is_rim)| **is_rim).map(|(node, _)| *node);
        let new: BTreeSet<u32> = at_rim().filter(|node| !self.to_cortex.contains_key(node)).collect();
        self.to_cortex.par_extend(new.into_par_iter().map(|node| (node, whole.to_cortex(rest[node as usize]).0)));
        for (wall, node) in walls.iter_mut().zip(&nodes) {
            wall.offset = self.to_cortex.get(node).copied().unwrap_or_default();
        }
        let of = |corners: &[u32; 3]| sorted(corners.map(|n| nodes[n as usize]));
        let new = faces.par_iter().filter(|corners| !self.within.contains_key(&of(corners)));
        let judged = new.map(|corners| {
            let middle = corners.iter().map(|n| walls[*n as usize].place(rest)).sum::<Vec3>() / 3.0;
            (of(corners), whole.to_cortex(middle).1 < OUTSIDE_MM)
        });
        let judged: Vec<([u32; 3], bool)> = judged.collect();
        self.within.extend(judged);
        faces.retain(|corners| self.within.get(&of(corners)) != Some(&false));
        rim
    }

    /// Covers the brain by the dura; returns whether other triangles are there than before.
    pub fn cover(&mut self, dura: Option<&Leaves>) -> Result<bool, RenderError> {
        let none = Leaves { rest: &[], places: &[], triangles: &[] };
        let Leaves { rest, places, triangles } = dura.unwrap_or(&none);
        let (wanted, given) = (rest.len(), places.len());
        if given != wanted || triangles.iter().flatten().any(|&n| n as usize >= wanted) {
            return Err(RenderError::Nodes { wanted, given });
        }
        let brain = self.embeddings.len();
        let moved = triangles.iter().map(|corners| corners.map(|n| n + brain as u32));
        let is_other = wanted != self.leaves || !self.triangles[self.own..].iter().copied().eq(moved.clone());
        if is_other {
            self.triangles.truncate(self.own);
            self.triangles.extend(moved);
            self.chunks.truncate(self.own.div_ceil(MANY));
            self.chunks.push(Chunk::anywhere(&self.triangles, self.own));
            self.leaves = wanted;
            self.at_rest.resize(brain + wanted, Vec3::ZERO);
            self.places.resize(brain + wanted, Vec3::ZERO);
            self.normals.resize(brain + wanted, Vec3::ZERO);
            self.stains.resize(brain + wanted, DURA);
            self.looks.resize(brain + wanted, BARE);
            self.renew();
        }
        self.at_rest[brain..].copy_from_slice(rest);
        for (n, (at, place)) in (brain..).zip(self.places[brain..].iter_mut().zip(*places)) {
            if self.changes.all || !is_still(*at, *place) {
                *at = *place;
                self.changes.moved.get_mut(n).into_iter().for_each(|moved| *moved = true);
            }
        }
        Ok(is_other)
    }

    /// Updates the vertices from the mesh's nodes, or resets them to rest.
    ///
    /// They are drawn onto what the balls of tools touch, with their radii, mm. After `settle`
    /// nodes that moved by less than 0.03 mm stay where they are. Call it after `cover` and
    /// `stain`.
    pub fn follow(&mut self, positions: Option<&[Vec3]>, balls: &[(Vec3, f32)]) -> Result<(), RenderError> {
        let positions = positions.unwrap_or(&self.rest);
        let (given, wanted) = (positions.len(), self.rest.len());
        if given != wanted {
            return Err(RenderError::Nodes { wanted, given });
        }
        let all = self.changes.all;
        let stirs = |(now, next): (&mut Vec3, &Vec3)| {
            let stirs = all || !is_still(*now, *next);
            *now = if stirs { *next } else { *now };
            stirs
        };
        let stirred: Vec<bool> = self.now.iter_mut().zip(positions).map(stirs).collect();
        let most = MOST * stirred.iter().filter(|stirs| **stirs).count() > stirred.len();
        let now = &self.now;
        let before = if all || most { Vec::new() } else { self.places.clone() };
        let cortex = self.first_wall.min(self.places.len());
        self.places.par_iter_mut().zip(&self.embeddings).enumerate().for_each(|(n, (place, embedding))| {
            // Walls are smoothed anew from where the tetrahedra have them.
            if n >= cortex || embedding.nodes.iter().any(|node| stirred[*node as usize]) {
                *place = embedding.place(now);
            }
        });
        for n in std::mem::take(&mut self.touched) {
            self.places[n as usize] = self.embeddings[n as usize].place(&self.now);
        }
        self.walls.smooth(&mut self.places[cortex..]);
        self.touched = touch(&mut self.places[..self.embeddings.len()], &self.faces, &self.now, balls);
        if most && !all {
            self.changes.fill(self.triangles.len());
        }
        if most || self.changes.note(&before, &self.places[..self.embeddings.len()], &self.triangles) {
            smooth_normals(&self.places, &self.triangles, &mut self.normals, &self.changes);
            let ways = self.places[..self.embeddings.len()].par_iter().zip(&self.at_rest);
            let moved = ways.map(|(place, rest)| place.distance_squared(*rest)).reduce(|| 0.0, f32::max);
            self.moved_mm = moved.sqrt();
        }
        Ok(())
    }

    /// Takes the stain of each node, as in a frame.
    pub fn stain(&mut self, stains: Option<&[u8]>) {
        if !self.changes.all && self.stained.as_deref() == stains {
            return;
        }
        self.stained = stains.map(<[u8]>::to_vec);
        let mm = |stain: u8| if stain == u8::MAX { -1.0 } else { 0.01 * f32::from(stain) };
        let of = |node: u32| stains.and_then(|all| all.get(node as usize)).map_or(0.0, |stain| mm(*stain));
        for (n, (stain, embedding)) in self.stains.iter_mut().zip(&self.embeddings).enumerate() {
            let weights = embedding.weights.map(|weight| weight.max(0.0));
            let sum: f32 = (0..4).map(|k| weights[k] * of(embedding.nodes[k])).sum();
            let is = if stains.is_some() { sum / weights.iter().sum::<f32>().max(1.0) } else { 0.0 };
            if is != std::mem::replace(stain, is) {
                self.changes.turned.get_mut(n).into_iter().for_each(|turned| *turned = true);
            }
        }
    }

    /// Whether the brain's own triangles close around it, as those of a cortex.
    pub fn is_closed(&self) -> bool {
        !self.faces.is_empty()
    }

    /// The brain's current triangles that cross a plane, without the dura.
    pub fn across(&self, plane: Vec4) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        let own = self.chunks.iter().filter(|chunk| chunk.triangles.end <= self.own);
        let some = own.filter(move |chunk| chunk.may_cross(plane, self.moved_mm));
        let corners =
            some.flat_map(|chunk| &self.triangles[chunk.triangles.clone()]).map(|t| t.map(|n| self.places[n as usize]));
        corners.filter(move |corners| {
            let [a, b, c] = corners.map(|place| height(plane, place) >= 0.0);
            a != b || b != c
        })
    }
}

impl Changes {
    /// Whether most of so many triangles look different.
    pub fn are_most(&self, triangles: usize) -> bool {
        MOST * self.triangles.len() > triangles
    }

    /// Notes that all of so many triangles look different.
    fn fill(&mut self, triangles: usize) {
        self.moved.fill(true);
        self.turned.fill(true);
        self.triangles.clear();
        self.triangles.extend(0..triangles as u32);
    }

    /// Notes which vertices are elsewhere than before, and the triangles that therefore look
    /// different; returns whether any does.
    fn note(&mut self, before: &[Vec3], places: &[Vec3], triangles: &[[u32; 3]]) -> bool {
        if self.all {
            return true;
        }
        for (moved, (was, is)) in self.moved.iter_mut().zip(before.iter().zip(places)) {
            *moved |= was != is;
        }
        let Self { moved, turned, triangles: looking, .. } = self;
        let any = |of: &[bool], corners: &[u32; 3]| corners.iter().any(|n| of[*n as usize]);
        for corners in triangles.iter().filter(|corners| any(moved, corners)) {
            corners.iter().for_each(|n| turned[*n as usize] = true);
        }
        looking.clear();
        looking.extend((0u32..).zip(triangles).filter(|(_, corners)| any(turned, corners)).map(|(n, _)| n));
        !looking.is_empty()
    }
}

/// Area-weighted mean of the triangle normals at every vertex that turned; zero where they cancel.
/// Each thread sums for some of the vertices.
fn smooth_normals(places: &[Vec3], triangles: &[[u32; 3]], normals: &mut [Vec3], changes: &Changes) {
    let all = changes.all || changes.triangles.len() == triangles.len();
    let turned = |n: usize| all || changes.turned[n];
    let twice_area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|n| places[n as usize]);
        (b - a).cross(c - a)
    };
    if !all {
        let turning = || (0..normals.len()).filter(|n| turned(*n));
        let all: Vec<usize> = turning().collect();
        all.iter().for_each(|n| normals[*n] = Vec3::ZERO);
        for corners in changes.triangles.iter().map(|n| &triangles[*n as usize]) {
            let area = twice_area(corners);
            corners.iter().filter(|n| turned(**n as usize)).for_each(|n| normals[*n as usize] += area);
        }
        all.iter().for_each(|n| normals[*n] = normals[*n].normalize_or_zero());
        return;
    }
    let many = normals.len().div_ceil(rayon::current_num_threads()).max(1);
    normals.par_chunks_mut(many).enumerate().for_each(|(n, normals)| {
        let own = n * many..n * many + normals.len();
        normals.fill(Vec3::ZERO);
        for corners in triangles {
            if corners.iter().any(|n| own.contains(&(*n as usize))) {
                let area = twice_area(corners);
                let ours = corners.iter().map(|n| *n as usize).filter(|n| own.contains(n));
                ours.for_each(|n| normals[n - own.start] += area);
            }
        }
        normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_mesh::TriMesh;

    /// Cubes of 4 mm, of tetrahedra, as wide and deep as so many.
    fn block(wide: usize, deep: usize) -> TetMesh {
        trepan_mesh::lattice::tetrahedra(
            &trepan_volume::VoxelVolume::isotropic([4 * wide, 4 * wide, 4 * deep], Vec3::ZERO, 1.0, 1u8),
            &trepan_mesh::lattice::Config { target_tets: 6 * wide * wide * deep, ..Default::default() },
        )
        .expect("a box has a mesh")
    }

    #[test]
    fn walls_of_a_hole_end_at_the_cortex() {
        let mesh = block(10, 4);
        let top = mesh.bounds().max.z;
        // 1 mm below the tetrahedra's boundary, with a furrow of 4 mm across it.
        let mut surface = TriMesh::default();
        let furrow = |x: f32| if (x - 20.0).abs() < 2.0 { 6.0 } else { 0.0 };
        for at in 0..1681u32 {
            let (x, y) = ((at % 41) as f32, (at / 41) as f32);
            surface.positions.push(Vec3::new(x, y, top - 1.0 - furrow(x)));
            if at % 41 < 40 && at < 1640 {
                surface.triangles.extend([[at, at + 1, at + 42], [at, at + 42, at + 41]]);
            }
        }
        let depth_mm: Vec<f32> = surface.positions.iter().map(|p| top - p.z).collect();
        let mut border = Border::of(&mesh, Some(&Cortex { surface: &surface, depth_mm: &depth_mm }));
        let far = |tet: &[u32; 4]| {
            let middle = tet.iter().map(|n| mesh.positions[*n as usize]).sum::<Vec3>() / 4.0;
            middle.distance(Vec3::new(21.0, 20.0, top))
        };
        let gone: Vec<bool> = mesh.tets.iter().map(|tet| far(tet) < 9.0).collect();
        assert!(border.leave_out(Some(&gone), &[]));
        let walls = &border.at_rest[border.first_wall..];
        let most = walls.iter().map(|p| p.z).fold(f32::NEG_INFINITY, f32::max);
        assert!(walls.len() > 40 && most < top - 0.95, "{} of them up to {most}, {top}", walls.len());
        let of_walls = border.triangles.iter().filter(|t| t.iter().all(|n| *n as usize >= border.first_wall));
        let middles = of_walls.map(|t| t.iter().map(|n| border.at_rest[*n as usize]).sum::<Vec3>() / 3.0);
        let out = |p: &Vec3| p.z - (top - 1.0 - furrow(p.x));
        // Walls are smoothed afterwards, by a part of an edge.
        assert!(
            middles.clone().count() > 60 && middles.clone().all(|p| out(&p) < 2.0),
            "{:?}",
            middles.map(|p| out(&p)).fold(0.0, f32::max)
        );
    }

    #[test]
    fn a_tool_that_presses_lies_on_the_cortex_also_over_a_furrow() {
        let mesh = block(10, 4);
        let top = mesh.bounds().max.z;
        // Flat, with a furrow of 4 mm around the middle, and 1 mm below the tetrahedra's boundary.
        let mut surface = TriMesh::default();
        for at in 0..1681u32 {
            let (x, y) = ((at % 41) as f32, (at / 41) as f32);
            let furrow = if (x - 20.0).abs() < 2.0 { 6.0 } else { 0.0 };
            surface.positions.push(Vec3::new(x, y, top - 1.0 - furrow));
            if at % 41 < 40 && at < 1640 {
                surface.triangles.extend([[at, at + 1, at + 42], [at, at + 42, at + 41]]);
            }
        }
        let depth_mm: Vec<f32> = surface.positions.iter().map(|p| top - p.z).collect();
        let mut border = Border::of(&mesh, Some(&Cortex { surface: &surface, depth_mm: &depth_mm }));
        // Pressed in by 5 mm by a ball of 3 mm.
        let dent = |p: &Vec3| {
            let beside = (p.truncate() - glam::Vec2::splat(20.0)).length();
            *p - 5.0 * (-(beside / 8.0).powi(2)).exp() * (p.z / top) * Vec3::Z
        };
        let pressed: Vec<Vec3> = mesh.positions.iter().map(dent).collect();
        let ball = (Vec3::new(20.0, 20.0, top - 5.0 + 3.0), 3.0);
        let gap = |border: &Border| {
            let outside = |p: &Vec3| p.distance(ball.0) - ball.1;
            border.places.iter().map(outside).fold(f32::INFINITY, f32::min)
        };
        border.follow(Some(&pressed), &[]).unwrap();
        assert!(gap(&border) > 0.5, "{} mm: it floats", gap(&border));
        border.follow(Some(&pressed), &[ball]).unwrap();
        assert!(gap(&border).abs() < 0.5, "{} mm", gap(&border));
        // A tool that does not touch moves nothing.
        border.follow(None, &[(Vec3::new(20.0, 20.0, top + 6.0), 3.0)]).unwrap();
        let moved = border.places.iter().zip(&border.at_rest).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert_eq!(moved, 0.0);
    }
}
