//! Presses a burr into flat bone and drills: depth, normal and volume of the recommended method.

use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep};
use trepan_volume::VoxelVolume;

fn main() -> Result<(), trepan_bone::BoneError> {
    let mut ct = VoxelVolume::isotropic([48, 48, 48], Vec3::new(-12.0, -12.0, -18.0), 0.5, 0);
    for at in 0..ct.data.len() {
        let z = -18.0 + 0.5 * (at / (48 * 48)) as f32;
        ct.data[at] = (400.0 - 2000.0 * z).clamp(-1000.0, 1500.0) as i16;
    }
    let bone = BoneVolume::new(&ct, 400)?;
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(3.0));
    contact.reset(Pose::from_translation(Vec3::Z * 4.0));
    let (mut out, mut removed_mm3) = (RigidStep::default(), 0.0);
    for tick in 0..400 {
        let height = 3.0 - 0.5 * (tick as f32 * 0.01).sin();
        let tool = ToolState::at(Pose::from_translation(Vec3::Z * height));
        contact.step(&bone, &tool, tick >= 200, 1.0, &mut out);
        removed_mm3 += out.removed_mm3;
        if tick % 50 == 0 {
            let manifold = &out.manifold;
            println!("{tick:3} ms: {:.2} mm deep along {:.2}", manifold.depth_mm, manifold.normal);
        }
    }
    println!("{removed_mm3:.1} mm³ of bone removed");
    Ok(())
}
