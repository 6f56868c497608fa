//! Tissue that an aspirator takes away while its pedal is down.
//!
//! # Theory
//! Each point of the tip's ball that is inside tissue stands for an equal area of it, and takes the
//! rate of the tissue times that area and the time from the tetrahedron that it is in:
//!
//! ```text
//! dV = c · A / N · dt for each of the N points inside      φ = left / V
//! ```
//! So what is taken grows with contact and time, not with the tool's speed or the mesh. A
//! tetrahedron with less than a tenth left leaves, and so does a small piece that no face joins to
//! the rest any more: what is left of it goes in equal parts over 20 ms, so that neither force nor
//! stress jumps.
//!
//! # Practice
//! A step costs 211 additions, and a search of at most 800 tetrahedra for each that goes; it does
//! not allocate. Time is that of the tool's ticks, so a replay takes the same.
//!
//! # Sources
//! Rate by tissue, tip area and suction: Cimino and Bond, Ultrasound Med. Biol. 22, 1996, abstract.
//! Rates are the caller's; none is calibrated.

use std::f32::consts::PI;
use trepan_deformable::TissueCollision;
use trepan_mesh::{NONE, TetMesh, Topology};

/// Fill of a whole tetrahedron, and that below which it goes as a whole.
const FILLS: [f32; 2] = [u16::MAX as f32, 0.1 * u16::MAX as f32];
/// Longest time that counts between two steps, ms: a pause takes nothing.
const LONGEST_MS: f64 = 5.0;

/// Time in which a whole tetrahedron that leaves goes, ms, numerical.
const LEAVES_MS: f32 = 20.0;

/// Tetrahedra of the largest loose piece that is sucked away, numerical.
const LOOSE: usize = 200;

/// Finds pieces that no face joins to the rest.
struct Pieces {
    neighbours: Vec<[u32; 4]>,
    /// The search that saw each tetrahedron last.
    seen: Vec<u32>,
    searches: u32,
    piece: Vec<u32>,
}

impl Pieces {
    fn of(mesh: &TetMesh) -> Self {
        let neighbours = Topology::of(mesh).neighbours;
        Self { seen: vec![0; neighbours.len()], neighbours, searches: 0, piece: Vec::with_capacity(LOOSE + 4) }
    }

    /// The piece around a tetrahedron; empty where it is gone, or its piece is too large or holds
    /// what may not go.
    fn loose(&mut self, from: u32, fills: &[u16], rates: &[f32]) -> &[u32] {
        let is_there = |tet: u32| fills.get(tet as usize).is_some_and(|fill| *fill > 0);
        self.searches += 1;
        self.piece.clear();
        if is_there(from) {
            self.seen[from as usize] = self.searches;
            self.piece.push(from);
        }
        let mut at = 0;
        while let Some(tet) = self.piece.get(at).copied() {
            at += 1;
            if self.piece.len() > LOOSE || rates[tet as usize] <= 0.0 {
                self.piece.clear();
                break;
            }
            for next in self.neighbours[tet as usize] {
                if is_there(next) && std::mem::replace(&mut self.seen[next as usize], self.searches) != self.searches {
                    self.piece.push(next);
                }
            }
        }
        &self.piece
    }
}

/// What an aspirator has left of each tetrahedron.
pub(crate) struct Aspirator {
    /// Rate of each tetrahedron's tissue, mm/ms; 0 for what may not be taken.
    rates: Vec<f32>,
    volumes_mm3: Vec<f32>,
    left_mm3: Vec<f32>,
    last_ms: f64,
    pieces: Pieces,
    /// Tetrahedra that go by themselves, each once.
    leaving: Vec<u32>,
    leaves: Vec<bool>,
    /// Volume taken so far, mm³.
    pub taken_mm3: f64,
    /// Tetrahedra of which something went in the last step, each once.
    pub thinned: Vec<u32>,
    /// The step that took of each tetrahedron last.
    taken_in: Vec<u64>,
    steps: u64,
}

impl Aspirator {
    /// Of a mesh whose tetrahedra are taken at a rate, mm/ms: mm³ for each mm² of contact.
    pub fn of(mesh: &TetMesh, rates: &[f32]) -> Self {
        let volumes_mm3: Vec<f32> = (0..mesh.tets.len()).map(|t| mesh.volume_mm3(t) as f32).collect();
        let tets = volumes_mm3.len();
        Self {
            rates: (0..tets).map(|t| rates.get(t).copied().unwrap_or(0.0).max(0.0)).collect(),
            left_mm3: volumes_mm3.clone(),
            thinned: Vec::with_capacity(tets),
            taken_in: vec![0; tets],
            steps: 0,
            leaving: Vec::with_capacity(tets),
            leaves: vec![false; tets],
            volumes_mm3,
            last_ms: f64::NEG_INFINITY,
            pieces: Pieces::of(mesh),
            taken_mm3: 0.0,
        }
    }

