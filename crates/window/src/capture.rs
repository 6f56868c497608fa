//! Screenshots of the whole window for the session.

use crate::Session;
use eframe::egui::{self, ColorImage};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use trepan_render::Image;

/// The purpose of a screenshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Capture {
    /// A single picture that the user requested.
    Picture,
    /// A film frame, taken this long after the window opened, ms.
    Film(u64),
}

/// Requests screenshots and passes them on.
pub(crate) struct Captures {
    filming: bool,
    asked: bool,
    sender: Sender<(Capture, Arc<ColorImage>)>,
    receiver: Receiver<(Capture, Arc<ColorImage>)>,
}

impl Default for Captures {
    fn default() -> Self {
        let (sender, receiver) = channel();
        Self { filming: false, asked: false, sender, receiver }
    }
}

impl Captures {
    /// Whether every picture is recorded.
    pub fn filming(&self) -> bool {
        self.filming
    }

    /// Requests one picture.
    pub fn ask(&mut self) {
        self.asked = true;
    }

    /// Starts or stops a film.
    pub fn film(&mut self) {
        self.filming ^= true;
    }

    /// Once per picture: passes on the screenshots taken since the last and requests the next.
    pub fn turn(&mut self, context: &egui::Context, session: &mut impl Session) {
        for (what, image) in self.receiver.try_iter() {
            session.capture(what, picture(&image));
        }
        let film = self.filming.then(|| Capture::Film((context.input(|i| i.time) * 1e3) as u64));
        for what in std::mem::take(&mut self.asked).then_some(Capture::Picture).into_iter().chain(film) {
            let sender = self.sender.clone();
            // The receiver is gone once the window is closed.
            context.request_screenshot(move |image| _ = sender.send((what, image)));
        }
    }
}

fn picture(image: &ColorImage) -> Image {
    let [width, height] = image.size.map(|n| n as u32);
    Image { width, height, rgba: image.as_raw().to_vec() }
}
