//! Setups of the operation: the presets, what is chosen for this machine, the thesis's own methods,
//! and single steps away from the usual.

use super::Scope;
use trepan_deformable::rivals::thesis;
use trepan_deformable::{Config, Method};

/// One setup.
pub struct Candidate {
    /// What its rows are called.
    pub name: &'static str,
    /// Its flags, as a user gives them.
    pub flags: &'static str,
    /// How the tool is tested against the tissue.
    pub touch: Config,
}

/// The finest run: voxels and tetrahedra that nothing is held against.
pub fn truth(scope: Scope) -> Candidate {
    let flags = scope.pick(
        "--quality fine --spacing-mm 0.5 --tets 12000 --opening-refinement 2",
        "--quality fine --spacing-mm 0.4 --tets 50000 --opening-refinement 2",
    );
    Candidate { name: "truth", flags, touch: Config::default() }
}

/// Every setup, auto and the presets first.
pub fn all(scope: Scope) -> Vec<Candidate> {
    let thesis = || Config { method: Method::of(&thesis::METHOD), ..Config::default() };
    let mut setups = vec![
        ("auto", "--quality auto", Config::default()),
        ("draft", "--quality draft", Config::default()),
        ("usual", "--quality usual", Config::default()),
        ("fine", "--quality fine", Config::default()),
        // Points as printed, the grid of 1.45 edges, every element stepped.
        ("thesis, as printed", "--quality usual --rigid thesis-printed", thesis()),
    ];
    if !scope.quick {
        setups.extend([
            ("thesis, mended", "--quality usual --rigid thesis", thesis()),
            ("thesis on fine voxels", "--quality usual --rigid thesis --spacing-mm 0.5", thesis()),
            ("point shell, averaged", "--quality usual --rigid pointshell-average", Config::default()),
            ("voxels of 2 mm", "--quality usual --spacing-mm 2", Config::default()),
            ("voxels of 0.5 mm", "--quality usual --spacing-mm 0.5", Config::default()),
            ("3000 tetrahedra", "--quality usual --tets 3000", Config::default()),
            ("24000 tetrahedra", "--quality usual --tets 24000", Config::default()),
            ("3000, alike everywhere", "--quality usual --tets 3000 --opening-refinement 0", Config::default()),
            ("12000, alike everywhere", "--quality usual --tets 12000 --opening-refinement 0", Config::default()),
            ("24000, alike everywhere", "--quality usual --tets 24000 --opening-refinement 0", Config::default()),
            ("position based", "--quality usual --solver xpbd", Config::default()),
            ("masses and springs", "--quality usual --solver mass-spring", Config::default()),
        ]);
    }
    setups.into_iter().map(|(name, flags, touch)| Candidate { name, flags, touch }).collect()
}
