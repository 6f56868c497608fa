//! Soft-tissue solvers: how right each is and what that costs, and where each fails.

mod closed_forms;
mod fronts;
mod locking;
mod motion;
mod slender;
mod speed;
mod stability;

use super::Scope;
use crate::suite::Findings;

/// Every scene, in the order of the shards.
pub fn run(scope: Scope) -> Findings {
    let scenes: [fn(Scope, &mut Findings); 7] = [
        fronts::run,
        |_, findings| closed_forms::run(findings),
        locking::run,
        motion::run,
        slender::run,
        speed::run,
        stability::run,
    ];
    let mut findings = Findings::default();
    for (number, scene) in scenes.into_iter().enumerate() {
        if scope.takes(number) {
            scene(scope, &mut findings);
        }
    }
    findings
}
