//! Scissors that cut the brain when their pedal goes down.
//!
//! # Theory
//! The blades lie in the plane of the tool's x and z axes, from the tip up. What they cover is cut
//! along the faces between tetrahedra whose middles lie on different sides of that plane:
//!
//! ```text
//!   side +  \__/\__     the cut follows faces, so it is jagged by about an edge of the mesh;
//!   ──────blades──────  a face is cut where its middle is under the blades or within half of its
//!   side -              longest edge of them
//! ```
//! Nodes split where the cut separates what is around them ([`Splitter`]). The solver gets them as
//! a list; contact, blood and picture follow once it has them.
//!
//! # Practice
//! A closing takes 0.1 ms for 8,000 tetrahedra, once; it puts no force on the hand. Tissue that may
//! not be taken, such as vessels, is not cut. Nothing is allocated; over [`MOST_CUTS`] faces or
//! [`MOST_SPLITS`] splits nothing more is cut.

use std::array::from_fn;
use trepan_geometry::{Buttons, Vec3};
use trepan_mesh::{FACES, NONE, Split, Splitter, TetMesh};

use crate::haptic_tick::SecondTool;

/// Length and half the width of what the closing blades cover, mm: usual microscissors, numerical.
const BLADES_MM: (f32, f32) = (10.0, 4.0);
/// Most faces that are cut, and most splits.
pub const MOST_CUTS: usize = 4096;
/// Most splits of nodes.
pub const MOST_SPLITS: usize = 16_384;

/// How alike two planes are (cosine), and how far tetrahedra may be from the new one, mm, where a
/// closing goes on with a cut. Else what lies between the two would come loose. Numerical.
const SAME_CUT: (f32, f32) = (0.9, 6.0);

/// Which faces of the brain are cut.
#[derive(Clone)]
pub(crate) struct Scissors {
    splitter: Splitter,
    /// Whether each tetrahedron may be cut.
    may: Vec<bool>,
    /// The node that each copy was made of.
    from: Vec<u32>,
    first_copy: u32,
    /// The faces that were cut, `4 · tetrahedron + face`, each once.
    pub cuts: Vec<u32>,
    /// Their area when they were cut, mm².
    pub cut_mm2: f64,
    is_down: [bool; 2],
    sides: Vec<bool>,
    /// Of a tetrahedron beside a cut: the normal of that, and which side of it this is.
    beside: Vec<Option<(Vec3, bool)>>,
}

impl Scissors {
    /// For a mesh of which the tetrahedra with a positive rate may be cut.
    pub fn of(mesh: &TetMesh, rates: &[f32]) -> Self {
        let may = (0..mesh.tets.len()).map(|tet| rates.get(tet).is_some_and(|rate| *rate > 0.0)).collect();
        Self {
            splitter: Splitter::of(mesh),
            may,
            from: Vec::with_capacity(MOST_SPLITS),
            first_copy: mesh.positions.len() as u32,
            cuts: Vec::with_capacity(MOST_CUTS),
            cut_mm2: 0.0,
            is_down: [false; 2],
            sides: vec![false; mesh.tets.len()],
            beside: vec![None; mesh.tets.len()],
        }
    }

    /// Cuts where a hand's scissors close now; each hand is told whether it holds any. Returns the
    /// number of the first of the new [`cuts`](Self::cuts).
    pub fn step(
        &mut self,
        hands: [Option<SecondTool>; 2],
        positions: &[Vec3],
        fills: &[u16],
        splits: &mut Vec<Split>,
    ) -> usize {
        let before = self.cuts.len();
        for (hand, held) in hands.into_iter().enumerate() {
            let is_down = held.is_some_and(|held| held.state.buttons.has(Buttons::PEDAL));
            let was_down = std::mem::replace(&mut self.is_down[hand], is_down);
            if let Some(held) = held.filter(|_| is_down && !was_down) {
                self.close(&held, positions, fills, splits);
            }
        }
        before
    }

    /// The place of a node, or of the one that it is a copy of, mm.
    fn place(&self, mut node: u32, positions: &[Vec3]) -> Vec3 {
        while node as usize >= positions.len() && node >= self.first_copy {
            node = self.from[(node - self.first_copy) as usize];
        }
        positions[node as usize]
    }

