//! A blade that holds the brain aside: its pressure against time.

use super::head::{Head, Still};
use crate::measurement::comparison::{Comparison, How};
use anyhow::Result;
use trepan_contact::PlaneContact;
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_measurements::{pulse, retraction};

/// When the pressure is read, minutes after the blade was set.
const MINUTES: [f64; 12] = [0.0, 0.005, 0.02, 0.1, 0.5, 1.0, 2.0, 5.0, 6.6, 10.0, 20.0, 40.0];
/// The approach: its first minutes, over which the clinical recordings were averaged.
const APPROACH_MIN: f64 = 5.0;
/// Time at which the work at the lesion is read, minutes.
const MAIN_MIN: f64 = 20.0;
/// Spring of the blade, N/mm for each mm² of cortex, numerical: it yields by hundredths of a mm.
const BLADE_STIFFNESS: f32 = 0.05;

/// Pressure under a blade that is set and held.
pub fn findings(findings: &mut Findings) -> Result<()> {
    let head = Head::new()?;
    let mut still = head.at_rest()?;
    let mut line = Vec::new();
    for minutes in MINUTES {
        press(&head, &mut still);
        still.rest(minutes)?;
        line.push((minutes, pressure_torr(&still)));
    }
    let first = line[0].1;
    let at = |wanted: f64| {
        let pair = line.windows(2).find(|pair| pair[0].0 <= wanted && wanted <= pair[1].0);
        pair.map_or(f64::NAN, |pair| {
            let part = (wanted - pair[0].0) / (pair[1].0 - pair[0].0);
            pair[0].1 + part * (pair[1].1 - pair[0].1)
        })
    };
    let early: f64 = (1..=500).map(|n| at(APPROACH_MIN * f64::from(n) / 500.0)).sum::<f64>() / 500.0;
    let half = line.iter().find(|(_, torr)| *torr <= 0.5 * first).map_or(f64::INFINITY, |(minutes, _)| *minutes);
    let predicted = |row, ours| Comparison::of(row, How::Predicted, ours);
    let quick = "relaxation was measured in the dish, and to 250 s only; in life pressure falls on for longer, and the \
                 surgeon sets the blade again";
    findings.rows.extend(
        [
            predicted(&retraction::TUMOUR_APPROACH, early).why(quick),
            predicted(&retraction::TUMOUR_MAIN, at(MAIN_MIN)).why(quick),
            predicted(&retraction::ANEURYSM_APPROACH, early).why(quick),
            predicted(&retraction::ANEURYSM_MAIN, at(MAIN_MIN)).why(
                "around an aneurysm the brain is swollen by the bleeding and held wider; pressure rises there, and \
                 falls in a blade that is set once",
            ),
            predicted(&retraction::HALF_TIME, half).why(quick),
            predicted(&retraction::RECORDED_MOST, first).why(
                "that is the largest of 120 blades, at depths that were not published; here is one blade, a centimetre \
                 deep",
            ),
        ]
        .map(|comparison| comparison.row()),
    );
    findings.series.push(Series::over(
        "Pressure under a retractor that is set and held",
        ["minutes", "pressure, torr"],
        [
            ("this project".into(), line),
            (
                "tumours, approach, mean".into(),
                vec![(0.0, retraction::TUMOUR_APPROACH.value), (APPROACH_MIN, retraction::TUMOUR_APPROACH.value)],
            ),
            (
                "tumours, at the lesion, mean".into(),
                vec![(MAIN_MIN, retraction::TUMOUR_MAIN.value), (40.0, retraction::TUMOUR_MAIN.value)],
            ),
            (
                "harm to 1 rat of 6 after 15 min".into(),
                vec![(0.0, retraction::HARM[0].at), (15.0, retraction::HARM[0].at)],
            ),
        ],
    ));
    Ok(())
}

/// Sets the blade: a plane across the opening's cortex, as deep as an exposure needs.
fn press(head: &Head, still: &mut Still) {
    let (up, entry) = (head.up(), head.plan.site.entry);
    let bared = still.bared();
    let surface = bared.iter().map(|(node, _)| still.body.mesh.positions[*node].dot(up)).fold(f32::MIN, f32::max);
    let across = up.any_orthonormal_vector();
    still.loads.contacts.clear();
    for (node, area_mm2) in bared {
        let aside = (still.body.mesh.positions[node] - entry).dot(across);
        if aside.abs() < 0.5 * retraction::BLADE_WIDTH.f32() {
            still.loads.contacts.push_plane(PlaneContact {
                node: node as u32,
                normal: up,
                offset_mm: retraction::BLADE_DEPTH.f32() - surface,
                stiffness: BLADE_STIFFNESS * area_mm2,
                damping: 2.0 * BLADE_STIFFNESS * area_mm2,
            });
        }
    }
}

/// Force of the blade over the area of the cortex that it touches, torr.
fn pressure_torr(still: &Still) -> f64 {
    let (mut force, mut area) = (0.0, 0.0);
    for plane in still.loads.contacts.planes() {
        let depth_mm = plane.depth_mm(still.place(plane.node as usize));
        if depth_mm > 0.0 {
            force += plane.stiffness * depth_mm;
            area += plane.stiffness / BLADE_STIFFNESS;
        }
    }
    f64::from(force / area / pulse::MMHG.f32())
}
