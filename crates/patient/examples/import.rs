//! Imports the built-in head, or a CT and an MRI, and prints what the case consists of.
//!
//! ```text
//! cargo run --release -p trepan-patient --example import [-- CT MRI]
//! ```

use std::path::PathBuf;
use trepan_patient::{Cache, Inputs, Recipe, Scene, TissueClass, TissueSource, open_case};
use trepan_stages::Program;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let inputs = match (paths.next(), paths.next()) {
        (Some(ct), Some(mri)) => Inputs { ct: Some(ct), mri: Some(mri), ..Inputs::default() },
        _ => {
            let head = trepan_fixtures::case_head();
            let tissues = TissueSource::regions_of_aseg(head.aseg);
            let [ct, mri, labels] = [head.ct, head.mri, head.labels].map(Some);
            Inputs { name: Some(head.name), ct, mri, labels, tissues, ..Inputs::default() }
        }
    };
    let recipe = Recipe { spacing_mm: 1.0, tets: 8_000, halvings: 4, ..Recipe::default() };
    let case = open_case(Program::Integrated, &inputs, &recipe, &Cache::of_user()?)?;
    println!("{}, hash {}", case.name, &case.hash[..8]);
    let scene = Scene::new(Program::Integrated, case)?;
    println!("opening at {:.1} (RAS mm), {:.1} mm of bone", scene.site.entry, scene.site.bone_mm);
    if let Some(brain) = &scene.brain {
        let [tets, fixed] = [brain.mesh.tets.len(), brain.fixed.len()];
        println!("{tets} tetrahedra, {fixed} nodes of its base fixed");
        let pure = brain.class_of_tet.iter().filter(|&&code| usize::from(code) <= TissueClass::ALL.len()).count();
        println!("{pure} of one tissue class, {} mixed", tets - pure);
    }
    scene.remarks.iter().for_each(|remark| println!("{remark}"));
    Ok(())
}
