//! A method in one file, of another crate.

use trepan_deformable::{BroadPhase, Config, Descriptor, Method, Phased, TissueCollision, TissueStep};
use trepan_geometry::{Aabb, Pose, Tool, ToolState, Vec3};
use trepan_mesh::TetMesh;

/// Every point with every tetrahedron.
struct Toy {
    tets: u32,
}

const TOY: Descriptor = Descriptor::of("toy", "none", |inputs| {
    Box::new(Phased::new(Toy { tets: inputs.mesh.tets.len() as u32 }, inputs.points))
});

impl BroadPhase for Toy {
    fn update(&mut self, _: &[Vec3], _: &[[u32; 4]], _: &Aabb) {}

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        out.extend((0..self.tets).flat_map(|tet| (0..points.len() as u32).map(move |point| [point, tet])));
        0
    }
}

#[test]
fn a_method_of_one_file_finds_what_the_recommended_one_does() {
    let toy = Method::of(&TOY);
    assert!(toy.name() == "toy" && toy != Method::RECOMMENDED);
    let positions = vec![Vec3::ZERO, Vec3::X * 30.0, Vec3::Y * 30.0, Vec3::Z * -30.0];
    let mesh = TetMesh { positions, tets: vec![[0, 2, 1, 3]] };
    let tool = ToolState::at(Pose::from_translation(Vec3::new(6.0, 6.0, 1.0)));
    let found = |method| {
        let config = Config { method, ..Config::default() };
        let mut collision = TissueCollision::new(&mesh, &Tool::probe(2.0), &config).unwrap();
        let mut out = TissueStep::default();
        collision.step(&mesh.positions, &[Vec3::ZERO; 4], &tool, &mut out);
        (out.points_in_contact, out.manifold.depth_mm, out.nodal)
    };
    assert!(found(toy).0 > 0);
    assert_eq!(found(toy), found(Method::RECOMMENDED));
}
