//! Compares two distributions of points over a burr: prints count and nearest-neighbour spacing of
//! each.

use trepan_geometry::{Pointshell, Spread, Tool};

fn main() {
    let burr = Tool::burr(2.0);
    for spread in [Spread::Fibonacci, Spread::LatitudeLongitude] {
        let shell = Pointshell::sphere(burr.tip_radius_mm, Pointshell::RIGID_COUNT, spread);
        let spacing: Vec<f32> = shell
            .points
            .iter()
            .map(|p| shell.points.iter().map(|q| p.distance(*q)).filter(|&d| d > 0.0).fold(f32::MAX, f32::min))
            .collect();
        let (low, high) = spacing.iter().fold((f32::MAX, 0.0f32), |(l, h), &d| (l.min(d), h.max(d)));
        println!("{spread:?}: {} points, nearest neighbour {low:.3} to {high:.3} mm", shell.points.len());
    }
}
