//! A scalpel incises the dura by a cross, sutures hold its leaves back; forces and times.

use std::time::Instant;
use trepan_dura::{Dura, Tip};
use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;

/// Edge of the block's cubes, mm, and their number along an edge.
const EDGE_MM: f32 = 6.0;
const CUBES: usize = 10;

/// A block of tetrahedra whose top is a vault of 75 mm.
fn block() -> TetMesh {
    const SPLIT: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
    let n = CUBES + 1;
    let at = |i: usize| {
        let p = EDGE_MM * Vec3::new((i % n) as f32 - 5.0, (i / n % n) as f32 - 5.0, (i / n / n) as f32 - 10.0);
        p - Vec3::Z * p.truncate().length_squared() / 150.0
    };
    let corner = |cube: usize, c: usize| {
        let (x, y, z) = (cube % CUBES, cube / CUBES % CUBES, cube / CUBES / CUBES);
        (x + (c & 1) + n * (y + (c >> 1 & 1) + n * (z + (c >> 2)))) as u32
    };
    let tets = (0..CUBES.pow(3)).flat_map(|cube| SPLIT.map(|split| split.map(|c| corner(cube, c)))).collect();
    TetMesh { positions: (0..n.pow(3)).map(at).collect(), tets }
}

fn main() {
    let mut dura = Dura::over(&block(), Vec3::Z * 10.0, Vec3::Z, 20.0).expect("a block below");
    dura.pin(0..dura.nodes(), |place, _| place.truncate().length() > 12.0);
    println!("{} nodes, {} triangles, an opening of 12 mm", dura.nodes(), dura.triangles().count());
    println!("{:<24} {:>11} {:>11} {:>9} {:>9}", "", "incised mm", "force N", "step us", "worst us");
    let mut now_ms = 0.0;
    let mut lead = |dura: &mut Dura, label: &str, places: &[Vec3], cuts: bool| {
        let (mut most_n, mut all_us, mut worst_us, mut steps) = (0.0f32, 0.0, 0.0f64, 0u32);
        for pair in places.windows(2) {
            for part in 0..500u16 {
                now_ms += 1.0;
                let at = pair[0].lerp(pair[1], f32::from(part) / 500.0);
                let began = Instant::now();
                most_n = most_n.max(dura.step(now_ms, [Some(Tip { at, radius_mm: 0.5, cuts }), None])[0].length());
                let us = began.elapsed().as_secs_f64() * 1e6;
                (all_us, worst_us, steps) = (all_us + us, worst_us.max(us), steps + 1);
            }
        }
        let incised_mm = dura.account().incised_mm;
        println!("{label:<24} {incised_mm:>11.1} {most_n:>11.2} {:>9.1} {worst_us:>9.1}", all_us / f64::from(steps));
    };
    for line in dura.cross(10.0, 10) {
        let down = |place: &Vec3, mm: f32| *place - mm * Vec3::Z;
        let [first, last] = [line[0], line[10]];
        lead(&mut dura, "the scalpel comes", &[down(&first, -5.0), down(&first, 1.2)], false);
        let along: Vec<Vec3> = line.iter().map(|place| down(place, 1.2)).collect();
        lead(&mut dura, "it incises", &along, true);
        lead(&mut dura, "it is lifted", &[down(&last, 1.2), down(&last, -5.0)], false);
    }
    dura.hold_back();
    lead(&mut dura, "leaves are held back", &[Vec3::Z * 40.0; 11], false);
    let over = dura.places().filter(|place| place.truncate().length() < 6.0 && *place != Vec3::ZERO).count();
    println!("{over} nodes are left over the middle of 6 mm; {:?}", dura.account());
}
