//! Times pictures of a dry and of a bloody brain in turn: `wet [WIDTH HEIGHT]`.

use glam::Vec3;
use std::error::Error;
use std::time::Instant;
use trepan_gpu::{Gpu, Prefer};
use trepan_mesh::TetMesh;
use trepan_render::{Camera, Frame, ProcessorRenderer, Renderer, SceneData};

/// Cubes along an edge.
const CUBES: usize = 24;

fn block() -> TetMesh {
    const SPLIT: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
    let n = CUBES + 1;
    let at = |i: usize| 4.0 * Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32) - 48.0;
    let corner = |cube: usize, c: usize| {
        let (x, y, z) = (cube % CUBES, cube / CUBES % CUBES, cube / CUBES / CUBES);
        (x + (c & 1) + n * (y + (c >> 1 & 1) + n * (z + (c >> 2)))) as u32
    };
    let tets = (0..CUBES.pow(3)).flat_map(|cube| SPLIT.map(|split| split.map(|c| corner(cube, c)))).collect();
    TetMesh { positions: (0..n.pow(3)).map(at).collect(), tets }
}

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u32> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let size = [numbers.first().copied().unwrap_or(640), numbers.get(1).copied().unwrap_or(480)];
    let mesh = block();
    let data = SceneData { bone: None, brain: Some(&mesh), mri: None, tint: None, cortex: None };
    let stains: Vec<u8> = (0..mesh.positions.len()).map(|node| (node % 250) as u8).collect();
    let dry = Frame::of(Camera::viewed_from(Vec3::ZERO, Vec3::new(0.7, 0.6, 0.9), 250.0));
    let wet = Frame { brain_stains: Some(&stains), ..dry };
    let mut processor = ProcessorRenderer::new(&data, size)?;
    time("processor", [&dry, &wet], |frame| Ok(_ = processor.draw(frame)?))?;
    let gpu = Gpu::open(Prefer::Hardware)?;
    let mut renderer = Renderer::new(&gpu, &data, size)?;
    time(&gpu.name(), [&dry, &wet], |frame| {
        renderer.draw(frame)?;
        Ok(gpu.wait()?)
    })
}

/// Prints the median times of two pictures, drawn in turn.
fn time(
    by: &str,
    frames: [&Frame; 2],
    mut draw: impl FnMut(&Frame) -> Result<(), Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let mut ms = [Vec::new(), Vec::new()];
    for turn in 0..41 {
        for (times, frame) in ms.iter_mut().zip(frames) {
            let start = Instant::now();
            draw(frame)?;
            times.extend((turn > 0).then(|| start.elapsed().as_secs_f64() * 1e3));
        }
    }
    ms.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
    let [dry, wet] = ms.map(|times| times[20]);
    println!("{by}: dry {dry:.2} ms, bloody {wet:.2} ms, {:.2} times", wet / dry);
    Ok(())
}
