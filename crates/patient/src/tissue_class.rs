//! Tissue classes inside the brain, and the label volumes that define them.
//!
//! # Practice
//! The brain's class volume holds [`TissueClass::code`]s: 0 outside, 1 brain, more where a label
//! volume names it. Later sources override earlier ones. Labels outside the brain are left out and
//! counted.

use crate::PatientError;
use crate::remark::WELL;
use glam::DAffine3;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use trepan_geometry::Vec3;
use trepan_soft::Material;
use trepan_volume::{Grid, Interpolation, Segment, Segmentation, VoxelVolume, resample};

/// A numerical parameter: share of labels in the brain above which nothing is wrong.
const WELL_SHARE: f64 = 0.98;
/// A numerical parameter: share of labels in the brain below which they may be another patient's.
const STRANGE_SHARE: f64 = 0.8;
/// American spellings of classes.
const SPELLINGS: [(&str, &str); 3] = [("gray", "grey"), ("tumor", "tumour"), ("soft-tumor", "soft-tumour")];

/// Tissue class of a part of the brain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TissueClass {
    /// Brain without a specific class.
    Brain,
    /// White matter.
    White,
    /// Grey matter.
    Grey,
    /// Ventricles, filled with fluid.
    Ventricle,
    /// Tumour, stiffer than the brain around it.
    Tumour,
    /// Blood vessels.
    Vessel,
    /// Basal ganglia: caudate, putamen, pallidum, accumbens.
    BasalGanglia,
    /// Corpus callosum.
    CorpusCallosum,
    /// Tumour softer than the brain around it, such as a glioblastoma.
    SoftTumour,
}

impl TissueClass {
    /// All classes; the index is the code minus one.
    pub const ALL: [Self; 9] = [
        Self::Brain,
        Self::White,
        Self::Grey,
        Self::Ventricle,
        Self::Tumour,
        Self::Vessel,
        Self::BasalGanglia,
        Self::CorpusCallosum,
        Self::SoftTumour,
    ];

    /// Value in a class volume; 0 is outside the brain.
    pub fn code(self) -> u8 {
        self as u8 + 1
    }

    /// Name in flags and remarks.
    pub fn name(self) -> &'static str {
        let first = ["brain", "white", "grey", "ventricle", "tumour", "vessel"];
        first.into_iter().chain(["basal-ganglia", "corpus-callosum", "soft-tumour"]).nth(self as usize).unwrap_or("")
    }

    /// Class with a name.
    pub fn named(name: &str) -> Option<Self> {
        let name = SPELLINGS.iter().find(|(spelling, _)| *spelling == name).map_or(name, |(_, known)| known);
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// Colour that marks the class in pictures; black for none. Vermilion and sky blue differ also
    /// with colour blindness (Okabe and Ito 2008).
    pub fn tint(self) -> [u8; 3] {
        match self {
            Self::Tumour | Self::SoftTumour => [213, 94, 0],
            Self::Vessel => [86, 180, 233],
            Self::Brain | Self::White | Self::Grey | Self::Ventricle | Self::BasalGanglia | Self::CorpusCallosum => {
                [0; 3]
            }
        }
    }

    /// Neo-Hookean material of the class for a Young's modulus of brain, MPa. The presets of `soft`
    /// are scaled by one factor.
    ///
    /// A vessel is ten times as stiff as brain. Its wall is stiffer ([`Material::VESSEL_WALL`]),
    /// but would shorten the stable time step many times.
    pub fn material(self, brain_mpa: f32) -> Material {
        let share = |preset: Material| (preset.young_mpa() / Material::BRAIN.young_mpa()) as f32;
        let young_mpa = brain_mpa
            * match self {
                Self::Brain => 1.0,
                Self::White => share(Material::WHITE_MATTER),
                Self::Grey => share(Material::GREY_MATTER),
                Self::Ventricle => share(Material::VENTRICLE),
                Self::Tumour => share(Material::TUMOUR),
                Self::Vessel => trepan_measurements::tissue::VESSEL_RATIO.f32(),
                Self::BasalGanglia | Self::CorpusCallosum => self.over_brain(),
                Self::SoftTumour => share(Material::SOFT_TUMOUR),
            };
        let poisson = if self == Self::Ventricle { Material::VENTRICLE.poisson() } else { Material::BRAIN.poisson() };
        Material::NeoHookean { young_mpa, poisson, density_g_mm3: Material::BRAIN.density_g_mm3() }
    }

    /// Material of the class by the law fitted to human brain, for a Young's modulus of brain, MPa.
    /// Regions are as soft against each other as they were measured. A ventricle is fluid and has
    /// no such law.
    pub fn stiffening(self, brain_mpa: f32) -> Material {
        let plain = self.material(brain_mpa);
        let Material::Stiffening { share, bound, poisson, density_g_mm3, .. } = self.preset() else { return plain };
        let regions = [Self::White, Self::Grey, Self::BasalGanglia, Self::CorpusCallosum];
        let young_mpa = if regions.contains(&self) { brain_mpa * self.over_brain() } else { plain.young_mpa() as f32 };
        let shear_mpa = young_mpa / (2.0 * (1.0 + poisson));
        Material::Stiffening { shear_mpa, share, bound, poisson, density_g_mm3 }
    }

    /// What the class is made of, as fitted to human brain; brain without a class for what was not
    /// fitted.
    fn preset(self) -> Material {
        match self {
            Self::White => Material::CORONA_RADIATA,
            Self::Grey => Material::CORTEX,
            Self::BasalGanglia => Material::BASAL_GANGLIA,
            Self::CorpusCallosum => Material::CORPUS_CALLOSUM,
            Self::Ventricle => Material::VENTRICLE,
            Self::Brain | Self::Tumour | Self::Vessel | Self::SoftTumour => Material::WHOLE_BRAIN,
        }
    }

    /// Shear modulus over that of brain without a class, as fitted.
    fn over_brain(self) -> f32 {
        (self.preset().shear_mpa() / Material::WHOLE_BRAIN.shear_mpa()) as f32
    }
}

