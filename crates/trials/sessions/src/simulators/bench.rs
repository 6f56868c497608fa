//! A haptic stage with a simulated device in a simulated hand, tick by tick without a clock.

use std::sync::Arc;
use trepan_bone::{BoneVolume, FlapSearch};
use trepan_contact::SurfacePatch;
use trepan_geometry::ToolState;
use trepan_haptics::HapticDevice;
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_link::wire::TickRecord;
use trepan_stages::{HapticConfig, HapticStage, Notice, Program, TickInput, Warning, What};
use trepan_volume::DistanceField;

/// What a tick without tissue is given.
const NO_PATCH: SurfacePatch = SurfacePatch {
    time_ms: 0.0,
    tissue_ms: 0.0,
    normal: trepan_geometry::Vec3::ZERO,
    tip_mm: trepan_geometry::Vec3::ZERO,
    force_n: 0.0,
    normal_velocity: 0.0,
    couple_mm: trepan_geometry::Vec3::ZERO,
};

/// One operation.
pub struct Bench {
    /// The stage.
    pub stage: HapticStage,
    hand: Simulated,
    dt_ms: f64,
    /// Every tick so far.
    pub records: Vec<TickRecord>,
    /// Every notice so far.
    pub notices: Vec<Notice>,
}

impl Bench {
    /// A hand that means to go where `intent` goes, at 1 kHz.
    pub fn new(
        program: Program,
        bone: Arc<BoneVolume>,
        brain: Arc<DistanceField>,
        search: Option<FlapSearch>,
        grip: HandModel,
        mut intent: Box<dyn HapticDevice>,
    ) -> Self {
        let start = intent.read(0.0).tool;
        let stage = HapticStage::new(config(program), Some(bone), Some(brain), start);
        let stage = search.into_iter().fold(stage, |stage, search| stage.with_flap(search, true));
        let hand = Simulated::new(Config::TOUCH, grip, intent);
        Self { stage, hand, dt_ms: 1.0, records: Vec::new(), notices: Vec::new() }
    }

    /// Ticks until a time or until `over` says so.
    pub fn run(&mut self, until_ms: f64, mut over: impl FnMut(&TickRecord) -> bool) {
        let mut tick = self.records.len() as u64;
        while tick as f64 * self.dt_ms < until_ms {
            tick += 1;
            let reading = self.hand.read(tick as f64 * self.dt_ms);
            let tool = ToolState { time_ms: tick as f64 * self.dt_ms, ..reading.tool };
            let reading = trepan_haptics::Reading { tool, ..reading };
            let notices = &mut self.notices;
            let input = TickInput { tick, reading, patch: &NO_PATCH, patch_seq: 0, second: None, second_n: 0.0 };
            let done = self.stage.tick(&input, &mut |notice| notices.push(notice));
            self.hand.apply(done.wrench);
            self.records.push(done.record);
            if over(&done.record) {
                break;
            }
        }
    }

    /// The tick in which a warning was first raised.
    pub fn raised(&self, warnings: &[Warning]) -> Option<u64> {
        let is = |notice: &&Notice| matches!(notice.what, What::Warning(w, true, _) if warnings.contains(&w));
        self.notices.iter().find(is).map(|notice| notice.tick)
    }
}

/// As a session configures a stage for a Touch.
pub fn config(program: Program) -> HapticConfig {
    let mut config = HapticConfig::usual(program);
    config.bone_force.mean.model.normal.stiffness = 1.0;
    config
}
