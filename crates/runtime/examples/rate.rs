//! Shows how late this machine wakes a haptic thread: ticks at a rate for some seconds.
//!
//! ```text
//! cargo run --release -p trepan-runtime --example rate [-- HZ SECONDS]
//! ```

use trepan_runtime::Times;
use trepan_runtime::clock::{Clock, Schedule, Waits};
use trepan_runtime::threads::real_time;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut numbers = std::env::args().skip(1).map(|word| word.parse::<f64>());
    let rate_hz = numbers.next().transpose()?.unwrap_or(1000.0);
    let end_ms = 1e3 * numbers.next().transpose()?.unwrap_or(5.0);
    real_time(80, "haptic").iter().for_each(|remark| println!("{remark}"));
    let (clock, mut waits, mut late, mut missed) = (Clock::start(), Waits::default(), Times::default(), 0);
    let mut schedule = Schedule::new(1e3 / rate_hz, clock.now_ms());
    while clock.now_ms() < end_ms {
        waits.until(schedule.next_ms(), &clock);
        late.add_us(1e3 * (clock.now_ms() - schedule.next_ms()) as f32);
        missed += u32::from(schedule.advance(clock.now_ms()));
    }
    let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|quantile| late.quantile_us(quantile));
    println!("late by: p50 {p50:.1} us, p99 {p99:.1} us, p99.9 {p999:.1} us, most {:.0} us", late.max_us());
    println!("{missed} ticks missed");
    Ok(())
}