/// Least share of a label volume that must lie in the brain, numerical.
const LEAST_INSIDE: f64 = 0.5;

/// Label volume of a class: `CLASS=PATH`, or `CLASS=PATH:LABEL,LABEL` if only some labels, codes or
/// names of segments, belong to it.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueSource {
    /// The class.
    pub class: TissueClass,
    /// The label volume.
    pub path: PathBuf,
    /// Codes of the class; with no names either, all nonzero codes.
    pub codes: Vec<u16>,
    /// Names of its segments.
    pub names: Vec<String>,
}

impl TissueSource {
    /// All nonzero voxels of a label volume.
    pub fn all_of(class: TissueClass, path: PathBuf) -> Self {
        Self { class, path, codes: Vec::new(), names: Vec::new() }
    }

    /// The ventricles in a FreeSurfer segmentation (lateral, inferior lateral, third, fourth).
    pub fn ventricles_of_aseg(path: PathBuf) -> Self {
        Self { class: TissueClass::Ventricle, path, codes: vec![4, 5, 14, 15, 43, 44], names: Vec::new() }
    }

    /// The regions of the brain in a FreeSurfer segmentation that were measured apart, then its
    /// ventricles.
    pub fn regions_of_aseg(path: PathBuf) -> Vec<Self> {
        let of = |(class, codes): (TissueClass, &[u16])| Self {
            class,
            path: path.clone(),
            codes: codes.into(),
            names: Vec::new(),
        };
        let regions: [(TissueClass, &[u16]); 4] = [
            (TissueClass::White, &[2, 41]),
            (TissueClass::Grey, &[3, 42]),
            (TissueClass::BasalGanglia, &[11, 12, 13, 26, 50, 51, 52, 58]),
            (TissueClass::CorpusCallosum, &[251, 252, 253, 254, 255]),
        ];
        let ventricles = Self::ventricles_of_aseg(path.clone());
        regions.into_iter().map(of).chain([ventricles]).collect()
    }

    /// Whether its class is a tumour.
    pub fn is_tumour(&self) -> bool {
        matches!(self.class, TissueClass::Tumour | TissueClass::SoftTumour)
    }

