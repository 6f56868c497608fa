//! Turns the numbers of a device test into findings, each with a remedy if it is bad.

use crate::device_test::measured::{Finding, Floor, Measured, Timing};
use trepan_geometry::Vec3;
use trepan_haptics::Capabilities;

/// Derives the findings from the measurements.
pub fn of(measured: &Measured, device: &Capabilities) -> Vec<Finding> {
    let [rate, pauses] = timing(&measured.timing);
    let mut found = vec![rate, pauses, range(measured, device), delay(measured, device), floor(&measured.floor)];
    found.extend(measured.fault.iter().map(|fault| Finding { good: false, text: fault.clone() }));
    found
}

/// Makes a finding; the remedy is added if `good` is false.
fn finding(good: bool, text: String, remedy: &str) -> Finding {
    Finding { good, text: if good { text } else { format!("{text}: {remedy}") } }
}

fn timing(timing: &Timing) -> [Finding; 2] {
    let Timing { fresh_hz, asked_hz, gap_us, late_ticks, .. } = timing;
    let rate = format!("{fresh_hz:.0} new positions a second, {asked_hz:.0} requested");
    let (usual_ms, slowest_ms) = (gap_us.p99 * 1e-3, gap_us.max * 1e-3);
    let pauses = format!(
        "99 of 100 positions come within {usual_ms:.2} ms, the slowest took {slowest_ms:.1} ms; {late_ticks} ticks were late"
    );
    [
        finding(*fresh_hz >= 0.9 * asked_hz, rate, "close other programs; look at cable and hub"),
        finding(
            gap_us.p99 <= 2e6 / asked_hz,
            pauses,
            "close other programs, allow real-time priority (`ulimit -r 80`)",
        ),
    ]
}

fn delay(measured: &Measured, device: &Capabilities) -> Finding {
    match measured.delay_ms {
        _ if device.axes_driven == 0 => finding(true, "the device has no motors: nothing can be felt".into(), ""),
        Some(delay) => finding(
            delay <= 8.0,
            format!("the hand moves within {delay:.1} ms of a force"),
            "stiff walls will oscillate",
        ),
        None => finding(
            false,
            "the hand did not move at the taps".into(),
            "hold the tool lightly and still; if you felt none, check that the device's force is switched on",
        ),
    }
}

fn range(measured: &Measured, device: &Capabilities) -> Finding {
    let [low, high] = measured.explored_mm.map(Vec3::from);
    let (size, whole) = (high - low, device.workspace_mm);
    let mut text =
        format!("the hand explored {:.0} x {:.0} x {:.0} mm (right, up, towards you)", size.x, size.y, size.z);
    if whole.is_finite() {
        text += &format!(" of {:.0} x {:.0} x {:.0}", whole.x, whole.y, whole.z);
    }
    let far = !whole.is_finite() || (size / whole).min_element() >= 0.3;
    finding(far, text, "move further, to the edges of the workspace")
}

fn floor(floor: &Floor) -> Finding {
    if floor.touched_s == 0.0 {
        return finding(false, "the floor was not touched".into(), "press down when asked to");
    }
    let ticks = floor.guard.passivity + floor.guard.bounded;
    let calm = ticks as f64 <= 200.0 * floor.touched_s && floor.guard.restarted == 0;
    let Floor { touched_s, force_n, depth_mm, energy_out_mj, .. } = floor;
    let text = format!(
        "the floor was pressed for {touched_s:.1} s with up to {force_n:.2} N, {depth_mm:.1} mm deep; its net energy output was {energy_out_mj:.3} mJ"
    );
    finding(calm, text, "the force guard damped an oscillation; hold the tool more firmly, check the delay above")
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_runtime::Quantiles;

    #[test]
    fn a_fast_rate_is_good_and_a_slow_or_uneven_one_is_not() {
        let rate_of = |fresh_hz: f64, p99: f64| {
            let us = |p99| Quantiles { p99, ..Quantiles::default() };
            let times = |gap_us| Timing {
                seconds: 10.0,
                asked_hz: 1000.0,
                tick_hz: 1000.0,
                fresh_hz,
                late_ticks: 0,
                tick_us: us(1000.0),
                gap_us,
                jitter_us: us(10.0),
                read_us: us(1.0),
                apply_us: us(1.0),
            };
            timing(&times(us(p99))).map(|finding| finding.good)
        };
        assert_eq!(
            [rate_of(990.0, 1100.0), rate_of(500.0, 1100.0), rate_of(990.0, 8000.0)],
            [[true; 2], [false, true], [true, false]]
        );
    }
}
