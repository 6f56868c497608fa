//! Blood on the wound: what an aspirator's cuts open, and what tools do about it.
//!
//! # Practice
//! The wound follows the collision step, with the brain and the tool that it saw, so that a replay
//! has the same. An aspirator with its pedal down sucks, in either hand; bipolar forceps coagulate
//! and rinse. Blood puts no force on hand or brain.

use crate::haptic_tick::SecondTool;
use serde::Serialize;
use trepan_bleeding::{Act, Perfusion, Wound};
use trepan_geometry::{ToolKind, Vec3};
use trepan_mesh::{Split, TetMesh};

/// Picolitres in a ml.
const PL_PER_ML: f64 = 1e9;

/// How a wound bleeds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Bleeding {
    /// Blood that came so far, ml.
    pub bled_ml: f64,
    /// Blood that was sucked away, ml.
    pub sucked_ml: f64,
    /// Blood that lies in the wound, ml.
    pub lies_ml: f64,
    /// Saline that rinsed, ml.
    pub rinsed_ml: f64,
    /// Blood that comes now, ml/min.
    pub rate_ml_per_min: f32,
    /// Most blood that came at a time, ml/min.
    pub worst_ml_per_min: f32,
    /// Sources that were closed by heat.
    pub coagulated: u32,
    /// Stain of each node of the brain: blood of 0 to 2 mm as 0 to 200, 255 for a burn.
    #[serde(skip)]
    pub stains: Vec<u8>,
}

impl Bleeding {
    /// Takes another's state; does not allocate if there is room for its stains.
    pub fn copy_from(&mut self, other: &Self) {
        let &Self { bled_ml, sucked_ml, lies_ml, rinsed_ml, rate_ml_per_min, worst_ml_per_min, coagulated, .. } = other;
        let mut stains = std::mem::take(&mut self.stains);
        stains.clone_from(&other.stains);
        *self = Self { bled_ml, sucked_ml, lies_ml, rinsed_ml, rate_ml_per_min, worst_ml_per_min, coagulated, stains };
    }
}

/// The wound and its account.
pub(crate) struct Bleeder {
    pub wound: Wound,
    /// Against gravity, a unit vector.
    up: Vec3,
    /// Splits of nodes that the wound follows.
    followed: usize,
    last_ms: f64,
}

impl Bleeder {
    pub fn of(mesh: &TetMesh, perfusion: &[Perfusion], up: Vec3) -> Self {
        Self { wound: Wound::of(mesh, perfusion), up, followed: 0, last_ms: 0.0 }
    }

    /// Takes tetrahedra away, goes on to a time with the tools whose pedal is down, and keeps
    /// account.
    pub fn step(
        &mut self,
        now_ms: f64,
        used: [Option<SecondTool>; 2],
        positions: &[Vec3],
        gone: impl Iterator<Item = u32>,
        now: &mut Bleeding,
    ) {
        self.last_ms = now_ms;
        gone.for_each(|tet| self.wound.remove(tet, positions, now_ms));
        let acts = used.into_iter().flatten().filter_map(|SecondTool { tool, state, .. }| {
            let act = match tool.kind {
                ToolKind::Aspirator => Act::Suck,
                ToolKind::Bipolar => Act::Coagulate,
                _ => return None,
            };
            Some((state.tip(), tool.tip_radius_mm, act))
        });
        self.wound.step(now_ms, positions, self.up, acts);
        self.tell(self.wound.rate_ml_per_min(now_ms), now);
    }

    /// Follows all splits of nodes so far, with all nodes at `positions`, mm; what comes to light
    /// bleeds.
    pub fn split(&mut self, splits: &[Split], positions: &[Vec3], now: &mut Bleeding) {
        let new = splits.get(self.followed..).unwrap_or_default();
        self.wound.split(new, Some(positions), self.last_ms);
        self.follows(splits.len(), now);
    }

    /// Learns how many splits the wound follows.
    pub fn follows(&mut self, splits: usize, now: &mut Bleeding) {
        self.followed = self.followed.max(splits);
        now.stains.resize(self.wound.stains().len(), 0);
    }

    /// Tells how the wound is, with its rate, ml/min.
    pub fn tell(&self, rate: f32, now: &mut Bleeding) {
        let (account, lies) = (self.wound.account(), self.wound.lies_pl());
        let ml = |pl: u64| pl as f64 / PL_PER_ML;
        (now.bled_ml, now.rinsed_ml) = (ml(account.came[0]), ml(account.came[1]));
        (now.sucked_ml, now.lies_ml) = (ml(account.sucked[0]), ml(lies[0]));
        (now.rate_ml_per_min, now.worst_ml_per_min) = (rate, now.worst_ml_per_min.max(rate));
        now.coagulated = self.wound.coagulated();
        now.stains.copy_from_slice(self.wound.stains());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::second_hand::SecondHand;
    use trepan_geometry::{Pose, Tool, ToolState};
    use trepan_soft::boxes;

    /// A block bleeds from a hole in its top while the first hand's forceps are far above it.
    #[test]
    fn an_aspirator_of_the_second_hand_sucks() {
        let mesh = boxes::split_box([4, 4, 4], Vec3::splat(8.0));
        let brain = Perfusion { capillaries: 1.0, vessel: 1.0 };
        let top = Vec3::new(4.0, 4.0, 8.0);
        let middle = |tet: u32| mesh.corners(tet as usize).into_iter().sum::<Vec3>() / 4.0;
        let hole: Vec<u32> = (0..mesh.tets.len() as u32).filter(|&tet| middle(tet).distance(top) < 2.0).collect();
        let at =
            |place: Vec3, tool: Tool| SecondTool { tool, slot: 0, state: ToolState::at(Pose::from_translation(place)) };
        let sucked_ml = |second: Option<SecondTool>| {
            let mut bleeder = Bleeder::of(&mesh, &vec![brain; mesh.tets.len()], Vec3::Z);
            let mut now = Bleeding { stains: vec![0; mesh.positions.len()], ..Bleeding::default() };
            for tick in 1..2000 {
                let used = [Some(at(top + 30.0 * Vec3::Z, Tool::bipolar())), second];
                let gone = hole.iter().copied().filter(|_| tick == 1);
                bleeder.step(f64::from(tick), used, &mesh.positions, gone, &mut now);
            }
            assert!(now.bled_ml > 0.1 && now.coagulated == 0, "{:?}", now.bled_ml);
            now.sucked_ml
        };
        assert_eq!(sucked_ml(None), 0.0);
        assert!(sucked_ml(Some(at(top - 1.5 * Vec3::Z, SecondHand::tool()))) > 0.1);
    }
}
