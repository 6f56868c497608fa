//! View settings: the visible parts of the scene and the camera.

use crate::keys::{Command, label};
use crate::words::tr;
use eframe::egui;
use glam::Vec3;
use trepan_geometry::Aabb;
use trepan_render::{Camera, Cut, Frame, Overlay, SliceLook, Stereo, StereoLook};

/// The view's switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Look {
    pub bone: bool,
    pub brain: bool,
    /// Whether the session's paint, force arrow, ghost tool and markers are shown.
    pub hints: bool,
    pub section: Option<Section>,
    pub stereo: Option<StereoLook>,
    pub slices: SliceLook,
    /// Whether the slices show the whole head instead of the tool's surroundings.
    pub whole: bool,
    /// Whether the slices have a window of their own.
    pub apart: bool,
    /// The inactive camera: the microscope's or the orbiting one.
    other: Option<Camera>,
    microscope: bool,
    /// The box that named views frame.
    head: Option<Aabb>,
}

/// A section plane near the tool's tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Section {
    /// Index into [`ACROSS`].
    across: usize,
    /// Distance from the tip, mm.
    offset_mm: f32,
    /// Whether the skull is cut too.
    bone: bool,
}

/// Section directions: label, and normal towards the removed side; `None` is towards the eye.
const ACROSS: [(&str, Option<Vec3>); 4] =
    [("to the eye", None), ("axial", Some(Vec3::Z)), ("coronal", Some(Vec3::Y)), ("sagittal", Some(Vec3::NEG_X))];
/// Ratio of the target's distance to the eye distance, for comfort.
const EYES_AWAY: f32 = 30.0;

/// Share of a view's height that the whole head fills.
const FILLED: f32 = 0.9;

impl Section {
    const FIRST: Self = Self { across: 0, offset_mm: 0.0, bone: true };

    fn cut(&self, frame: &Frame<'_>) -> Cut {
        let towards = ACROSS[self.across].1.unwrap_or(-frame.camera.view(1.0).forward);
        Cut { point: frame.world_from_tool.translation + self.offset_mm * towards, normal: towards, bone: self.bone }
    }

    fn show(&mut self, ui: &mut egui::Ui) {
        ui.horizontal_wrapped(|ui| {
            for (at, (name, _)) in ACROSS.iter().enumerate() {
                ui.selectable_value(&mut self.across, at, tr(name));
            }
        });
        ui.add(egui::Slider::new(&mut self.offset_mm, -60.0..=60.0).step_by(0.5).text(tr("from the tip, mm")));
        ui.checkbox(&mut self.bone, tr("through the skull too"));
    }
}

impl Look {
    /// Shows everything with the orbiting camera; the microscope needs a camera. Named views frame
    /// the box of the head.
    pub fn with(microscope: Option<Camera>, head: Option<Aabb>) -> Self {
        Self {
            bone: true,
            brain: true,
            hints: true,
            section: None,
            stereo: None,
            slices: SliceLook::default(),
            whole: false,
            apart: false,
            other: microscope,
            microscope: false,
            head,
        }
    }

