//! Shows a case in pictures before the operation: sides, fit of CT and MRI, tissue labels, place of
//! the opening.
//!
//! # Practice
//! The slices show the skull's density in the case's voxels and the MRI around the brain, as the
//! session uses them, with the patient's right on the left. A click on the head chooses the
//! opening: the line from there to the centre of the head. A drag turns the head, or draws the line
//! of the flap on it; if the line does not surround the opening, its middle is the opening.

use crate::desk::action::Action;
use crate::desk::form::Form;
use crate::desk::pages::{across_mm, by_controls, images};
use crate::error::SessionError;
use crate::settings::Source;
use glam::{DAffine3, DVec3, Vec2};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Aabb, Vec3};
use trepan_gpu::{Gpu, GpuError};
use trepan_haptics::script::Site;
use trepan_patient::Case;
use trepan_patient::Plan;
use trepan_patient::TissueClass;
use trepan_patient::opening::eye;
use trepan_render::{Camera, Frame, Image, Overlay, Painter, SceneData, SliceLook, View};
use trepan_report::printable::printable;
use trepan_stages::program::Program;
use trepan_volume::VoxelVolume;
use trepan_window::{Amount, Choosable, Drag, Item, Page, Picture};

/// Width and height of the picture of the head, pixels.
const HEAD: [u32; 2] = [420, 340];
/// Edge of a slice, pixels.
const SLICE: u32 = 280;
/// Grey range of bone, HU, numerical.
const WINDOW_HU: [f64; 2] = [-200.0, 1500.0];
/// Share of a turn to the side from which a side counts as turned away, numerical.
const AWAY: f32 = 0.35;
/// Least distance of the points of a drawn line, mm, numerical.
const POINT_MM: f32 = 1.0;
/// Steps of a ray on its way to the bone, mm, numerical.
const STEP_MM: f32 = 0.4;
/// Way of a page of the slices for a notch, mm, numerical.
const PAGE_MM: f32 = 1.0;
/// Depth down to which bone and brain are sought, and the largest gap within bone, mm, numerical.
const DEEPEST_MM: f32 = 60.0;
const HOLLOW_MM: f32 = 3.0;
/// Turn of the head for a drag over the whole picture, rad, numerical.
const TURN_RAD: f32 = 3.0;

/// The planes: name, world axes to the right and upwards in the picture, letters at left, right,
/// bottom and top.
const PLANES: [(&str, [DVec3; 2], [&str; 4]); 3] = [
    ("axial", [DVec3::NEG_X, DVec3::Y], ["R", "L", "P", "A"]),
    ("coronal", [DVec3::NEG_X, DVec3::Z], ["R", "L", "I", "S"]),
    ("sagittal", [DVec3::NEG_Y, DVec3::Z], ["A", "P", "I", "S"]),
];

/// Colours of the tissue classes, by their code less one.
const COLOURS: [[u8; 3]; 9] = [
    [0, 158, 115],
    [240, 228, 66],
    [204, 121, 167],
    [86, 180, 233],
    [213, 94, 0],
    [0, 114, 178],
    [230, 159, 0],
    [160, 160, 255],
    [213, 94, 0],
];

/// A case that is looked at.
pub(crate) struct Check {
    case: Case,
    /// What the user calls it.
    name: String,
    /// Centre of the slices, RAS mm.
    at: Vec3,
    /// Share of the MRI in the slices.
    mri: f32,
    bounds: Aabb,
    head: Option<Head>,
    slices: [Arc<Image>; 3],
    /// The images as they were when the case was loaded.
    images: Source,
    /// The chosen opening, RAS mm.
    pub opening: Option<[f32; 3]>,
    /// The line of the flap on the skull, RAS mm, from the burr hole on; empty without one.
    pub line: Vec<Vec3>,
    /// The line that is being drawn.
    drawing: Vec<Vec3>,
    /// Whether the left button draws it.
    pub draws: bool,
}

/// The head in three dimensions.
struct Head {
    bone: Arc<BoneVolume>,
    painter: Painter,
    camera: Camera,
    image: Arc<Image>,
    centre: Vec3,
    /// Where the skull is opened, and in which direction.
    place: Option<(Vec3, Vec3)>,
}