    /// Takes what tubes touch, each with the radius of its tip, mm; lowers the fills of those
    /// tetrahedra.
    pub fn step<'a>(
        &mut self,
        now_ms: f64,
        tubes: impl Iterator<Item = (f32, &'a TissueCollision)>,
        fills: &mut [u16],
    ) {
        self.thinned.clear();
        self.steps += 1;
        let dt_ms = (now_ms - std::mem::replace(&mut self.last_ms, now_ms)).clamp(0.0, LONGEST_MS) as f32;
        for (radius_mm, tool) in tubes {
            let area_mm2 = 4.0 * PI * radius_mm.powi(2) / tool.points() as f32;
            for tet in tool.tets_touched() {
                self.take(tet, self.rates[tet as usize] * area_mm2 * dt_ms, fills);
            }
        }
        for at in 0..self.leaving.len() {
            let tet = self.leaving[at];
            self.take(tet, self.volumes_mm3[tet as usize] * dt_ms / LEAVES_MS, fills);
        }
        self.leaving.retain(|tet| fills[*tet as usize] > 0);
        self.loosen(fills);
    }

    /// Takes over what another aspirator left, and all that it took; `thinned` names all of it.
    pub fn restore(&mut self, fills: &[u16], taken_mm3: f64) {
        self.taken_mm3 = taken_mm3;
        self.thinned.clear();
        for (tet, &fill) in fills.iter().enumerate().filter(|(_, fill)| **fill < u16::MAX) {
            self.left_mm3[tet] = self.volumes_mm3[tet] * f32::from(fill) / FILLS[0];
            self.thinned.push(tet as u32);
            if f32::from(fill) < FILLS[1] && !std::mem::replace(&mut self.leaves[tet], true) && fill > 0 {
                self.leaving.push(tet as u32);
            }
        }
        self.loosen(fills);
    }

    /// Cuts faces, `4 · tetrahedron + face`: a small piece that nothing joins any more goes.
    pub fn cut(&mut self, faces: &[u32], fills: &[u16]) {
        let cut = faces.iter().map(|face| [(face / 4) as usize, (face % 4) as usize]);
        let beside = |pieces: &mut Pieces, [tet, face]: [usize; 2]| {
            let next = std::mem::replace(&mut pieces.neighbours[tet][face], NONE);
            let theirs = pieces.neighbours.get_mut(next as usize).into_iter().flatten();
            theirs.filter(|back| **back == tet as u32).for_each(|back| *back = NONE);
            next
        };
        for at in cut {
            let next = beside(&mut self.pieces, at);
            [at[0] as u32, next].into_iter().for_each(|from| self.loosen_from(from, fills));
        }
    }

    /// Finds the pieces that hang loose since the thinned tetrahedra went.
    fn loosen(&mut self, fills: &[u16]) {
        for at in 0..self.thinned.len() {
            let tet = self.thinned[at] as usize;
            if fills[tet] == 0 {
                self.pieces.neighbours[tet].into_iter().for_each(|from| self.loosen_from(from, fills));
            }
        }
    }

    /// Lets the piece around a tetrahedron leave if it hangs loose.
    fn loosen_from(&mut self, from: u32, fills: &[u16]) {
        for &loose in self.pieces.loose(from, fills, &self.rates) {
            if !std::mem::replace(&mut self.leaves[loose as usize], true) {
                self.leaving.push(loose);
            }
        }
    }

    /// Takes at most a volume of a tetrahedron, mm³.
    fn take(&mut self, tet: u32, at_most_mm3: f32, fills: &mut [u16]) {
        let t = tet as usize;
        let taken = at_most_mm3.min(self.left_mm3[t]);
        if taken <= 0.0 {
            return;
        }
        self.left_mm3[t] -= taken;
        self.taken_mm3 += f64::from(taken);
        let fill = FILLS[0] * self.left_mm3[t] / self.volumes_mm3[t];
        fills[t] = fill as u16;
        if fills[t] == 0 {
            self.taken_mm3 += f64::from(std::mem::take(&mut self.left_mm3[t]));
        }
        if fill < FILLS[1] && !std::mem::replace(&mut self.leaves[t], true) {
            self.leaving.push(tet);
        }
        if std::mem::replace(&mut self.taken_in[t], self.steps) != self.steps {
            self.thinned.push(tet);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_soft::boxes;

    /// A bar of twelve cubes, cut in its third cube: two cubes of ten tetrahedra hang loose.
    #[test]
    fn a_piece_that_nothing_joins_goes_unless_it_is_large_or_may_not_go() {
        let mesh = boxes::split_box([60, 1, 1], Vec3::new(120.0, 2.0, 2.0));
        let middle_x = |tet: usize| mesh.corners(tet).into_iter().sum::<Vec3>().x / 4.0;
        let cut = |from: f32| (0..mesh.tets.len()).filter(move |tet| (from..from + 2.0).contains(&middle_x(*tet)));
        let mut fills = vec![u16::MAX; mesh.tets.len()];
        cut(4.0).for_each(|tet| fills[tet] = 0);
        let beyond = cut(6.0).next().unwrap() as u32;
        let free: Vec<u32> = cut(0.0).chain(cut(2.0)).map(|tet| tet as u32).collect();
        let (mut pieces, rates) = (Pieces::of(&mesh), vec![1.0; mesh.tets.len()]);
        let mut found = pieces.loose(free[0], &fills, &rates).to_vec();
        found.sort_unstable();
        assert_eq!(found, free);
        assert!(pieces.loose(beyond, &fills, &rates).is_empty(), "the rest is too large");
        assert!(pieces.loose(cut(4.0).next().unwrap() as u32, &fills, &rates).is_empty(), "gone");
        let held: Vec<f32> = (0..mesh.tets.len() as u32).map(|tet| if tet == free[3] { 0.0 } else { 1.0 }).collect();
        assert!(pieces.loose(free[0], &fills, &held).is_empty(), "a vessel holds it");
    }
}