    /// Removes hidden parts from a session's frame.
    pub fn on<'a>(&self, frame: Frame<'a>) -> Frame<'a> {
        let half_height_mm = frame.slices.half_height_mm.filter(|_| !self.whole);
        let shown = frame.slices.shown && self.slices.shown;
        let eyes = |look| Stereo { look, eye_distance_mm: frame.camera.distance_mm / EYES_AWAY };
        Frame {
            show_bone: frame.show_bone && self.bone,
            show_brain: frame.show_brain && self.brain,
            bone_paint: frame.bone_paint.filter(|_| self.hints),
            brain_paint: frame.brain_paint.filter(|_| self.hints),
            overlay: if self.hints { frame.overlay } else { Overlay::default() },
            cut: self.section.map(|section| section.cut(&frame)).or(frame.cut),
            stereo: self.stereo.map(eyes).or(frame.stereo),
            slices: SliceLook {
                half_height_mm,
                shown,
                through: self.slices.through.or(frame.slices.through),
                ..self.slices
            },
            ..frame
        }
    }

    /// Applies a command to the view.
    pub fn react(&mut self, command: Command, camera: &mut Camera) {
        match command {
            Command::Bone => self.bone ^= true,
            Command::Brain => self.brain ^= true,
            Command::Slices => self.slices.shown ^= true,
            Command::Apart => self.apart ^= true,
            Command::Hints => self.hints ^= true,
            Command::Section => self.section = if self.section.is_some() { None } else { Some(Section::FIRST) },
            Command::Stereo => {
                self.stereo = match self.stereo {
                    None => Some(StereoLook::SideBySide),
                    Some(StereoLook::SideBySide) => Some(StereoLook::Anaglyph),
                    Some(StereoLook::Anaglyph) => None,
                }
            }
            Command::Microscope => self.change_camera(camera),
            Command::Front => self.turn(camera, Vec3::Y),
            Command::Back => self.turn(camera, Vec3::NEG_Y),
            Command::Left => self.turn(camera, Vec3::NEG_X),
            Command::Right => self.turn(camera, Vec3::X),
            Command::Top => self.turn(camera, Vec3::Z),
            _ => (),
        }
    }

    /// Frames the whole head from a direction of the patient, with the orbiting camera.
    fn turn(&mut self, camera: &mut Camera, towards_eye: Vec3) {
        if self.microscope {
            self.change_camera(camera);
        }
        let Some(head) = self.head else { return };
        let from = Camera::viewed_from(head.centre(), towards_eye, 1.0);
        let distance_mm = 0.5 * head.size().max_element() / (FILLED * (0.5 * from.fov_rad).tan());
        *camera = Camera { distance_mm, ..from };
    }

    /// Switches to the other camera.
    fn change_camera(&mut self, camera: &mut Camera) {
        if let Some(other) = &mut self.other {
            std::mem::swap(other, camera);
            self.microscope ^= true;
        }
    }

    /// Whether there is a microscope.
    pub fn has_microscope(&self) -> bool {
        self.other.is_some()
    }

    /// The camera that a reset restores.
    pub fn home(&self, orbit: Camera, microscope: Option<Camera>) -> Camera {
        microscope.filter(|_| self.microscope).unwrap_or(orbit)
    }

    /// The switches in the panel, and the standard views.
    pub fn show(&mut self, ui: &mut egui::Ui, camera: &mut Camera, no_bone: bool) {
        let mut microscope = self.microscope;
        ui.add_enabled_ui(self.other.is_some(), |ui| ui.checkbox(&mut microscope, label(Command::Microscope)));
        if microscope != self.microscope {
            self.change_camera(camera);
        }
        ui.horizontal_wrapped(|ui| {
            for command in [Command::Front, Command::Back, Command::Left, Command::Right, Command::Top] {
                if ui.button(label(command)).on_hover_text(tr("looks from this side of the patient")).clicked() {
                    self.react(command, camera);
                }
            }
        });
        ui.horizontal_wrapped(|ui| {
            if !no_bone {
                ui.checkbox(&mut self.bone, label(Command::Bone));
            }
            ui.checkbox(&mut self.brain, label(Command::Brain));
            ui.checkbox(&mut self.slices.shown, label(Command::Slices));
            ui.add_enabled(self.slices.shown, egui::Checkbox::new(&mut self.apart, label(Command::Apart)));
            ui.checkbox(&mut self.hints, label(Command::Hints));
        });
        ui.horizontal_wrapped(|ui| {
            ui.label(label(Command::Stereo));
            let ways = [
                ("off", None),
                ("side by side", Some(StereoLook::SideBySide)),
                ("red-cyan", Some(StereoLook::Anaglyph)),
            ];
            for (name, look) in ways {
                ui.selectable_value(&mut self.stereo, look, tr(name));
            }
        });
        let mut cuts = self.section.is_some();
        if ui.checkbox(&mut cuts, label(Command::Section)).changed() {
            self.section = cuts.then_some(Section::FIRST);
        }
        if let Some(section) = &mut self.section {
            section.show(ui);
        }
        ui.add_enabled_ui(self.slices.shown, |ui| self.grey_values(ui));
    }

    fn grey_values(&mut self, ui: &mut egui::Ui) {
        let SliceLook { level_hu, width_hu, mri_share, mri_level, mri_width, through, .. } = &mut self.slices;
        ui.checkbox(&mut self.whole, tr("Slices of the whole head"));
        if ui.add_enabled(through.is_some(), egui::Button::new(tr("Slices follow the tool again"))).clicked() {
            *through = None;
        }
        ui.add(egui::Slider::new(level_hu, -1000.0..=2000.0).step_by(10.0).text(tr("level, HU")));
        ui.add(egui::Slider::new(width_hu, 50.0..=4000.0).step_by(10.0).text(tr("window, HU")));
        ui.add(egui::Slider::new(mri_share, 0.0..=1.0).fixed_decimals(2).text(tr("MRI over CT")));
        ui.add(egui::Slider::new(mri_level, 0.0..=1.0).fixed_decimals(2).text(tr("level, MRI")));
        ui.add(egui::Slider::new(mri_width, 0.05..=1.5).fixed_decimals(2).text(tr("window, MRI")));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_look_takes_away_and_never_adds() {
        let camera = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0);
        let near = SliceLook { half_height_mm: Some(60.0), ..SliceLook::default() };
        let session = Frame { show_bone: false, slices: near, ..Frame::of(camera) };
        let mut look = Look::with(None, None);
        assert_eq!(look.on(session).slices, near);
        look.react(Command::Brain, &mut { camera });
        look.whole = true;
        let seen = look.on(session);
        assert!(!seen.show_bone && !seen.show_brain && seen.slices.half_height_mm.is_none());
    }

    #[test]
    fn a_section_is_at_the_tip_and_stereo_goes_round() {
        let mut camera = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 300.0);
        let mut look = Look::with(None, None);
        let frame = Frame::of(camera);
        look.react(Command::Section, &mut camera);
        let cut = look.on(frame).cut.unwrap();
        assert!((cut.normal - Vec3::Y).length() < 1e-5 && cut.point == camera.target && cut.bone);
        look.section = Some(Section { across: 1, offset_mm: 5.0, bone: false });
        assert_eq!(look.on(frame).cut, Some(Cut { point: Vec3::Z * 5.0, normal: Vec3::Z, bone: false }));
        look.react(Command::Section, &mut camera);
        assert_eq!(look.on(frame).cut, None);
        let mut round = || {
            look.react(Command::Stereo, &mut camera);
            look.on(frame).stereo.map(|stereo| (stereo.look, stereo.eye_distance_mm))
        };
        assert_eq!(
            [round(), round(), round()],
            [Some((StereoLook::SideBySide, 10.0)), Some((StereoLook::Anaglyph, 10.0)), None]
        );
    }

    #[test]
    fn standard_views_frame_the_whole_head_from_the_patients_side() {
        let head = Aabb { min: Vec3::new(-80.0, -100.0, -120.0), max: Vec3::new(80.0, 90.0, 110.0) };
        let mut camera = Camera::viewed_from(Vec3::new(60.0, 20.0, 70.0), Vec3::Y, 30.0);
        let scope = Camera { fov_rad: 0.2, ..camera };
        let mut look = Look::with(Some(scope), Some(head));
        look.react(Command::Microscope, &mut camera);
        look.react(Command::Left, &mut camera);
        let view = camera.view(1.0);
        assert!((view.forward - Vec3::X).length() < 1e-5, "from the patient's left, RAS");
        assert!(!look.microscope && camera.target == head.centre());
        let corner = |n: usize| Vec3::from([0, 1, 2].map(|a| [head.min, head.max][n >> a & 1][a]));
        let seen = |n: usize| view.project(corner(n)).0.abs().max_element();
        assert!((0..8).all(|n| seen(n) < 1.4) && (0..8).any(|n| seen(n) > 0.7), "the head fills the view");
    }

    #[test]
    fn each_camera_keeps_its_position() {
        let orbit = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0);
        let scope = Camera { fov_rad: 0.2, ..Camera::viewed_from(Vec3::ONE, Vec3::Z, 300.0) };
        let (mut camera, mut look) = (orbit, Look::with(Some(scope), None));
        camera.zoom(2.0);
        look.react(Command::Microscope, &mut camera);
        assert_eq!((camera, look.home(orbit, Some(scope))), (scope, scope));
        look.react(Command::Microscope, &mut camera);
        assert_eq!((camera.distance_mm, look.home(orbit, Some(scope))), (400.0, orbit));
        let mut without = Look::with(None, None);
        without.react(Command::Microscope, &mut camera);
        assert_eq!(camera.distance_mm, 400.0);
    }
}
