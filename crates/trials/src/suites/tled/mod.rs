//! Soft-tissue solvers: how right each is and what that costs, and where each fails.

mod closed_forms;
mod device;
mod fronts;
mod locking;
mod motion;
mod region;
mod slender;
mod speed;
mod stability;

use super::Scope;
use crate::suite::Findings;

/// A scene that stands alone: what a shard takes or leaves.
type Scene = Box<dyn FnOnce(Scope, &mut Findings)>;

/// Every scene, in the order of the shards; then the charts of what was found.
pub fn run(scope: Scope) -> Findings {
    let mut scenes = fronts::scenes();
    scenes.push(Box::new(|_, findings| closed_forms::run(findings)));
    scenes.extend(locking::scenes(scope));
    scenes.extend(motion::scenes());
    scenes.extend([Box::new(region::run) as Scene, Box::new(device::run)]);
    scenes.extend(slender::scenes());
    scenes.extend(speed::scenes());
    scenes.extend(stability::scenes());
    let mut findings = Findings::default();
    for (number, scene) in scenes.into_iter().enumerate() {
        if scope.takes(number) {
            scene(scope, &mut findings);
        }
    }
    locking::draw(&mut findings);
    stability::draw(&mut findings);
    findings
}
