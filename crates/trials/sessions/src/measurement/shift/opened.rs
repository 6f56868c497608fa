//! The brain with the dura open: shift against time, and the swing of pulse and breathing.

use super::head::{Head, Still};
use crate::measurement::comparison::{Comparison, How};
use anyhow::Result;
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_measurements::{Row, pulse, shift, support};
use trepan_soft::Loads;
use trepan_stages::{Phase, Settling};

/// When the cortex is looked at, minutes after the dura was opened.
const MINUTES: [f64; 9] = [0.5, 5.0, 10.0, 20.0, 35.0, shift::TIME_DURING.value, 75.0, shift::TIME_END.value, 150.0];

/// Shift of the cortex under the opening against time.
pub fn shift(findings: &mut Findings) -> Result<()> {
    let head = Head::new()?;
    let mut still = head.at_rest()?;
    let mut settling = Settling::draining(&head.brain.mesh, head.up(), support::CSF_LOSS.f32(), 1.0);
    let (mut line, mut sunk, mut deep) = (vec![(0.0, 0.0)], 0.0, 0.0);
    let centre = head.brain.mesh.bounds().centre();
    for minutes in MINUTES {
        drain(&mut still, &mut settling, minutes);
        still.rest(minutes)?;
        line.push((minutes, still.cortex_moved().length().into()));
        sunk = -still.cortex_moved().dot(head.up());
        deep = still.moved_around(centre, 15.0).length();
    }
    let at = |wanted: &Row| line.iter().find(|(minutes, _)| *minutes == wanted.value).map_or(f64::NAN, |(_, mm)| *mm);
    let fitted = |row, ours| Comparison::of(row, How::Fitted, ours);
    findings.rows.extend(
        [
            fitted(&shift::LANDMARKS_DURING, at(&shift::TIME_DURING)),
            fitted(&shift::LANDMARKS_END, at(&shift::TIME_END)),
            Comparison::of(&shift::GRAVITY, How::Predicted, sunk.into()).why(
                "the share of buoyancy that is lost stands at 0.3, which fits the landmarks; the brain sinks further \
                 with more",
            ),
        ]
        .map(|comparison| comparison.row()),
    );
    findings.conclusions.push(format!(
        "Two and a half hours after the dura was opened the cortex has sunk by {sunk:.1} mm, the centre of the brain \
         by {deep:.1} mm."
    ));
    let band = |sign: f64| {
        let at = |row: &Row, time: &Row| (time.value, row.value + sign * row.spread);
        vec![at(&shift::LANDMARKS_DURING, &shift::TIME_DURING), at(&shift::LANDMARKS_END, &shift::TIME_END)]
    };
    findings.series.push(Series::over(
        "Shift of the cortex after the dura was opened",
        ["minutes after opening", "displacement, mm"],
        [
            ("this project".into(), line),
            ("61 patients, mean".into(), band(0.0)),
            ("mean plus standard deviation".into(), band(1.0)),
            ("mean less standard deviation".into(), band(-1.0)),
        ],
    ));
    Ok(())
}

/// Sets the level of the fluid some minutes after the dura was opened, without waves.
fn drain(still: &mut Still, settling: &mut Settling, minutes: f64) {
    let mut loads = Loads::default();
    settling.load(Phase::Brain, 0.0, &mut loads);
    settling.load(Phase::Brain, minutes * 60e3, &mut loads);
    loads.fluid.opening_mpa = 0.0;
    still.loads = loads;
}

/// Swing of the exposed cortex with heart and lungs.
pub fn pulse(findings: &mut Findings) -> Result<()> {
    let head = Head::new()?;
    // Just after craniotomy, before the fluid has drained.
    let swing = |amplitude: &Row, frequency: &Row| -> Result<f64> {
        let mut still = head.at_rest()?;
        still.loads.fluid.opening_mpa = amplitude.f32() * pulse::MMHG.f32();
        // The load acts for the time in which the wave turns by a radian.
        still.rest(1.0 / (std::f64::consts::TAU * frequency.value * 60.0))?;
        Ok(still.cortex_moved().dot(head.up()).into())
    };
    let heart = swing(&pulse::PULSE_PRESSURE, &pulse::PULSE_FREQUENCY)?;
    let breath = swing(&pulse::BREATHING_PRESSURE, &pulse::BREATHING_FREQUENCY)?;
    findings.rows.push(
        Comparison::of(&pulse::CORTEX_MOTION, How::Predicted, heart)
            .why("the pressure wave was measured in the closed skull; an open one yields, and the wave is lower in it")
            .row(),
    );
    findings.conclusions.push(format!(
        "In an opening of 24 mm the pulse moves the cortex by {heart:.2} mm and breathing by {breath:.2} mm."
    ));
    Ok(())
}