    /// Reads the label volumes of sources, each file once; returns a mask of each and remarks.
    pub fn read_all(sources: &[Self], notes: &mut Vec<String>) -> Result<Vec<VoxelVolume<u8>>, PatientError> {
        let mut masks = Vec::new();
        for of_file in sources.chunk_by(|a, b| a.path == b.path) {
            let read = Segmentation::read(&of_file[0].path)?;
            for source in of_file {
                masks.push(source.mask(&read, notes)?);
            }
        }
        Ok(masks)
    }

    /// Mask of the class in its label volume, and remarks.
    fn mask(&self, read: &Segmentation, notes: &mut Vec<String>) -> Result<VoxelVolume<u8>, PatientError> {
        let names = || read.segments.iter().map(|segment| segment.name.as_str()).collect::<Vec<_>>().join(", ");
        let case = |fault: String| PatientError::Case(format!("--tissue {}: {fault}", self.class.name()));
        let mut chosen = Vec::new();
        for name in &self.names {
            let of_name = |segment: &&Segment| segment.name.eq_ignore_ascii_case(name);
            let segment = read.segments.iter().find(of_name).ok_or_else(|| {
                let has = match read.segments.is_empty() {
                    true => "names no segments: give codes".into(),
                    false => format!("has {}", names()),
                };
                case(format!("{}: there is no segment {name:?}; the file {has}", self.path.display()))
            })?;
            chosen.push((segment.layer, segment.value));
        }
        let all = self.codes.is_empty() && self.names.is_empty();
        if all && read.segments.len() > 1 {
            notes.push(format!(
                "{}: all {} segments are taken: {}; name some of them as PATH:NAME,NAME",
                self.class.name(),
                read.segments.len(),
                names()
            ));
        }
        let holds = |layer, code| code != 0 && (all || self.codes.contains(&code) || chosen.contains(&(layer, code)));
        let mask = read.mask(holds);
        if !mask.data.contains(&1) {
            return Err(case(format!("{}: {} fill no voxel", self.path.display(), self.labels())));
        }
        Ok(mask)
    }

    /// Its labels, for messages.
    fn labels(&self) -> String {
        match self.codes.is_empty() && self.names.is_empty() {
            true => "the nonzero codes".into(),
            false => format!("labels {:?} {:?}", self.codes, self.names),
        }
    }

    /// Writes the class's code to the brain voxels in its mask; returns a remark with the volume.
    pub fn paint(
        &self,
        mut here: VoxelVolume<u8>,
        ct_from_mri: DAffine3,
        classes: &mut VoxelVolume<u8>,
    ) -> Result<String, PatientError> {
        here.world_from_voxel = ct_from_mri * here.world_from_voxel;
        let all = here.data.iter().filter(|&&v| v != 0).count();
        let all_ml = all as f64 * here.spacing_mm().element_product() * 1e-3;
        let here = resample(&here, &Grid::of(classes), Interpolation::Majority, 0);
        let mut painted = 0;
        for (class, _) in classes.data.iter_mut().zip(&here.data).filter(|(class, here)| **class != 0 && **here != 0) {
            *class = self.class.code();
            painted += 1;
        }
        let ml = painted as f64 * classes.spacing_mm().element_product() * 1e-3;
        let name = self.class.name();
        if painted == 0 {
            return Err(PatientError::Case(format!(
                "--tissue {name}: {}: {} fill {all_ml:.1} ml, none of it in the brain: give labels in the MRI's space, and labels that are in them",
                self.path.display(),
                self.labels()
            )));
        }
        // Vessels run outside the brain too.
        if ml < LEAST_INSIDE * all_ml && self.class != TissueClass::Vessel {
            return Err(PatientError::Case(format!(
                "--tissue {name}: {}: only {ml:.1} ml of its {all_ml:.1} ml lie in the brain, so it may be another patient's: give labels in the MRI's space, or a brain that contains them with --labels PATH",
                self.path.display()
            )));
        }
        let lies = format!("{name}: {ml:.1} ml of the {all_ml:.1} ml that its labels fill lie in the brain");
        Ok(match ml / all_ml {
            share if share >= WELL_SHARE => lies + WELL,
            share if share >= STRANGE_SHARE => lies,
            _ => lies + ": are these the labels of this patient?",
        })
    }
}

