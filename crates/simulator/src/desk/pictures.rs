//! Pictures of cases for the start page.

use crate::desk::settings::{Recent, Source};
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use trepan_render::Image;

/// A picture with its number.
pub(crate) type Numbered = (u64, Arc<Image>);

/// Picture of the built-in case.
const BUILT_IN: &[u8] = include_bytes!("../../pictures/built-in.png");

/// The picture of the chosen case, read when another case is chosen.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    shown: Option<(Source, Option<PathBuf>)>,
    image: Option<Numbered>,
    read: u64,
}

impl Pictures {
    /// Returns the picture of a case, if there is one: no other patient's head stands for it.
    pub fn of(&mut self, case: &Recent) -> Option<Numbered> {
        let now = Some((case.source.clone(), case.picture.clone()));
        if self.shown != now {
            self.shown = now;
            self.read += 1;
            let kept = case.picture.as_ref().and_then(|path| Image::read_png(&fs::read(path).ok()?).ok());
            let own = || (case.source == Source::BuiltIn).then(|| Image::read_png(BUILT_IN).ok()).flatten();
            self.image = kept.or_else(own).map(|image| (self.read, Arc::new(image)));
        }
        self.image.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_shows_its_own_picture_or_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        Image { width: 3, height: 2, rgba: vec![9; 24] }.write_png(&path).unwrap();
        let mut pictures = Pictures::default();
        let built_in = pictures.of(&Recent::default()).unwrap();
        assert_eq!(pictures.of(&Recent::default()).unwrap().0, built_in.0, "read once");
        let source = Source::Folder("x".into());
        let case = Recent { source: source.clone(), picture: Some(path), ..Recent::default() };
        let own = pictures.of(&case).unwrap();
        assert!(own.0 != built_in.0 && own.1.width == 3);
        assert!(pictures.of(&Recent { source, ..Recent::default() }).is_none());
    }
}
