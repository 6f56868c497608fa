//! Pictures of cases for the start page.

use crate::settings::{Recent, Source};
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use trepan_render::Image;

/// Picture of the built-in case.
const BUILT_IN: &[u8] = include_bytes!("../../pictures/built-in.png");

/// The picture of the chosen case, read when another case is chosen.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    shown: Option<(Source, Option<PathBuf>)>,
    image: Option<Arc<Image>>,
}

impl Pictures {
    /// Returns the picture of a case, if there is one: no other patient's head stands for it.
    pub fn of(&mut self, case: &Recent) -> Option<Arc<Image>> {
        let now = Some((case.source.clone(), case.picture.clone()));
        if self.shown != now {
            self.shown = now;
            let kept = case.picture.as_ref().and_then(|path| Image::read_png(&fs::read(path).ok()?).ok());
            let own = || (case.source == Source::BuiltIn).then(|| Image::read_png(BUILT_IN).ok()).flatten();
            self.image = kept.or_else(own).map(Arc::new);
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
        assert!(Arc::ptr_eq(&pictures.of(&Recent::default()).unwrap(), &built_in), "read once");
        let source = Source::Folder("x".into());
        let case = Recent { source: source.clone(), picture: Some(path), ..Recent::default() };
        let own = pictures.of(&case).unwrap();
        assert!(!Arc::ptr_eq(&own, &built_in) && own.width == 3);
        assert!(pictures.of(&Recent { source, ..Recent::default() }).is_none());
    }
}
