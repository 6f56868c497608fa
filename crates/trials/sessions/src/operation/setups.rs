//! Setups of the operation: the presets, what is chosen for this machine, the thesis's own methods,
//! and single steps away from the usual.

use super::Scope;

/// One setup.
pub struct Candidate {
    /// What its rows are called.
    pub name: &'static str,
    /// Its flags, as a user gives them.
    pub flags: &'static str,
}

/// The finest run: voxels and tetrahedra that nothing is held against. It adds mass to elements
/// that stiffen as every session does: without, its steps would take more substeps than a call may,
/// and time would be skipped.
pub fn truth(scope: Scope) -> Candidate {
    let flags = scope.pick(
        "--quality fine --spacing-mm 0.5 --tets 25000 --opening-refinement 4",
        "--quality fine --spacing-mm 0.4 --tets 50000 --opening-refinement 4",
    );
    Candidate { name: "truth", flags }
}

/// The same with half as many tetrahedra: how far the two are apart says how sure the truth is.
pub fn coarser_truth(scope: Scope) -> &'static str {
    scope.pick(
        "--quality fine --spacing-mm 0.5 --tets 12500 --opening-refinement 4",
        "--quality fine --spacing-mm 0.4 --tets 25000 --opening-refinement 4",
    )
}

/// Flags of another head's images, where `TREPAN_DATA` names the folder of them.
pub fn second_head() -> Option<String> {
    let home = std::path::PathBuf::from(std::env::var_os("TREPAN_DATA")?).join("head-second");
    let file = |path: &str| Some(home.join(path)).filter(|file| file.is_file());
    let [ct, mri, mask] = [
        file("ct/ct_head_hu.nii.gz")?,
        file("mri/mri_t1_in_ct_grid.nii.gz")?,
        file("mri/brainmask_in_ct_grid.nii.gz")?,
    ];
    Some(format!("--ct {} --mri {} --labels {}", ct.display(), mri.display(), mask.display()))
}

/// Setups that run where a session opens a head by itself.
pub fn elsewhere(scope: Scope) -> Vec<(&'static str, &'static str)> {
    let by_hand = [
        ("fine, 8000 tetrahedra", "--quality fine --tets 8000"),
        ("fine, 12000 tetrahedra", "--quality fine --tets 12000"),
    ];
    let by_hand = by_hand.into_iter().filter(|_| !scope.quick);
    [("auto", "--quality auto")].into_iter().chain(by_hand).collect()
}

/// Every setup, auto and the presets first.
pub fn all(scope: Scope) -> Vec<Candidate> {
    let mut setups = vec![
        ("auto", "--quality auto"),
        ("draft", "--quality draft"),
        ("usual", "--quality usual"),
        ("fine", "--quality fine"),
        // Points as printed, a grid, every element stepped.
        ("thesis, as printed", "--quality usual --rigid thesis-printed --set search=thesis"),
    ];
    if !scope.quick {
        setups.extend([
            ("thesis, mended", "--quality usual --rigid thesis --set search=thesis"),
            ("thesis on fine voxels", "--quality usual --rigid thesis --spacing-mm 0.5 --set search=thesis"),
            ("point shell, averaged", "--quality usual --rigid pointshell-average"),
            ("voxels of 2 mm", "--quality usual --spacing-mm 2"),
            ("voxels of 0.5 mm", "--quality usual --spacing-mm 0.5"),
            ("fine, 8000 tetrahedra", "--quality fine --tets 8000"),
            ("3000 tetrahedra", "--quality usual --tets 3000"),
            ("24000 tetrahedra", "--quality usual --tets 24000"),
            ("3000, alike everywhere", "--quality usual --tets 3000 --opening-refinement 0"),
            ("12000, alike everywhere", "--quality usual --tets 12000 --opening-refinement 0"),
            ("24000, alike everywhere", "--quality usual --tets 24000 --opening-refinement 0"),
            ("shaded force on bone", "--quality usual --set shading=on"),
            ("position based", "--quality usual --solver xpbd"),
            ("masses and springs", "--quality usual --solver mass-spring"),
        ]);
    }
    setups.into_iter().map(|(name, flags)| Candidate { name, flags }).collect()
}
