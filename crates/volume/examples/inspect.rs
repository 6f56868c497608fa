//! Prints size, spacing, orientation, range and notes of image files: `inspect FILE|FOLDER...`.

use std::path::Path;
use trepan_volume::import;

fn main() {
    for path in std::env::args().skip(1) {
        match import(Path::new(&path)) {
            Err(error) => println!("error: {error}"),
            Ok(import) => {
                let volume = &import.volume;
                let finite = volume.data.iter().copied().filter(|v| v.is_finite());
                let (low, high) = finite.fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(v), h.max(v)));
                let mean = volume.data.iter().map(|&v| f64::from(v)).sum::<f64>() / volume.data.len() as f64;
                println!("{path}: {:?} voxels of {:.4} mm", volume.dims, volume.spacing_mm());
                println!("    {low} to {high}, mean {mean:.6}");
                for row in 0..3 {
                    let offset = volume.world_from_voxel.translation[row];
                    println!("    {:.6} {offset:.6}", volume.world_from_voxel.matrix3.row(row));
                }
                let last = volume.dims.map(|n| n - 1);
                println!(
                    "    first {:?}, (5, 7, 3) {:?}, last {:?}",
                    volume.data[0],
                    volume.get([5, 7, 3]),
                    volume.get(last)
                );
                import.facts.iter().for_each(|(name, fact)| println!("    {name}: {fact}"));
                import.notes.iter().for_each(|note| println!("    note: {note}"));
            }
        }
    }
}
