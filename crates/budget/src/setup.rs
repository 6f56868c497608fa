//! The models to choose from for bone, tissue and picture, and the presets: files in `presets/`.

use core::fmt;
use core::str::FromStr;

/// How bone is represented and touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bone {
    /// Name of the method in `trepan_rigid`.
    pub method: &'static str,
    /// Edge of a voxel, mm.
    pub spacing_mm: f64,
    /// Points of the pointshell on the burr; 0 for methods without one.
    pub points: usize,
}

/// How tissue is represented and moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tissue {
    /// `tled`, or the name of a method in `trepan_soft`.
    pub solver: &'static str,
    /// Tetrahedra of the whole brain.
    pub tets: usize,
    /// How often the tetrahedra's edges are halved around the opening, at the same total count; 0
    /// for a uniform mesh.
    pub halvings: u32,
}

/// How the processor renders the 3-D view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picture {
    /// Whether rays are skipped where bone is smooth.
    pub sparse: bool,
    /// Fraction of the pixels along an edge, 0 to 1; the picture is enlarged to its full size.
    pub detail: f64,
}

/// The models of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// Bone.
    pub bone: Bone,
    /// Tissue.
    pub tissue: Tissue,
    /// Picture.
    pub picture: Picture,
}

/// How a setup is selected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// The cheapest that meets the scene's tolerances on this machine; see [`plan`](crate::plan).
    #[default]
    Auto,
    /// For slow machines.
    Draft,
    /// For most machines.
    Usual,
    /// For fast machines.
    Fine,
}

impl Quality {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Auto, Self::Draft, Self::Usual, Self::Fine];

    /// Its file of settings: a path of a recording's header and its value in a line.
    fn file(self) -> &'static str {
        match self {
            Self::Auto => include_str!("../presets/auto.settings"),
            Self::Draft => include_str!("../presets/draft.settings"),
            Self::Usual => include_str!("../presets/usual.settings"),
            Self::Fine => include_str!("../presets/fine.settings"),
        }
    }

    /// Its settings: path and value, as in `sizes.tets` and `8000`.
    pub fn settings(self) -> impl Iterator<Item = (&'static str, &'static str)> {
        self.file().lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split_once('='))
    }

    /// The setup; `None` for [`Auto`](Self::Auto), which needs a scene and a machine.
    pub fn preset(self) -> Option<Setup> {
        Some(Setup {
            bone: Bone { method: "god-object-sphere", spacing_mm: self.number("sizes.spacing_mm")?, points: 0 },
            tissue: Tissue {
                solver: "tled",
                tets: self.number("sizes.tets")?,
                halvings: self.number("sizes.halvings")?,
            },
            picture: Picture {
                sparse: self.number("sizes.picture_sparse")?,
                detail: self.number("sizes.picture_detail")?,
            },
        })
    }

    /// Value of a path in its file.
    fn number<T: FromStr>(self, path: &str) -> Option<T> {
        self.settings().find(|(name, _)| *name == path)?.1.parse().ok()
    }

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Draft => "draft",
            Self::Usual => "usual",
            Self::Fine => "fine",
        }
    }
}

impl fmt::Display for Bone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} on {} mm voxels", self.method, self.spacing_mm)?;
        if self.points > 0 { write!(f, " with {} points", self.points) } else { Ok(()) }
    }
}

impl fmt::Display for Tissue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} with {} tetrahedra", self.solver, self.tets)?;
        if self.halvings > 0 {
            write!(f, ", edges 1/{} at the opening", 1u64 << self.halvings)?;
        }
        Ok(())
    }
}

impl fmt::Display for Picture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rays = if self.sparse { "sparse rays" } else { "every ray" };
        if self.detail == 1.0 {
            f.write_str(rays)
        } else {
            write!(f, "{rays} at {} of the pixels along an edge", self.detail)
        }
    }
}

impl fmt::Display for Setup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}; {}", self.bone, self.tissue, self.picture)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_get_finer_and_auto_has_none() {
        let [auto, draft, usual, fine] = Quality::ALL.map(Quality::preset);
        assert_eq!(auto, None);
        let (draft, usual, fine) = (draft.unwrap(), usual.unwrap(), fine.unwrap());
        assert!(draft.bone.spacing_mm > usual.bone.spacing_mm && usual.bone.spacing_mm > fine.bone.spacing_mm);
        assert!(draft.tissue.tets < usual.tissue.tets && usual.tissue.tets < fine.tissue.tets);
        assert_eq!(
            usual.to_string(),
            "god-object-sphere on 1 mm voxels; tled with 8000 tetrahedra, edges 1/16 at the opening; every ray"
        );
        let alike = Tissue { halvings: 0, ..draft.tissue };
        assert_eq!(alike.to_string(), "tled with 3000 tetrahedra");
        assert_eq!(draft.picture.to_string(), "sparse rays at 0.5 of the pixels along an edge");
    }
}