/// Makes the brain voxels in a ball a tumour; returns a remark with its volume.
pub(crate) fn make_tumour(
    centre: [f32; 3],
    radius_mm: f32,
    classes: &mut VoxelVolume<u8>,
) -> Result<String, PatientError> {
    let ([x, y, z], centre) = (centre, Vec3::from(centre));
    let [nx, ny, _] = classes.dims;
    let voxel_ml = 1e-3 * classes.spacing_mm().element_product();
    let is_in =
        |at: &usize| classes.centre_of([at % nx, at / nx % ny, at / (nx * ny)]).as_vec3().distance(centre) <= radius_mm;
    let ball: Vec<usize> = (0..classes.data.len()).filter(is_in).collect();
    let brain: Vec<usize> = ball.iter().copied().filter(|at| classes.data[*at] != 0).collect();
    let whole_ml = 1e-3 * f64::from(4.0 / 3.0 * std::f32::consts::PI * radius_mm.powi(3));
    let ml = brain.len() as f64 * voxel_ml;
    if ml < LEAST_INSIDE * whole_ml || brain.is_empty() {
        return Err(PatientError::Usage(format!(
            "--tumour {x},{y},{z},{radius_mm}: {ml:.1} of its {whole_ml:.1} ml lie in the brain: give a centre in the brain, RAS mm, and a radius of at least a voxel"
        )));
    }
    brain.into_iter().for_each(|at| classes.data[at] = TissueClass::Tumour.code());
    Ok(format!("tumour: made, {ml:.1} ml of brain around {x:.0},{y:.0},{z:.0} (RAS mm){WELL}"))
}

impl Serialize for TissueClass {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for TissueClass {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        String::deserialize(from)?.parse().map_err(de::Error::custom)
    }
}

impl FromStr for TissueClass {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::ALL.map(Self::name).join(", ");
        Self::named(name).ok_or_else(|| format!("expected one of {}", known()))
    }
}