impl Head {
    fn view(&self) -> View {
        self.camera.view(HEAD[0] as f32 / HEAD[1] as f32)
    }

    /// The bone under a place of the picture.
    fn under(&self, [x, y]: [f32; 2]) -> Option<Vec3> {
        let view = self.view();
        first_bone(&self.bone, view.eye, view.ray(Vec2::new(2.0 * x - 1.0, 1.0 - 2.0 * y)))
    }

    /// Marks on the picture: the place of the opening, the patient's sides, a flap's line. O is its
    /// burr hole.
    fn marks(&self, line: &[Vec3]) -> Vec<([f32; 2], String)> {
        let half_mm = 0.5 * self.bone.bounds().size().x;
        let view = self.view();
        // A side that is turned away is not marked: its letter would lie on the other one.
        let sides = [("R", half_mm), ("L", -half_mm)].map(|(side, mm)| (side, self.centre + mm * Vec3::X));
        let sides = sides.into_iter().filter(|(_, at)| (*at - self.centre).dot(view.forward) < AWAY * half_mm);
        let is_seen = |point: &&Vec3| {
            let first = first_bone(&self.bone, view.eye, (**point - view.eye).normalize());
            first.is_some_and(|bone| bone.distance(**point) < 3.0)
        };
        let line = line.iter().enumerate().map(|(at, point)| (if at == 0 { "O" } else { "•" }, point));
        let line = line.filter(|(_, point)| is_seen(point)).map(|(mark, point)| (mark, *point));
        let all = self.place.map(|(place, _)| ("+", place)).into_iter().chain(sides).chain(line);
        let on_picture = |(text, point): (&str, Vec3)| {
            let (at, _) = view.project(point);
            ([0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y].map(|share| share.clamp(0.03, 0.97)), text.to_string())
        };
        all.map(on_picture).collect()
    }
}

