//! Writes heads of a synthetic population and one picture of all of them.
//!
//! `cargo run -p trepan-trials-scenes --example heads -- N FOLDER [SEED]`: writes one folder per
//! head and `heads.png`. Each row of the picture is a head: CT from above and from the side, MRI
//! from above, the side and the front, with the outlines of the true brain in green and of the
//! tumour in red.

use anyhow::{Context, Result};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;
use std::time::Instant;
use trepan_render::Image;
use trepan_trials_scenes::population::{Head, HeadRecipe, base_heads};
use trepan_volume::{Grid, Interpolation, Sample, VoxelVolume, resample};

/// Edge of a view, px of 1 mm.
const SIDE: usize = 280;
const ABOVE: [DVec3; 2] = [DVec3::X, DVec3::NEG_Y];
const ASIDE: [DVec3; 2] = [DVec3::Y, DVec3::NEG_Z];
const FRONT: [DVec3; 2] = [DVec3::X, DVec3::NEG_Z];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [count, folder, seed @ ..] = &arguments[..] else { anyhow::bail!("give a number of heads and a folder") };
    let seed = seed.first().map_or(Ok(1), |seed| seed.parse()).context("the seed is a whole number")?;
    let (bases, folder) = (base_heads()?, Path::new(folder));
    let mut rgba = Vec::new();
    for (number, recipe) in HeadRecipe::of_run(seed, count.parse()?, bases.len()).iter().enumerate() {
        let start = Instant::now();
        let head = Head::make(recipe, &bases[recipe.base]);
        let seconds = start.elapsed().as_secs_f64();
        head.write(&folder.join(format!("head-{number:02}")))?;
        println!("{number:02} {} [{seconds:.1} s, kept {:.2}]", recipe.describe(), head.share);
        rgba.extend(row(&head));
    }
    let (width, height) = (5 * SIDE as u32, (rgba.len() / (20 * SIDE)) as u32);
    Image { width, height, rgba }.write_png(&folder.join("heads.png"))?;
    Ok(())
}

fn row(head: &Head) -> Vec<u8> {
    let mut sum = (DVec3::ZERO, 0.0);
    for (at, _) in head.brain.data.iter().enumerate().filter(|(_, v)| **v != 0) {
        let [nx, ny, _] = head.brain.dims;
        sum = (sum.0 + head.brain.centre_of([at % nx, at / nx % ny, at / (nx * ny)]), sum.1 + 1.0);
    }
    let middle = sum.0 / sum.1;
    let ct = |to: [DVec3; 2]| look(head, middle, to, &head.ct, |hu| (hu + 200.0) / 1400.0);
    let brightest = head.mri.data.iter().copied().fold(0.0, f32::max);
    let mri = |to: [DVec3; 2]| look(head, middle, to, &head.mri, |v| 1.3 * v / brightest);
    let looks = [ct(ABOVE), ct(ASIDE), mri(ABOVE), mri(ASIDE), mri(FRONT)];
    (0..SIDE).flat_map(|y| looks.iter().flat_map(move |look| look[4 * SIDE * y..][..4 * SIDE].to_vec())).collect()
}

fn look<T: Sample>(
    head: &Head,
    middle: DVec3,
    [right, down]: [DVec3; 2],
    image: &VoxelVolume<T>,
    grey: impl Fn(f32) -> f32,
) -> Vec<u8> {
    let corner = middle - 0.5 * SIDE as f64 * (right + down);
    let world_from_voxel = DAffine3 { matrix3: DMat3::from_cols(right, down, right.cross(down)), translation: corner };
    let grid = Grid { dims: [SIDE, SIDE, 1], world_from_voxel };
    let values = resample(image, &grid, Interpolation::Trilinear, T::from_f32(-1000.0));
    let [brain, tumour] = [Some(&head.brain), head.tumour.as_ref()].map(|mask| {
        let cut = |mask| resample(mask, &grid, Interpolation::Nearest, 0u8).data;
        mask.map_or(vec![0; SIDE * SIDE], cut)
    });
    let border = |mask: &[u8], at: usize| at >= SIDE && (mask[at] != mask[at - 1] || mask[at] != mask[at - SIDE]);
    let pixel = |(at, value): (usize, &T)| {
        let grey = (255.0 * grey(value.to_f32()).clamp(0.0, 1.0)) as u8;
        match (border(&tumour, at), border(&brain, at)) {
            (true, _) => [255, 60, 60, 255],
            (_, true) => [60, 230, 90, 255],
            _ => [grey, grey, grey, 255],
        }
    };
    values.data.iter().enumerate().flat_map(pixel).collect()
}