    fn close(&mut self, held: &SecondTool, positions: &[Vec3], fills: &[u16], splits: &mut Vec<Split>) {
        let pose = held.state.world_from_tool;
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| pose.rotation * axis);
        let tip = held.state.tip();
        let is_gone = |tet: u32| fills.get(tet as usize).is_some_and(|fill| *fill == 0);
        for tet in 0..self.sides.len() {
            let middle: Vec3 = self.splitter.corners(tet as u32).map(|n| self.place(n, positions)).into_iter().sum();
            let ahead_mm = (0.25 * middle - tip).dot(y);
            let known = self.beside[tet].filter(|(n, _)| n.dot(y).abs() > SAME_CUT.0 && ahead_mm.abs() < SAME_CUT.1);
            self.sides[tet] = known.map_or(ahead_mm > 0.0, |(n, side)| side == (n.dot(y) > 0.0));
        }
        for tet in 0..self.sides.len() as u32 {
            for (face, next) in self.splitter.neighbours(tet).into_iter().enumerate() {
                let is_between = next != NONE && tet < next && self.sides[tet as usize] != self.sides[next as usize];
                let may = |tet: u32| self.may[tet as usize] && !is_gone(tet);
                if !is_between || !may(tet) || !may(next) || self.cuts.len() == MOST_CUTS {
                    continue;
                }
                let held = self.splitter.corners(tet);
                let corners: [Vec3; 3] = from_fn(|n| self.place(held[FACES[face][n]], positions));
                let away = corners.into_iter().sum::<Vec3>() / 3.0 - tip;
                let longest = (0..3).map(|n| corners[n].distance(corners[(n + 1) % 3])).fold(0.0, f32::max);
                let [along, aside] = [away.dot(z), away.dot(x)];
                let beyond = [aside.abs() - BLADES_MM.1, along - BLADES_MM.0, -along];
                if beyond.into_iter().any(|mm| mm > 0.5 * longest) || away.dot(y).abs() > longest {
                    continue;
                }
                let known = splits.len();
                self.splitter.cut(tet, face, is_gone, splits);
                self.learn(&splits[known..]);
                self.cuts.push(4 * tet + face as u32);
                for beside in [tet, next].map(|tet| tet as usize) {
                    self.beside[beside].get_or_insert((y, self.sides[beside]));
                }
                let [a, b, c] = corners;
                self.cut_mm2 += f64::from(0.5 * (b - a).cross(c - a).length());
            }
        }
    }

    fn learn(&mut self, splits: &[Split]) {
        for split in splits {
            if split.node as usize == self.first_copy as usize + self.from.len() {
                self.from.push(split.from);
            }
        }
    }

    /// Appends the cuts for [`restore`](Self::restore).
    pub fn save(&self, splits: &[Split], to: &mut Vec<u64>) {
        let down = self.is_down.map(u64::from);
        to.extend([self.cut_mm2.to_bits(), down[0] + 2 * down[1], self.cuts.len() as u64, splits.len() as u64]);
        to.extend(self.cuts.iter().map(|face| u64::from(*face)));
        to.extend(splits.iter().flat_map(|split| [split.corner, split.from, split.node].map(u64::from)));
        to.push(self.beside.iter().flatten().count() as u64);
        for (tet, (normal, side)) in (0u64..).zip(&self.beside).filter_map(|(tet, of)| Some((tet, (*of)?))) {
            to.push(2 * tet + u64::from(side));
            to.extend(normal.to_array().map(|x| u64::from(x.to_bits())));
        }
    }

    /// Most words that [`save`](Self::save) appends.
    pub const fn most_words() -> usize {
        5 + MOST_CUTS + 3 * MOST_SPLITS + 4 * 2 * MOST_CUTS
    }

    /// Takes over what others cut, before the first step; returns the splits. `None`, and no change
    /// that counts, if it does not fit.
    pub fn restore(&mut self, words: &mut impl Iterator<Item = u64>) -> Option<Vec<Split>> {
        let cut_mm2 = f64::from_bits(words.next()?);
        let down = words.next()?;
        let [cuts, count] = [words.next()? as usize, words.next()? as usize];
        (cuts <= MOST_CUTS && count <= MOST_SPLITS && cut_mm2 >= 0.0).then_some(())?;
        let cuts: Vec<u32> = words.take(cuts).map(|face| face as u32).collect();
        let mut splits = Vec::with_capacity(MOST_SPLITS);
        for _ in 0..count {
            let [corner, from, node] = [words.next()?, words.next()?, words.next()?].map(|word| word as u32);
            splits.push(Split { corner, from, node });
        }
        for _ in 0..words.next()? {
            let [word, x, y, z] = [words.next()?, words.next()?, words.next()?, words.next()?];
            let normal = Vec3::from_array([x, y, z].map(|bits| f32::from_bits(bits as u32)));
            *self.beside.get_mut((word / 2) as usize)? = Some((normal, word % 2 == 1));
        }
        self.splitter.restore(&cuts, &splits)?;
        self.learn(&splits);
        (self.cuts, self.cut_mm2, self.is_down) = (cuts, cut_mm2, [down & 1 == 1, down & 2 == 2]);
        // A copy of these has no room.
        self.cuts.reserve_exact(MOST_CUTS - self.cuts.len());
        self.from.reserve_exact(MOST_SPLITS - self.from.len());
        Some(splits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Quat, Tool, ToolState};
    use trepan_mesh::Topology;
    use trepan_soft::boxes;

    /// Scissors at a place over a block, blades down, that close or open.
    fn at(place: Vec3, closes: bool) -> [Option<SecondTool>; 2] {
        let pose = Pose::from_translation(place);
        let buttons = if closes { Buttons::PEDAL } else { Buttons(0) };
        let state = ToolState { buttons, ..ToolState::at(pose) };
        [None, Some(SecondTool { tool: Tool::scissors(), slot: 0, state })]
    }

    /// A row of closings opens a slit across a block; each cuts once.
    #[test]
    fn a_row_of_closings_cuts_a_block_in_two() {
        let mesh = boxes::split_box([8, 8, 4], Vec3::new(16.0, 16.0, 8.0));
        let tets = mesh.tets.len();
        let mut scissors = Scissors::of(&mesh, &vec![1.0; tets]);
        let mut splits = Vec::with_capacity(MOST_SPLITS);
        let fills = vec![u16::MAX; tets];
        let close = |scissors: &mut Scissors, splits: &mut Vec<Split>, x: f32| {
            let place = Vec3::new(x, 8.1, 1.0);
            scissors.step(at(place, true), &mesh.positions, &fills, splits);
            let once = scissors.cuts.len();
            scissors.step(at(place, true), &mesh.positions, &fills, splits);
            assert_eq!(scissors.cuts.len(), once, "a pedal that stays down cuts once");
            scissors.step(at(place, false), &mesh.positions, &fills, splits);
        };
        close(&mut scissors, &mut splits, 2.0);
        let mut opened = mesh.clone();
        opened.split(&splits).unwrap();
        assert!(opened.positions.len() > mesh.positions.len() && Topology::of(&opened).components().1 == 1);
        (1..5).for_each(|n| close(&mut scissors, &mut splits, 2.0 + 3.0 * n as f32));
        opened = mesh.clone();
        opened.split(&splits).unwrap();
        assert_eq!(Topology::of(&opened).components().1, 2);
        assert!((128.0..300.0).contains(&scissors.cut_mm2), "{} mm² of 16 by 8", scissors.cut_mm2);
        // Who takes it over cuts the same from there on.
        let (mut words, mut other) = (Vec::new(), Scissors::of(&mesh, &vec![1.0; tets]));
        scissors.save(&splits, &mut words);
        assert!(words.len() <= Scissors::most_words());
        let mut taken = other.restore(&mut words.iter().copied()).unwrap();
        let across = |scissors: &mut Scissors, splits: &mut Vec<Split>| {
            let mut hands = at(Vec3::new(8.1, 2.0, 1.0), true);
            let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
            hands.iter_mut().flatten().for_each(|held| held.state.world_from_tool.rotation = turn);
            scissors.step(hands, &opened.positions, &fills, splits);
        };
        across(&mut scissors, &mut splits);
        across(&mut other, &mut taken);
        assert!(splits == taken && scissors.cuts == other.cuts);
        let short = || Scissors::of(&mesh, &[]).restore(&mut words[..words.len() - 1].iter().copied());
        assert!(short().is_none());
    }

    #[test]
    fn what_may_not_be_taken_and_what_is_gone_is_not_cut() {
        let mesh = boxes::split_box([4, 4, 4], Vec3::splat(8.0));
        let mut splits = Vec::with_capacity(MOST_SPLITS);
        for (rate, fill) in [(0.0, u16::MAX), (1.0, 0)] {
            let mut scissors = Scissors::of(&mesh, &vec![rate; mesh.tets.len()]);
            scissors.step(at(Vec3::splat(4.1), true), &mesh.positions, &vec![fill; mesh.tets.len()], &mut splits);
            assert!(scissors.cuts.is_empty() && splits.is_empty());
        }
    }
}
