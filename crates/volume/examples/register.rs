//! Tests registration with known motions.
//! `register FIXED MOVING [TRIALS]` moves the second image randomly, onto a rotated grid, and
//! registers it to the first.
//!
//! Errors are relative to the pose in the files' headers.

use glam::{DAffine3, DQuat, DVec3};
use std::path::Path;
use std::time::Instant;
use trepan_volume::{Grid, Interpolation, RegistrationConfig, RegistrationError, read, register, resample};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [fixed, moving, ..] = paths.as_slice() else { return Err("usage: register FIXED MOVING [TRIALS]".into()) };
    let (fixed, still) = (read(Path::new(fixed))?, read(Path::new(moving))?);
    let (low, high) = fixed.world_corners();
    let middle = 0.5 * (low + high);
    for trial in 0..paths.get(2).map_or(Ok(1), |n| n.parse())? {
        let number = |n: f64| ((f64::from(trial) * 8.0 + n) * 12.9898 * 7.77).sin();
        let axis = DVec3::new(number(1.0), number(2.0), number(3.0)).normalize();
        let shift = DVec3::new(number(4.0), number(5.0), number(6.0)).normalize() * 30.0 * number(7.0).abs();
        let turn = DQuat::from_axis_angle(axis, 20f64.to_radians() * number(8.0).abs());
        let known = DAffine3::from_translation(middle + shift)
            * DAffine3::from_quat(turn)
            * DAffine3::from_translation(-middle);
        let mut grid = Grid::of(&still);
        grid.world_from_voxel = known.inverse() * grid.world_from_voxel;
        let mut moving = resample(&still, &grid, Interpolation::Trilinear, still.data[0]);
        moving.world_from_voxel = known * grid.world_from_voxel;
        let start = Instant::now();
        let (verdict, found) = match register(&fixed, &moving, &RegistrationConfig::default()) {
            Ok(found) => ("accepted", found),
            Err(RegistrationError::Doubtful { found, .. }) => ("refused", *found),
            Err(other) => {
                println!("{other}");
                continue;
            }
        };
        let error = found.fixed_from_moving * known;
        println!(
            "{verdict}: moved {:.1} mm {:.1}°, off by {:.2} mm {:.2}°, metric {:.4} from {:.4}, confidence {:.2}, overlap {:.2}, halves {:.1} mm, {:.2} s",
            shift.length(),
            turn.to_scaled_axis().length().to_degrees(),
            (error.transform_point3(middle) - middle).length(),
            DQuat::from_mat3(&error.matrix3).to_scaled_axis().length().to_degrees(),
            found.metric,
            found.start_metric,
            found.confidence,
            found.overlap_share,
            found.halves_mm,
            start.elapsed().as_secs_f64()
        );
    }
    Ok(())
}
