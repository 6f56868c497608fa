//! A method in one file, of another crate.

use trepan_bone::BoneVolume;
use trepan_contact::Contact;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{Descriptor, Extent, Method, RigidContact, RigidStep};
use trepan_volume::VoxelVolume;

/// Pushes up by half a millimetre where the tip is in bone.
#[derive(Default)]
struct Toy {
    proxy: Pose,
}

static TOY: Descriptor = Descriptor {
    name: "toy",
    source: "none",
    extent: Extent::Ball,
    has_proxy: false,
    is_oracle: false,
    points: 0,
    removal: RemovalLaw::RATE,
    build: |_, _| Box::new(Toy::default()),
};

impl RigidContact for Toy {
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, _: bool, _: f32, out: &mut RigidStep) {
        out.clear();
        self.proxy = tool.world_from_tool;
        if bone.is_bone(bone.voxel_of(tool.tip())) {
            out.manifold.set_single(Contact { point: tool.tip(), normal: Vec3::Z, depth_mm: 0.5 });
        }
    }

    fn proxy(&self) -> Pose {
        self.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.proxy = pose;
    }
}

#[test]
fn a_method_of_one_file_is_built_for_every_tool() {
    let toy = Method::of(&TOY);
    assert_eq!((toy.name(), toy.has_shaft(), toy == Method::RECOMMENDED), ("toy", false, false));
    assert_eq!(toy.with_points(99), toy, "it has no points to choose");
    let mut ct = VoxelVolume::isotropic([16; 3], Vec3::splat(-8.0), 1.0, 1000i16);
    ct.data[16 * 16 * 8..].fill(-1000);
    let bone = BoneVolume::new(&ct, 400).unwrap();
    let mut out = RigidStep::default();
    // A craniotome is several balls, each handled by the method.
    for tool in [Tool::burr(2.0), Tool::craniotome()] {
        let mut contact = toy.build(&tool);
        let mut depth_mm = |z: f32| {
            let state = ToolState::at(Pose::from_translation(Vec3::Z * z));
            contact.step(&bone, &state, false, 1.0, &mut out);
            out.manifold.depth_mm
        };
        assert_eq!([depth_mm(2.0), depth_mm(-6.0)], [0.0, 0.5]);
    }
}