impl FromStr for TissueSource {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = || TissueClass::ALL[1..].iter().map(|class| class.name()).collect::<Vec<_>>().join(", ");
        let remedy = || format!("expected CLASS=PATH or CLASS=PATH:LABEL,LABEL with CLASS one of {}", known());
        let (name, place) = text.split_once('=').ok_or_else(remedy)?;
        let class = TissueClass::named(name).filter(|class| *class != TissueClass::Brain).ok_or_else(remedy)?;
        // A tail with a separator of folders belongs to the path, as after the letter of a drive.
        let split = place.rsplit_once(':').filter(|(_, labels)| !labels.contains(['/', '\\']));
        let (path, labels) = split.filter(|_| !Path::new(place).exists()).unwrap_or((place, ""));
        let mut source = Self { class, path: path.into(), codes: Vec::new(), names: Vec::new() };
        for label in labels.split(',').map(str::trim).filter(|label| !label.is_empty()) {
            match label.parse() {
                Ok(code) => source.codes.push(code),
                Err(_) => source.names.push(label.into()),
            }
        }
        if path.is_empty() { Err(remedy()) } else { Ok(source) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use trepan_volume::nifti;

    #[test]
    fn a_source_is_read_from_its_flag() {
        let whole: TissueSource = "tumour=a/b.nrrd".parse().unwrap();
        assert_eq!((whole.class, whole.codes.len()), (TissueClass::Tumour, 0));
        let some: TissueSource = "ventricle=c:\\x\\aseg.mgz:4,43".parse().unwrap();
        assert_eq!((some.path, some.codes), (PathBuf::from("c:\\x\\aseg.mgz"), vec![4, 43]));
        let named: TissueSource = "tumour=a/b.seg.nrrd:core, 3".parse().unwrap();
        assert_eq!((named.codes, named.names), (vec![3], vec!["core".into()]));
        let odd: TissueSource = "grey=c:\\x".parse().unwrap();
        assert_eq!(odd.path, PathBuf::from("c:\\x"));
        for bad in ["tumur=x", "tumour", "brain=x", "tumour=", "tumour=:4"] {
            assert!(bad.parse::<TissueSource>().unwrap_err().contains("ventricle, tumour"), "{bad}");
        }
    }

    #[test]
    fn a_tumour_is_made_in_the_brain_or_refused_with_the_remedy() {
        let mut classes = VoxelVolume::isotropic([20; 3], Vec3::ZERO, 1.0, 1u8);
        classes.data[..20 * 20 * 5].fill(0);
        let whole = classes.clone();
        for (centre, part) in [([10.0, 10.0, 1.0], "0.0 of its 0.1 ml"), ([90.0, 0.0, 0.0], "centre in the brain")] {
            let fault = make_tumour(centre, 3.0, &mut classes).unwrap_err().to_string();
            assert!(fault.starts_with("--tumour") && fault.contains(part), "{fault}");
            assert!(classes == whole, "nothing is painted");
        }
        let note = make_tumour([10.0, 10.0, 8.0], 4.0, &mut classes).unwrap();
        let made: Vec<usize> = (0..8000).filter(|at| classes.data[*at] == TissueClass::Tumour.code()).collect();
        assert!(note.contains("ml of brain around 10,10,8") && (200..268).contains(&made.len()), "{}", made.len());
        assert!(made.iter().all(|at| whole.data[*at] == 1), "brain alone");
    }

    #[test]
    fn labels_are_painted_inside_the_brain_only() {
        let home = tempfile::tempdir().unwrap();
        let mut labels = VoxelVolume::isotropic([10; 3], Vec3::ZERO, 1.0, 0u8);
        labels.data[..300].fill(7);
        labels.data[300..400].fill(9);
        let path = home.path().join("labels.nii");
        nifti::write(&path, &labels).unwrap();
        let mut classes = VoxelVolume::isotropic([10; 3], Vec3::ZERO, 1.0, 0u8);
        classes.data[100..].fill(1);
        let source = |codes, names| TissueSource { class: TissueClass::Tumour, path: path.clone(), codes, names };
        let seven = source(vec![7], Vec::new());
        let read = |source: &TissueSource| {
            TissueSource::read_all(std::slice::from_ref(source), &mut Vec::new()).map(|mut masks| masks.remove(0))
        };
        let mask = read(&seven).unwrap();
        let remark = seven.paint(mask.clone(), DAffine3::IDENTITY, &mut classes).unwrap();
        assert!(remark.contains("0.2 ml of the 0.3 ml"), "{remark}");
        let count = |code| classes.data.iter().filter(|&&v| v == code).count();
        assert_eq!((count(0), count(TissueClass::Tumour.code()), count(1)), (100, 200, 700));
        let aside = DAffine3::from_translation(DVec3::X * 50.0);
        let outside = seven.paint(mask, aside, &mut classes).unwrap_err().to_string();
        assert!(outside.contains("none of it in the brain"), "{outside}");
        let mostly = DAffine3::from_translation(-DVec3::Z);
        let other = seven.paint(read(&seven).unwrap(), mostly, &mut classes).unwrap_err().to_string();
        assert!(other.contains("another patient's"), "{other}");
        let fault = read(&source(vec![8], Vec::new())).unwrap_err().to_string();
        assert!(fault.contains("labels.nii") && fault.contains("labels [8]"), "{fault}");
        let fault = read(&source(Vec::new(), vec!["oedema".into()])).unwrap_err().to_string();
        assert!(fault.contains("oedema") && fault.contains("give codes"), "{fault}");
    }

    #[test]
    fn every_class_is_physical_and_has_its_own_code() {
        for (at, class) in TissueClass::ALL.into_iter().enumerate() {
            assert_eq!(class.code() as usize, at + 1);
            class.material(0.003).check().unwrap();
            class.stiffening(0.003).check().unwrap();
            assert_eq!(TissueClass::named(class.name()), Some(class));
        }
        assert!(TissueClass::Tumour.material(0.003).young_mpa() > 2.0 * TissueClass::Brain.material(0.003).young_mpa());
    }
}
