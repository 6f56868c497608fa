//! A hole in a block bleeds for half a minute; then bipolar forceps go from source to source.

use trepan_bleeding::{Act, Perfusion, Wound};
use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;

/// Cubes along an edge, and their edge, mm.
const CUBES: usize = 16;
const EDGE_MM: f32 = 2.0;

fn block() -> TetMesh {
    const SPLIT: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
    let n = CUBES + 1;
    let at = |i: usize| EDGE_MM * Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
    let corner = |cube: usize, c: usize| {
        let (x, y, z) = (cube % CUBES, cube / CUBES % CUBES, cube / CUBES / CUBES);
        (x + (c & 1) + n * (y + (c >> 1 & 1) + n * (z + (c >> 2)))) as u32
    };
    let tets = (0..CUBES.pow(3)).flat_map(|cube| SPLIT.map(|split| split.map(|c| corner(cube, c)))).collect();
    TetMesh { positions: (0..n.pow(3)).map(at).collect(), tets }
}

fn main() {
    let mesh = block();
    let perfusion = |tet: usize| Perfusion { capillaries: 1.0, vessel: f32::from(tet.is_multiple_of(150)) };
    let mut wound = Wound::of(&mesh, &(0..mesh.tets.len()).map(perfusion).collect::<Vec<_>>());
    let top = Vec3::new(16.0, 16.0, 32.0);
    let centre = |tet: usize| mesh.corners(tet).into_iter().sum::<Vec3>() / 4.0;
    let hole = (0..mesh.tets.len()).filter(|&tet| centre(tet).distance(top) < 7.5);
    hole.for_each(|tet| wound.remove(tet as u32, &mesh.positions, 0.0));
    println!("{} tetrahedra, a hole of 7.5 mm", mesh.tets.len());
    println!("     s  ml/min   bled ml   lies ml  sucked ml");
    let (mut worst_us, mut all_us, steps) = (0.0f64, 0.0, 120_000u32);
    for step in 1..=steps {
        let now_ms = f64::from(step);
        let source = wound.worst(&mesh.positions, now_ms).filter(|_| now_ms > 30_000.0);
        let act = if step % 3000 < 500 { Act::Suck } else { Act::Coagulate };
        let tip = if act == Act::Suck { Some(top - 5.0 * Vec3::Z) } else { source };
        let began = std::time::Instant::now();
        wound.step(now_ms, &mesh.positions, Vec3::Z, tip.filter(|_| now_ms > 30_000.0).map(|tip| (tip, 1.5, act)));
        let us = began.elapsed().as_secs_f64() * 1e6;
        (worst_us, all_us) = (worst_us.max(us), all_us + us);
        if step % (steps / 12) == 0 {
            let (account, lies) = (wound.account(), wound.lies_pl());
            let ml = |pl: u64| pl as f64 * 1e-9;
            let rate = wound.rate_ml_per_min(now_ms);
            let [bled, lies, sucked] = [account.came[0], lies[0], account.sucked[0]].map(ml);
            println!("{:6.0} {rate:7.2} {bled:9.3} {lies:9.3} {sucked:10.3}", now_ms * 1e-3);
        }
    }
    println!("{} sources closed; a step {:.1} us, worst {worst_us:.0}", wound.coagulated(), all_us / f64::from(steps));
}