impl Check {
    /// Prepares the pictures of a case.
    pub fn of(
        case: Case,
        name: String,
        (opening, line): (Option<[f32; 3]>, &[[f32; 3]]),
        gpu: Result<Gpu, GpuError>,
    ) -> Result<Self, SessionError> {
        let bounds = match (&case.skull, &case.brain) {
            (Some(skull), _) => skull.world_box(),
            (None, Some(brain)) => brain.mri.world_box(),
            (None, None) => return Err(SessionError::Case("this case holds neither a skull nor a brain".into())),
        };
        let site = case.opening.map(Site::from);
        let centre = case.brain.as_ref().map_or(bounds.centre(), |brain| brain.mesh.bounds().centre());
        let head = match &case.skull {
            Some(skull) => {
                let bone =
                    BoneVolume::new(skull, case.isovalue_hu).map_err(|fault| SessionError::Case(fault.to_string()))?;
                let bone = Arc::new(bone);
                let data = SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None };
                let mut painter = Painter::on(gpu, &data, HEAD)?;
                painter.set_quality(true, 1.0)?;
                let towards = site.as_ref().map_or(Vec3::Y, eye);
                let camera = Camera::viewed_from(bounds.centre(), towards, 420.0);
                let place = site.map(|site| (site.entry, site.inward));
                Some(Head { bone, painter, camera, image: blank(), centre, place })
            }
            None => None,
        };
        let slices = std::array::from_fn(|_| blank());
        let at = head.as_ref().and_then(|head| head.place).map_or(bounds.centre(), |place| place.0);
        let mri = if case.brain.is_some() { 0.5 } else { 0.0 };
        let (line, draws) = (line.iter().copied().map(Vec3::from).collect(), false);
        let mut check = Self {
            case,
            name,
            at,
            mri,
            bounds,
            head,
            slices,
            images: Source::default(),
            opening,
            line,
            drawing: Vec::new(),
            draws,
        };
        check.draw_slices();
        check.draw_head()?;
        Ok(check)
    }

    /// Sets the share of the MRI in the slices.
    pub fn blend(&mut self, share: f32) {
        self.mri = share;
        self.draw_slices();
    }

    /// Moves the slices along an axis of the patient to a place, mm.
    pub fn slide(&mut self, axis: usize, mm: f32) {
        self.at[axis] = mm;
        self.draw_slices();
    }

    /// Remembers the images that the case was loaded from.
    pub fn of_images(self, form: &Form) -> Self {
        Self { images: form.case.source.clone(), ..self }
    }

    /// Moves all slices to a place in one of them, a share of its edges.
    pub fn cross_at(&mut self, plane: usize, [x, y]: [f32; 2]) {
        let (_, [right, up], _) = PLANES[plane];
        let (middle, half) = (self.bounds.centre().as_dvec3(), self.half_mm());
        let normal = right.cross(up).abs();
        let there = middle + half * ((2.0 * f64::from(x) - 1.0) * right + (1.0 - 2.0 * f64::from(y)) * up);
        self.at = (there + (self.at.as_dvec3() - there) * normal).as_vec3().clamp(self.bounds.min, self.bounds.max);
        self.draw_slices();
    }

    /// Turns pages of a slice, by notches of the wheel.
    pub fn page_through(&mut self, plane: usize, notches: f32) {
        let (_, [right, up], _) = PLANES[plane];
        self.at =
            (self.at + PAGE_MM * notches * right.cross(up).abs().as_vec3()).clamp(self.bounds.min, self.bounds.max);
        self.draw_slices();
    }

    /// Thickness of the bone and depth of the brain along a line into the head, mm.
    fn layers(&self, outer: Vec3, inward: Vec3) -> (f32, Option<f32>) {
        let steps = || (0..(DEEPEST_MM / STEP_MM) as usize).map(|n| STEP_MM * n as f32);
        let bone = self.head.as_ref().map(|head| &head.bone);
        let is_bone = |mm: f32| bone.is_some_and(|bone| bone.is_bone(bone.voxel_of(outer + mm * inward)));
        let begin = steps().find(|mm| is_bone(*mm)).unwrap_or(0.0);
        // Diploe may be hollow: the last bone before a gap of some millimetres counts.
        let end = steps().filter(|mm| *mm >= begin).try_fold(begin, |last, mm| match is_bone(mm) {
            true => Ok(mm),
            false if mm - last < HOLLOW_MM => Ok(last),
            false => Err(last),
        });
        let end = end.unwrap_or_else(|last| last);
        let brain = self.case.brain.as_ref().map(|brain| Sampled::of(&brain.classes));
        let is_brain = |mm: f32| {
            let point = (outer + mm * inward).as_dvec3();
            brain.as_ref().is_some_and(|classes| classes.at(point).is_some_and(|class| class != 0))
        };
        (end - begin + STEP_MM, steps().find(|mm| is_brain(*mm)).map(|mm| mm - begin))
    }

    /// Turns the head by a drag.
    pub fn turn(&mut self, [x, y]: [f32; 2]) -> Result<(), SessionError> {
        if let Some(head) = &mut self.head {
            head.camera.orbit(-TURN_RAD * x, TURN_RAD * y);
        }
        self.draw_head()
    }

    /// Chooses the opening under a click on the head; false where there is no bone.
    pub fn open_at(&mut self, at: [f32; 2]) -> Result<bool, SessionError> {
        let Some(place) = self.head.as_ref().and_then(|head| head.under(at)) else { return Ok(false) };
        self.line.clear();
        self.open(place)?;
        Ok(true)
    }

    /// Opens the skull at a place on it.
    fn open(&mut self, place: Vec3) -> Result<(), SessionError> {
        let Some(head) = &mut self.head else { return Ok(()) };
        let outward = (place - head.centre).normalize_or_zero();
        head.place = Some((place, -outward));
        self.at = place;
        // A point a little outside, on the line to the centre of the head.
        self.opening = Some((place + 5.0 * outward).to_array());
        self.draw_slices();
        self.draw_head()
    }

    /// Turns the head, or draws the flap's line; returns why the line cannot be cut.
    pub fn drag(&mut self, drag: Drag) -> Result<Option<&'static str>, SessionError> {
        let Some(head) = self.head.as_ref().filter(|_| self.draws && drag.left) else {
            return if drag.by == [0.0; 2] { Ok(None) } else { self.turn(drag.by).map(|()| None) };
        };
        if drag.begins {
            self.line.clear();
            self.drawing.clear();
        }
        let is_new = |point: &Vec3| self.drawing.last().is_none_or(|last| last.distance(*point) > POINT_MM);
        self.drawing.extend(head.under(drag.at).filter(is_new));
        if drag.ends { self.close() } else { Ok(None) }
    }

    /// Closes the drawn line; returns why it cannot be cut.
    fn close(&mut self) -> Result<Option<&'static str>, SessionError> {
        let Some(head) = &self.head else { return Ok(None) };
        let drawn = std::mem::take(&mut self.drawing);
        let middle = drawn.iter().sum::<Vec3>() / drawn.len().max(1) as f32;
        let inward = (head.centre - middle).normalize_or_zero();
        let around_middle = || Some((first_bone(&head.bone, middle - 20.0 * inward, inward)?, inward));
        let plan = |(entry, inward)| {
            let site = Site { entry, inward, bone_mm: 0.0, brain_mm: 0.0 };
            Plan::drawn(&head.bone, site, Program::Craniotomy.tray()[0].tip_radius_mm, &drawn)
        };
        let (is_moved, planned) = match head.place.and_then(plan) {
            Some(plan) => (false, Some(plan)),
            None => (true, around_middle().and_then(plan)),
        };
        let Some(plan) = planned else {
            return Ok(Some("This line holds no flap: draw it on the skull in one go, around some bone"));
        };
        self.line = plan.outline.iter().map(|rim| rim.outer).collect();
        if is_moved {
            self.open(plan.site.entry)?;
        }
        Ok(None)
    }

    fn draw_head(&mut self) -> Result<(), SessionError> {
        let Some(head) = &mut self.head else { return Ok(()) };
        let markers: Vec<Vec3> = head.place.map(|place| place.0).into_iter().collect();
        let slices = SliceLook { shown: false, ..SliceLook::default() };
        let overlay = Overlay { markers: &markers, ..Overlay::default() };
        let frame = Frame { slices, overlay, ..Frame::of(head.camera) };
        let (image, _) = head.painter.picture(&frame)?;
        head.image = Arc::new(image);
        Ok(())
    }

    fn draw_slices(&mut self) {
        self.slices = PLANES.map(|(_, axes, _)| Arc::new(self.slice(axes)));
    }

    /// Half the edge of a slice, mm.
    fn half_mm(&self) -> f64 {
        0.5 * f64::from(self.bounds.size().max_element())
    }

    fn slice(&self, [right, up]: [DVec3; 2]) -> Image {
        let half = self.half_mm();
        let normal = right.cross(up).abs();
        let middle = self.bounds.centre().as_dvec3();
        let centre = middle + (self.at.as_dvec3() - middle) * normal;
        let skull = self.case.skull.as_ref().map(Sampled::of);
        let brain = self.case.brain.as_ref().map(|brain| (Sampled::of(&brain.mri), Sampled::of(&brain.classes)));
        let most = self.case.brain.as_ref().map_or(1.0, |brain| brain.mri.data.iter().copied().fold(1.0f32, f32::max));
        let mut rgba = Vec::with_capacity((SLICE * SLICE * 4) as usize);
        for y in 0..SLICE {
            for x in 0..SLICE {
                let share = |n: u32| 2.0 * (f64::from(n) + 0.5) / f64::from(SLICE) - 1.0;
                let point = centre + half * (share(x) * right - share(y) * up);
                let hu = skull.as_ref().and_then(|skull| skull.at(point)).map_or(WINDOW_HU[0], f64::from);
                let ct = ((hu - WINDOW_HU[0]) / (WINDOW_HU[1] - WINDOW_HU[0])).clamp(0.0, 1.0) as f32;
                let (mri, class) = brain.as_ref().map_or((0.0, 0), |(mri, classes)| {
                    (mri.at(point).unwrap_or(0.0) / most, classes.at(point).unwrap_or(0))
                });
                let grey = 255.0 * (ct * (1.0 - self.mri) + mri * self.mri);
                let colour = COLOURS.get(usize::from(class).wrapping_sub(1));
                let tint = colour.map_or([grey; 3], |colour| colour.map(|c| 0.75 * grey + 0.25 * f32::from(c)));
                rgba.extend(tint.map(|c| c.clamp(0.0, 255.0) as u8));
                rgba.push(255);
            }
        }
        Image { width: SLICE, height: SLICE, rgba }
    }

    /// Place of the opening in a slice, as a share of its edges.
    fn cross(&self, [right, up]: [DVec3; 2]) -> [f32; 2] {
        let from = self.at.as_dvec3() - self.bounds.centre().as_dvec3();
        let share = |axis: DVec3| (0.5 + 0.5 * from.dot(axis) / self.half_mm()) as f32;
        [share(right), 1.0 - share(up)]
    }

    /// The page.
    pub fn page(&self, fault: Option<&str>, form: &Form) -> Page<Action> {
        let mut head: Vec<Item<Action>> = vec![Item::Heading("Place of the opening".into())];
        if let Some(shown) = &self.head {
            let option = |name: &str, hint: &str| Choosable { name: name.into(), hint: hint.into(), open: true };
            let options = vec![
                option("opens and turns", "a click on the skull opens it there, a drag turns the head"),
                option(
                    "draws the flap",
                    "a drag along the skull is the line to cut; the burr hole is at its beginning",
                ),
            ];
            head.push(Item::Choice("Left button".into(), options, usize::from(self.draws), Action::Draw));
            let what = match self.draws {
                false => "Click on the skull to open it there; drag to turn it.",
                true => "Drag on the skull around the bone to lift; the right button turns the head.",
            };
            head.push(Item::Note(what.into()));
            head.push(Item::Picture(Picture {
                name: "head".into(),
                image: shown.image.clone(),
                height: HEAD[1] as f32,
                letters: shown.marks(if self.line.is_empty() { &self.drawing } else { &self.line }),
                clicked: (!self.draws).then_some(Action::OpenAt),
                dragged: Some(Action::Drag),
                scrolled: None,
            }));
        }
        let measured = self.head.as_ref().and_then(|head| head.place).map(|(at, inward)| self.layers(at, inward));
        let depth = |brain: Option<f32>| brain.map_or(String::new(), |mm| format!(", brain {mm:.1} mm deep"));
        let place = match (self.opening, measured, self.case.opening) {
            (Some(_), Some((bone_mm, brain)), _) => {
                format!("the place that you chose: bone {bone_mm:.1} mm thick{}", depth(brain))
            }
            (_, _, Some(opening)) => {
                format!("usual place: bone {:.1} mm thick, brain {:.1} mm deep", opening.bone_mm, opening.brain_mm)
            }
            _ => "no place yet".into(),
        };
        head.push(Item::Text(place));
        if !self.line.is_empty() {
            let across = across_mm(&self.line.iter().map(Vec3::to_array).collect::<Vec<_>>());
            head.push(Item::Row(vec![
                Item::Text(format!("Flap: the line that you drew, {across:.0} mm across; O is the burr hole")),
                Item::button("Round flap", "forgets this line", Action::RoundFlap),
            ]));
        }
        head.extend(fault.map(|fault| Item::Alert(fault.into())));
        head.push(Item::Heading("Remarks".into()));
        let notes = self.case.notes.iter().map(|note| Item::Note(by_controls(&printable(note))));
        head.extend(notes);
        let images = images(form);
        if !images.is_empty() {
            head.push(Item::Heading("Images".into()));
            head.extend(images);
        }
        let next = match self.images == form.case.source {
            true => Item::main("Start the operation", "with this opening", Action::Begin),
            false => Item::main("Check the case in pictures", "with what you changed", Action::Check),
        };
        Page {
            title: format!("Check: {}", printable(&self.name)),
            line: "Right and left, the fit of CT and MRI, the tissue labels, the place of the opening".into(),
            columns: vec![self.slices_part(), head],
            foot: vec![next, Item::button("Back to the start page", "the opening is kept", Action::Home)],
            escape: Some(Action::Home),
            steady: true,
        }
    }

    fn slices_part(&self) -> Vec<Item<Action>> {
        let picture = |at: usize| {
            let (name, axes, [left, right, bottom, top]) = PLANES[at];
            let letter = |at: [f32; 2], text: &str| (at, text.to_string());
            let letters = vec![
                letter([0.05, 0.5], left),
                letter([0.95, 0.5], right),
                letter([0.5, 0.95], bottom),
                letter([0.5, 0.05], top),
                letter(self.cross(axes), "+"),
            ];
            let (image, height) = (self.slices[at].clone(), SLICE as f32);
            let crosses: [fn([f32; 2]) -> Action; 3] =
                [|at| Action::Cross(0, at), |at| Action::Cross(1, at), |at| Action::Cross(2, at)];
            let dragged: [fn(Drag) -> Action; 3] =
                [|drag| Action::Cross(0, drag.at), |drag| Action::Cross(1, drag.at), |drag| Action::Cross(2, drag.at)];
            let turns: [fn(f32) -> Action; 3] =
                [|by| Action::Turn(0, by), |by| Action::Turn(1, by), |by| Action::Turn(2, by)];
            let (clicked, dragged, scrolled) = (Some(crosses[at]), Some(dragged[at]), Some(turns[at]));
            Item::Picture(Picture { name: name.into(), image, height, letters, clicked, dragged, scrolled })
        };
        let amount = |name: &str, axis: usize| Amount {
            name: format!("{name}, mm"),
            value: self.at[axis],
            range: [self.bounds.min[axis], self.bounds.max[axis]],
            step: 1.0,
        };
        let blend = Amount { name: "MRI over CT".into(), value: self.mri, range: [0.0, 1.0], step: 0.05 };
        let mut items = vec![
            Item::Heading("Slices".into()),
            Item::Note("A click moves all three there, the wheel turns pages. R right, L left, A front, P back, S up, I down of the patient".into()),
            Item::Row(vec![picture(0), picture(1)]),
            Item::Row(vec![picture(2), Item::Gap]),
            Item::Amount(amount("right", 0), |mm| Action::Slide(0, mm)),
            Item::Amount(amount("front", 1), |mm| Action::Slide(1, mm)),
            Item::Amount(amount("up", 2), |mm| Action::Slide(2, mm)),
        ];
        if let Some(brain) = &self.case.brain {
            items.push(Item::Amount(blend, Action::Blend));
            let found = |class: &TissueClass| brain.classes.data.contains(&class.code());
            let names = TissueClass::ALL.into_iter().filter(found).map(|class| {
                let colour = COLOURS.get(usize::from(class.code()).wrapping_sub(1)).copied().unwrap_or([255; 3]);
                Item::Label(called(class).into(), colour)
            });
            items.push(Item::Row(names.collect()));
        }
        items
    }
}

