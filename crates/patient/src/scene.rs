//! Prepares a case for contact, drilling and deformation.

use crate::PatientError;
use crate::mixture::{self, Shares};
use crate::opening::{bare_brain, bone_of};
use crate::tissue_class::TissueClass;
use crate::{Brain, Case, Cortex};
use glam::{DAffine3, DVec3, IVec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;
use trepan_measurements::support;
use trepan_mesh::{Surface, TetMesh};
use trepan_soft::{Anchor, Body, Material, Membrane};
use trepan_stages::program::Program;
use trepan_volume::{DistanceField, VoxelVolume};

/// Distance to bone below which surface nodes of the lower brain are fixed, mm.
const FIXED_BY_BONE_MM: f32 = support::BASE_REACH.f32();
/// Margin of a distance field around tissue, mm: more than the widest tool's radius and its warning
/// distance.
const ROOM_MM: f32 = 9.0;
/// Smallest number of fixed nodes that supports a brain.
const MIN_FIXED: usize = 12;

/// Patient data that the stages share.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The skull in its current state.
    pub bone: Option<Arc<BoneVolume>>,
    /// The brain at rest.
    pub brain: Option<RestBrain>,
    /// Where to operate.
    pub site: Site,
    /// Overlay of CT and MRI, as the bytes of a PNG file.
    pub fit_png: Option<Vec<u8>>,
    /// Remarks for the user.
    pub remarks: Vec<String>,
}

/// The brain at rest.
#[derive(Clone, Debug)]
pub struct RestBrain {
    /// Tetrahedra.
    pub mesh: TetMesh,
    /// Class code of each tetrahedron, or a larger code for a mixture.
    pub class_of_tet: Vec<u8>,
    /// Shares of the classes in each mixture.
    pub mixtures: Vec<Shares>,
    /// Nodes of its base, which do not move where nothing else holds it.
    pub fixed: Vec<u32>,
    /// Distance to its surface, mm, negative inside.
    pub field: Arc<DistanceField>,
    /// Class codes around it, 0 outside.
    pub classes: VoxelVolume<u8>,
    /// The MRI around it.
    pub mri: VoxelVolume<f32>,
    /// Colours of marked tissue classes; `None` if no class is marked.
    pub tint: Option<Vec<[u8; 3]>>,
}

impl Scene {
    /// Prepares a case for a program.
    pub fn new(program: Program, case: Case) -> Result<Self, PatientError> {
        let mut remarks = case.notes;
        let bone = || case.skull.map(|skull| bone_of(skull, case.isovalue_hu)).transpose();
        let field = || case.brain.as_ref().map(|brain| DistanceField::of_mask(&brain.classes));
        let (bone, field) = rayon::join(bone, field);
        let bone = bone?.map(Arc::new);
        let brain = case.brain.zip(field);
        let brain = brain.map(|(brain, field)| rest_brain(brain, field, bone.as_deref(), &mut remarks));
        if brain.is_none() {
            remarks.push("without an MRI there is no warning before the burr reaches the brain".into());
        }
        let site = match (case.opening, &brain) {
            (Some(opening), _) if program.has_bone() => Some(opening.into()),
            (_, Some(brain)) if !program.has_bone() => {
                let tumour = brain.tumour().map(|(centre, _)| centre);
                bare_brain(&brain.field, brain.mesh.bounds().centre(), tumour)
            }
            _ => None,
        };
        let site = site.ok_or_else(|| {
            let fault = match (&bone, &brain) {
                (Some(_), Some(_)) => "no ray from above meets bone and then brain: give a CT and an MRI of one head, upright and in one space (--register moves the MRI to the CT), or the place with --opening",
                _ => "no ray from outside meets a wall of bone up to 30 mm thick: is the CT one of a head, and does the isovalue (--isovalue-hu) fit?",
            };
            PatientError::Case(fault.into())
        })?;
        Ok(Self { bone, brain, site, fit_png: case.fit_png, remarks })
    }
}

impl RestBrain {
    /// The cortex as the MRI shows it; 0.7 s for the built-in head.
    pub fn cortex(&self) -> Cortex {
        Cortex::of(&self.mri, &self.classes, &self.field)
    }

    /// The body of the brain, of materials by tissue class, in their order, with a membrane of a
    /// shear stiffness on its surface, N/mm.
    pub fn body(&self, of_classes: Vec<Material>, membrane: f32, fixed: &[u32], anchors: &[Anchor]) -> Body {
        let triangles = if membrane > 0.0 { Surface::of(&self.mesh).triangles } else { Vec::new() };
        Body {
            mesh: self.mesh.clone(),
            fixed: fixed.to_vec(),
            anchors: anchors.to_vec(),
            membrane: Membrane { triangles, shear_n_per_mm: membrane },
            materials: self.materials(of_classes),
            material_of_tet: self.class_of_tet.iter().map(|code| code.saturating_sub(1)).collect(),
        }
    }

    /// Materials by class code minus one: the classes', in their order, then those of the mixtures.
    pub fn materials(&self, of_classes: Vec<Material>) -> Vec<Material> {
        mixture::materials(of_classes, &self.mixtures, mixture::BOUND)
    }

