//! Saves pictures of the window: single pictures, and films as numbered pictures.
//!
//! # Practice
//! A separate thread writes the PNG files (some 30 ms each), so that the window never waits. At
//! most a second of pictures is queued; further ones are dropped, counted and reported. A list with
//! the time of each picture of a film is written for `ffmpeg -i film.ffconcat film.mp4`.

use crate::SessionError;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use trepan_render::Image;
use trepan_window::Capture;

/// Capacity of the queue, pictures.
const QUEUE: usize = 30;

/// Saves pictures of the window on a thread.
pub(crate) struct Keeper {
    sender: Option<SyncSender<(Capture, Image)>>,
    thread: Option<JoinHandle<Result<(), SessionError>>>,
    dropped: u64,
}

impl Keeper {
    /// Saves pictures in `folder`, which is created with the first picture.
    pub fn into_folder(folder: &Path) -> Self {
        let (sender, receiver) = sync_channel::<(Capture, Image)>(QUEUE);
        let mut files = Files { folder: folder.into(), ..Files::default() };
        let thread = std::thread::spawn(move || {
            receiver.iter().try_for_each(|(what, image)| files.put(what, &image))?;
            files.list()
        });
        Self { sender: Some(sender), thread: Some(thread), dropped: 0 }
    }

    /// Queues a picture, or counts it as dropped.
    pub fn keep(&mut self, what: Capture, image: Image) {
        let full = |sender: &SyncSender<_>| matches!(sender.try_send((what, image)), Err(TrySendError::Full(_)));
        self.dropped += u64::from(self.sender.as_ref().is_some_and(full));
    }

    /// Waits for the last file; returns what went wrong.
    pub fn finish(mut self) -> Vec<String> {
        self.sender = None;
        let written = self.thread.take().map(JoinHandle::join);
        let fault = match written {
            Some(Ok(Err(fault))) => Some(format!("pictures of the window: {fault}")),
            Some(Err(_)) => Some("pictures of the window: the thread that writes them panicked".into()),
            _ => None,
        };
        let left_out = (self.dropped > 0)
            .then(|| format!("{} pictures of the window were left out: they came too fast", self.dropped));
        fault.into_iter().chain(left_out).collect()
    }
}

/// The files written so far.
#[derive(Default)]
struct Files {
    folder: PathBuf,
    pictures: usize,
    /// Time of each picture of the film, ms.
    film_ms: Vec<u64>,
}

impl Files {
    /// Writes a picture under the next number.
    fn put(&mut self, what: Capture, image: &Image) -> Result<(), SessionError> {
        let name = match what {
            Capture::Picture => {
                self.pictures += 1;
                format!("picture-{:03}.png", self.pictures)
            }
            Capture::Film(ms) => {
                self.film_ms.push(ms);
                format!("film-{:05}.png", self.film_ms.len())
            }
        };
        let path = self.folder.join(name);
        let written = std::fs::create_dir_all(&self.folder).and_then(|()| image.write_png(&path));
        written.map_err(SessionError::output(&path))
    }

    /// Writes the list of the film's pictures, if there is a film.
    fn list(&self) -> Result<(), SessionError> {
        let Some(last) = self.film_ms.last() else { return Ok(()) };
        let mut text = String::from("ffconcat version 1.0\n");
        let ends = self.film_ms.iter().skip(1).copied().chain([last + 33]);
        for (at, (from, to)) in self.film_ms.iter().zip(ends).enumerate() {
            let seconds = to.saturating_sub(*from) as f64 * 1e-3;
            _ = writeln!(text, "file film-{:05}.png\nduration {seconds:.3}", at + 1);
        }
        let path = self.folder.join("film.ffconcat");
        std::fs::write(&path, text).map_err(SessionError::output(&path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Image {
        Image { width: 2, height: 1, rgba: vec![255; 8] }
    }

    #[test]
    fn pictures_and_films_are_numbered_and_the_film_has_its_times() {
        let folder = tempfile::tempdir().unwrap();
        let window = folder.path().join("window");
        let mut keeper = Keeper::into_folder(&window);
        for what in [Capture::Picture, Capture::Film(100), Capture::Film(150), Capture::Picture, Capture::Film(250)] {
            keeper.keep(what, image());
        }
        assert_eq!(keeper.finish(), Vec::<String>::new());
        let mut names: Vec<_> = std::fs::read_dir(&window).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        let expected = [
            "film-00001.png",
            "film-00002.png",
            "film-00003.png",
            "film.ffconcat",
            "picture-001.png",
            "picture-002.png",
        ];
        assert_eq!(names, expected);
        let list = std::fs::read_to_string(window.join("film.ffconcat")).unwrap();
        assert!(list.contains("film-00001.png\nduration 0.050") && list.contains("film-00002.png\nduration 0.100"));
    }

    #[test]
    fn without_pictures_there_is_no_folder_and_a_fault_is_returned() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Keeper::into_folder(&folder.path().join("window")).finish().is_empty());
        assert!(!folder.path().join("window").exists());
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let mut keeper = Keeper::into_folder(&file);
        keeper.keep(Capture::Picture, image());
        assert!(keeper.finish()[0].contains("file"), "a folder that is a file");
    }
}