/// Name of a class in words.
fn called(class: TissueClass) -> &'static str {
    match class.name() {
        "white" => "white matter",
        "grey" => "grey matter",
        "basal-ganglia" => "basal ganglia",
        "corpus-callosum" => "corpus callosum",
        "soft-tumour" => "soft tumour",
        other => other,
    }
}

fn blank() -> Arc<Image> {
    Arc::new(Image { width: 1, height: 1, rgba: vec![0; 4] })
}

/// Returns the first point of bone on a ray.
fn first_bone(bone: &BoneVolume, eye: Vec3, ray: Vec3) -> Option<Vec3> {
    let end = eye.distance(bone.bounds().centre()) + bone.bounds().size().length();
    let count = (end / STEP_MM) as usize;
    (0..count).map(|n| eye + STEP_MM * n as f32 * ray).find(|point| bone.is_bone(bone.voxel_of(*point)))
}

/// A volume that is read at world points.
struct Sampled<'a, T> {
    volume: &'a VoxelVolume<T>,
    voxel_from_world: DAffine3,
}

impl<'a, T: Copy> Sampled<'a, T> {
    fn of(volume: &'a VoxelVolume<T>) -> Self {
        Self { volume, voxel_from_world: volume.world_from_voxel.inverse() }
    }

    /// Value of the nearest voxel; `None` outside.
    fn at(&self, point: DVec3) -> Option<T> {
        let voxel = self.voxel_from_world.transform_point3(point).round();
        (voxel.min_element() >= 0.0).then(|| self.volume.get(voxel.as_usizevec3().to_array())).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of bone of 30 mm around a point on the patient's left.
    fn ball() -> Case {
        let mut skull = VoxelVolume::isotropic([80; 3], Vec3::splat(-40.0), 1.0, -1000i16);
        for at in 0..skull.data.len() {
            let place = skull.centre_of([at % 80, at / 80 % 80, at / 6400]);
            if place.distance(DVec3::new(-5.0, 0.0, 0.0)) < 30.0 {
                skull.data[at] = 1200;
            }
        }
        Case { skull: Some(skull), isovalue_hu: 400, ..Case::default() }
    }

    #[test]
    fn a_click_on_the_head_chooses_the_opening_and_the_slices_go_there() {
        let mut check = Check::of(ball(), "c".into(), (None, &[]), Err(GpuError::NoAdapter)).unwrap();
        assert!(!check.open_at([0.01, 0.01]).unwrap() && check.opening.is_none(), "beside the head");
        assert!(check.open_at([0.5, 0.5]).unwrap());
        let [x, y, z] = check.opening.unwrap();
        assert!(y > 30.0 && x.abs() < 8.0 && z.abs() < 8.0, "from the front: {:?}", check.opening);
        assert!((check.at.y - 29.5).abs() < 1.5);
    }

    #[test]
    fn a_line_drawn_on_the_head_is_the_flap_and_a_scribble_is_not() {
        let mut check = Check::of(ball(), "c".into(), (None, &[]), Err(GpuError::NoAdapter)).unwrap();
        let draw = |check: &mut Check, way: &[[f32; 2]]| {
            let mut outcome = None;
            for (n, at) in way.iter().enumerate() {
                let (begins, ends) = (n == 0, n + 1 == way.len());
                outcome = check.drag(Drag { at: *at, left: true, begins, ends, ..Drag::default() }).unwrap();
            }
            outcome
        };
        let place = |turn: f32, wide: f32| [0.5 + wide * turn.cos(), 0.5 + wide * turn.sin()];
        let ring: Vec<[f32; 2]> = (0..40).map(|n| place(n as f32 * 0.157, 0.06)).collect();
        assert_eq!((draw(&mut check, &ring), check.line.len()), (None, 0), "a drag turns the head");
        check.draws = true;
        assert_eq!(draw(&mut check, &ring), None);
        assert!(check.line.len() > 30 && check.opening.is_some(), "the middle of the line is the opening");
        let off = |point: &Vec3| (point.distance(Vec3::new(-5.0, 0.0, 0.0)) - 29.5).abs();
        assert!(check.line.iter().all(|point| off(point) < 1.5), "it lies on the skull: {:?}", check.line);
        let opening = check.opening;
        assert_eq!(draw(&mut check, &ring[..3]).is_some(), check.line.is_empty(), "too small");
        assert!(check.line.is_empty() && draw(&mut check, &[[0.01, 0.01]]).is_some(), "beside the head");
        let begun = Drag { at: ring[0], left: true, begins: true, ..Drag::default() };
        assert!(check.drag(begun).unwrap().is_none() && check.line.is_empty(), "it is no flap before it is closed");
        let small: Vec<[f32; 2]> = (0..40).map(|n| place(n as f32 * 0.157, 0.05)).collect();
        assert_eq!((draw(&mut check, &small), check.opening), (None, opening), "around the same opening");
    }

    #[test]
    fn the_patients_right_is_on_the_left_of_an_axial_slice() {
        let mut check = Check::of(ball(), "c".into(), (None, &[]), Err(GpuError::NoAdapter)).unwrap();
        check.blend(0.0);
        check.slide(2, 0.0);
        let image = check.slices[0].clone();
        let bright = |from: u32, to: u32| {
            (from..to).filter(|x| image.rgba[((SLICE / 2 * SLICE + x) * 4) as usize] > 128).count()
        };
        // RAS: the left of the patient has negative x, so it stands on the right of the picture.
        assert!(bright(SLICE / 2, SLICE) > bright(0, SLICE / 2));
    }
}
