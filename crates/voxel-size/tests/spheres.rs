//! The spheres of chapter 5: uniformly meshed balls give the thesis's ratio of analytic to
//! traditional cell size.

use glam::DVec3;
use trepan_geometry::Vec3;
use trepan_mesh::{TetMesh, lattice};
use trepan_volume::VoxelVolume;
use trepan_voxel_size::{CostModel, Expected, Measures, Prices, Work, counts};

fn ball(target_tets: usize) -> TetMesh {
    let mut mask = VoxelVolume::isotropic([48; 3], Vec3::splat(-23.5), 1.0, 0u8);
    for at in 0..mask.data.len() {
        mask.data[at] = u8::from(mask.centre_of([at % 48, at / 48 % 48, at / 2304]).distance(DVec3::ZERO) < 22.0);
    }
    lattice::tetrahedra(&mask, &lattice::Config { target_tets, ..Default::default() }).expect("a ball can be meshed")
}

#[test]
fn the_analytic_size_is_1_4_to_1_6_mean_edges_on_even_spheres() {
    for tets in [3_000, 12_000, 42_000] {
        let measures = Measures::of(&ball(tets)).unwrap();
        let ratio = CostModel::default().analytic(&measures).unwrap() / measures.traditional_mm();
        assert!((1.40..1.60).contains(&ratio), "{ratio} at {tets}");
    }
}

#[test]
fn two_touching_spheres_are_cheaper_at_the_analytic_size() {
    let mesh = ball(8_000);
    let measures = Measures::of(&mesh).unwrap();
    let shift = Vec3::new(42.0, 0.0, 0.0);
    let particles: Vec<Vec3> = mesh.positions.iter().map(|p| *p + shift).collect();
    let boxes = counts::boxes(&mesh);
    let model = CostModel::default();
    let work = |cell: f64| {
        let counts = counts::grid(&boxes, &particles, cell).unwrap();
        assert_eq!(counts.inside, counts::brute_force(&boxes, &particles).inside);
        counts.visits as f64 + model.r_t * counts.tests as f64
    };
    let analytic = model.analytic(&measures).unwrap();
    assert!(work(analytic) < work(measures.traditional_mm()));
    assert!(work(analytic) < work(0.3 * analytic) && work(analytic) < work(6.0 * analytic));
}

/// Regret: the work at a size over the least work at any size, minus 1, in the mean over
/// placements.
#[test]
fn the_expected_best_size_has_less_regret_than_the_formula() {
    let mesh = ball(8_000);
    let measures = Measures::of(&mesh).expect("a ball can be measured");
    let edge = measures.mean_edge_mm;
    let prices = Prices { fixed: 0.0, visit: 1.0, doubt: 0.0, test: 5.0 };
    for apart in [40.0, 42.0, 43.5] {
        let moved = |shift: Vec3| mesh.positions.iter().map(|p| *p + shift).collect::<Vec<Vec3>>();
        let work = |cell: f64| {
            let placements =
                (0..12).map(|n| cell as f32 * Vec3::new(0.38 * n as f32, 0.71 * n as f32, 0.17 * n as f32).fract());
            let time = |shift: Vec3| {
                let boxes = counts::boxes(&TetMesh { positions: moved(shift), tets: mesh.tets.clone() });
                let particles = moved(shift + Vec3::new(apart, 0.0, 0.0));
                {
                    let counts = counts::grid(&boxes, &particles, cell).expect("a grid that fits");
                    prices.time(&Work { visits: counts.visits as f64, doubts: 0.0, tests: counts.tests as f64 })
                }
            };
            placements.map(time).sum::<f64>() / 12.0
        };
        let least = (2..28).map(|n| work(0.2 * f64::from(n) * edge)).fold(f64::INFINITY, f64::min);
        let expected =
            Expected::of(&counts::boxes(&mesh), &moved(Vec3::new(apart, 0.0, 0.0)), 6.0 * edge).expect("finite");
        let best = expected.best(&prices, 0.2 * edge).expect("in range");
        let analytic = CostModel::default().analytic(&measures).expect("a root");
        let regret = [best, analytic, edge].map(|cell| work(cell) / least - 1.0);
        println!(
            "{apart} mm apart: expected {best:.2}, analytic {analytic:.2}, edge {edge:.2} mm: regret {regret:.3?}"
        );
        assert!(regret[0] < 0.05 && regret[0] < regret[1] + 0.02 && regret[1] < regret[2], "{regret:?}");
    }
}