    /// Volume of each class, mm³, in the order of [`TissueClass::ALL`], of what is left of each
    /// tetrahedron, of 65535.
    pub fn left_mm3(&self, fills: &[u16]) -> [f64; TissueClass::ALL.len()] {
        let mut left = [0.0; TissueClass::ALL.len()];
        for (tet, (code, fill)) in self.class_of_tet.iter().zip(fills).enumerate() {
            let mm3 = self.mesh.volume_mm3(tet) * f64::from(*fill) / f64::from(u16::MAX);
            match usize::from(code.saturating_sub(1)).checked_sub(TissueClass::ALL.len()) {
                None => left[usize::from(code.saturating_sub(1))] += mm3,
                Some(at) => {
                    left.iter_mut().zip(self.mixtures[at]).for_each(|(left, share)| *left += f64::from(share) * mm3)
                }
            }
        }
        left
    }

    /// Middle of the tumour's voxels and the radius of a ball of their volume, mm; `None` without a
    /// tumour.
    pub fn tumour(&self) -> Option<(Vec3, f32)> {
        let codes = [TissueClass::Tumour, TissueClass::SoftTumour].map(TissueClass::code);
        let [nx, ny, _] = self.classes.dims;
        let place = |at: usize| self.classes.centre_of([at % nx, at / nx % ny, at / (nx * ny)]);
        let all = (0..self.classes.data.len()).filter(|at| codes.contains(&self.classes.data[*at]));
        let (count, sum) = all.fold((0.0, DVec3::ZERO), |(count, sum), at| (count + 1.0, sum + place(at)));
        let mm3 = count * self.classes.spacing_mm().element_product();
        let radius_mm = (0.75 * mm3 / std::f64::consts::PI).cbrt() as f32;
        (count > 0.0).then(|| ((sum / count).as_vec3(), radius_mm))
    }

    /// Distance to the tissue of some classes, mm: exact up to 9 mm, at least 9 mm beyond. `None`
    /// without such tissue.
    pub fn distance_to(&self, classes: &[TissueClass]) -> Option<DistanceField> {
        let [nx, ny, _] = self.classes.dims;
        let is = |at: &usize| classes.iter().any(|class| class.code() == self.classes.data[*at]);
        let place = |at: usize| IVec3::from([at % nx, at / nx % ny, at / (nx * ny)].map(|n| n as i32));
        let all: Vec<IVec3> = (0..self.classes.data.len()).filter(is).map(place).collect();
        let low = all.iter().copied().reduce(IVec3::min)?;
        let high = all.iter().copied().reduce(IVec3::max)?;
        let room = (f64::from(ROOM_MM) / self.classes.spacing_mm()).ceil().as_ivec3();
        let (first, dims) = (low - room, (high - low + 2 * room + 1).as_usizevec3().to_array());
        let origin = DAffine3::from_translation(first.as_dvec3());
        let mut mask = VoxelVolume::filled(dims, self.classes.world_from_voxel * origin, 0u8);
        for voxel in all {
            let at = mask.index((voxel - first).as_usizevec3().to_array());
            mask.data[at] = 1;
        }
        Some(DistanceField::of_mask_within(&mask, ROOM_MM))
    }
}

fn rest_brain(brain: Brain, field: DistanceField, bone: Option<&BoneVolume>, remarks: &mut Vec<String>) -> RestBrain {
    let mut fixed = bone.map(|bone| fixed_by_bone(&brain.mesh, bone)).unwrap_or_default();
    if fixed.len() < MIN_FIXED {
        remarks.push(
            "too little bone lies under the brain to support it: the nodes of its lowest fifth are fixed instead"
                .into(),
        );
        fixed = below(&brain.mesh, support::BARE_BASE_HEIGHT.f32());
    }
    let marked = TissueClass::ALL.map(TissueClass::tint);
    let tint_of = |&code: &u8| marked.get(usize::from(code).wrapping_sub(1)).copied().unwrap_or([0; 3]);
    let tint: Vec<[u8; 3]> = brain.classes.data.iter().map(tint_of).collect();
    let tint = Some(tint).filter(|tint| tint.iter().any(|&colour| colour != [0; 3]));
    let field = Arc::new(field);
    let Brain { classes, mri, mesh, class_of_tet, mixtures } = brain;
    RestBrain { fixed, field, mesh, class_of_tet, mixtures, classes, mri, tint }
}

/// Surface nodes of the lower brain near bone.
fn fixed_by_bone(mesh: &TetMesh, bone: &BoneVolume) -> Vec<u32> {
    let mut on_surface = vec![false; mesh.positions.len()];
    Surface::of(mesh).triangles.iter().flatten().for_each(|&node| on_surface[node as usize] = true);
    below(mesh, support::BASE_HEIGHT.f32())
        .into_iter()
        .filter(|&node| on_surface[node as usize] && near_bone(mesh.positions[node as usize], bone))
        .collect()
}

/// Nodes up to a share of the mesh's height.
pub(crate) fn below(mesh: &TetMesh, share: f32) -> Vec<u32> {
    let bounds = mesh.bounds();
    let top = bounds.min.z + share * bounds.size().z;
    (0..mesh.positions.len() as u32).filter(|&node| mesh.positions[node as usize].z <= top).collect()
}

fn near_bone(point: Vec3, bone: &BoneVolume) -> bool {
    let reach = (FIXED_BY_BONE_MM / bone.spacing_mm()).ceil() as i32;
    let centre = bone.voxel_of(point);
    let offsets = || -reach..=reach;
    let mut all = offsets().flat_map(|k| offsets().flat_map(move |j| offsets().map(move |i| IVec3::new(i, j, k))));
    let is_near = |voxel: IVec3| bone.is_bone(voxel) && bone.centre_of(voxel).distance(point) <= FIXED_BY_BONE_MM;
    all.any(|offset| is_near(centre + offset))
}
