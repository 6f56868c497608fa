//! Contact force: a pressed hand that does not come to rest, a wall that pushes on through, a jump
//! at an edge.

use super::{Candidate, Family, Scope, Standing};
use crate::suites::force::{CHOSEN, Model, Press, QUIET_MM, models, press_into, slid_over_an_edge};
use trepan_evidence::nearest::{Condition, Scale, Trial, exceeds};
use trepan_haptics::simulated::HandModel;

/// Largest change of force in a tick, N.
const MOST_N: f64 = 0.5;

pub const FAMILY: Family<Model> = Family {
    suite: "force",
    criterion: "a model fails when a hand pressed against a wall swings by more than 0.1 mm a second later (no guard, \
                no friction, exact encoders: only the model and the hand damp), when a wall pushes the tool further in, \
                when the force changes by more than 0.5 N in a tick over an edge, or is not a number",
    methods,
};

fn methods(_: Scope) -> Vec<Candidate<Model>> {
    let candidate = |(name, method): (&'static str, Model)| {
        let standing = if name == CHOSEN { Standing::Own } else { Standing::by_name(name) };
        Candidate { name: name.into(), standing, conditions: &CONDITIONS, method }
    };
    models().into_iter().map(candidate).collect()
}

const AXES: [&str; 2] = ["time, ms", "place of the handle, mm"];
const PRESS: Press = Press { stiffness: 0.5, delay_ticks: 1, thick_mm: None, tick_ms: 1.0, hand: HandModel::LIGHT };
/// A wall that is half pressed through.
const WALL: Press = Press { thick_mm: Some(8.0), ..PRESS };

const CONDITIONS: [Condition<Model>; 6] = [
    Condition {
        name: "stiffness of a wall",
        unit: "N/mm",
        nominal: 0.5,
        limits: [0.01, 64.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |model, stiffness| pressed(model, &Press { stiffness: stiffness as f32, ..PRESS }),
    },
    Condition {
        name: "delay of the force",
        unit: "ticks",
        nominal: 1.0,
        limits: [1.0, 16.0],
        scale: Scale::Whole,
        axes: AXES,
        trial: |model, ticks| pressed(model, &Press { delay_ticks: ticks as usize, ..PRESS }),
    },
    Condition {
        name: "time step of the haptic loop",
        unit: "ms",
        nominal: 1.0,
        limits: [1.0, 32.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |model, tick_ms| pressed(model, &Press { tick_ms: tick_ms as f32, ..PRESS }),
    },
    Condition {
        name: "damping of the hand",
        unit: "N ms/mm",
        nominal: 2.0,
        limits: [0.01, 64.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |model, damping| {
            pressed(model, &Press { hand: HandModel { damping: damping as f32, ..HandModel::LIGHT }, ..PRESS })
        },
    },
    Condition {
        name: "thickness of a wall",
        unit: "mm",
        nominal: 8.0,
        limits: [0.1, 8.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |model, thick_mm| pressed(model, &Press { thick_mm: Some(thick_mm as f32), ..WALL }),
    },
    Condition {
        name: "angle of an edge",
        unit: "°",
        nominal: 10.0,
        limits: [0.1, 90.0],
        scale: Scale::Log,
        axes: ["time, ms", "force along the first face, N"],
        trial: edge,
    },
];

fn pressed(model: &Model, press: &Press) -> Trial {
    let mut trace = Vec::new();
    let held = press_into(model, press, |x| trace.push((trace.len() as f64 * f64::from(press.tick_ms), x.into())));
    let fault = if !held.finite {
        Some("not a number".into())
    } else if held.inward_n > 1e-3 {
        Some(format!("pushes the tool further in, by up to {:.2} N", held.inward_n))
    } else if exceeds(held.cycle_mm.into(), QUIET_MM.into()) {
        Some(format!("the hand swings by {:.2} mm", held.cycle_mm))
    } else {
        None
    };
    Trial { fault, trace }
}

fn edge(model: &Model, angle: f64) -> Trial {
    let mut trace = Vec::new();
    let most = slid_over_an_edge(model, angle as f32, |force| trace.push((trace.len() as f64, force.into())));
    let fault = (exceeds(most.into(), MOST_N)).then(|| format!("the force jumps by {most:.2} N in a tick"));
    Trial { fault, trace }
}
