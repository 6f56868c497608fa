//! The renderers that a window can use.

use std::borrow::Cow;
use trepan_geometry::Aabb;
use trepan_gpu::{Gpu, Texture};
use trepan_render::{Frame, Image, Painter, RenderError, Renderer, View};

/// What a further sample of the edges gave.
#[derive(Clone, Debug, PartialEq)]
pub enum Refined {
    /// There was none to add.
    Complete,
    /// It is in the renderer's texture.
    Drawn,
    /// The finished picture.
    Copied(Image),
}

/// Draws the pictures of a window: a [`Renderer`], or a [`Painter`], which falls back to the
/// processor.
pub trait Draws {
    /// The device in use, if any.
    fn device(&self) -> Option<&Gpu>;

    /// Time that the device took for the newest finished picture, s; 0 where none draws.
    fn took_s(&self) -> f64 {
        0.0
    }

    /// Draws a frame for an area of `size` pixels into a texture of the device; returns the camera
    /// as vectors.
    /// `detail` is the fraction of the 3-D view's pixels along an edge.
    fn draw(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<View, RenderError>;

    /// The texture of the last picture, if a device draws.
    fn texture(&self) -> Option<&Texture>;

    /// Like [`draw`](Self::draw), but returns a finished picture for a window on another device. It
    /// may have fewer pixels.
    fn picture(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<(View, Cow<'_, Image>), RenderError>;

    /// Smooths the edges of the last picture by one more sample. With `copied` returns the finished
    /// picture.
    fn refine(&mut self, _frame: &Frame, _copied: bool) -> Result<Refined, RenderError> {
        Ok(Refined::Complete)
    }

    /// The box that the slices show, world mm.
    fn bounds(&self) -> Aabb;

    /// Whether bone has changed since the last picture.
    fn is_stale(&mut self) -> bool {
        false
    }
}

impl Draws for Renderer {
    fn device(&self) -> Option<&Gpu> {
        Some(self.gpu())
    }

    fn took_s(&self) -> f64 {
        Renderer::took_s(self)
    }

    fn draw(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<View, RenderError> {
        self.set_detail(detail)?;
        self.resize(size)?;
        Renderer::draw(self, frame).map(|_| self.view(frame))
    }

    fn texture(&self) -> Option<&Texture> {
        Some(Renderer::texture(self))
    }

    fn picture(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<(View, Cow<'_, Image>), RenderError> {
        let view = Draws::draw(self, frame, size, detail)?;
        Ok((view, Cow::Owned(self.image()?)))
    }

    fn refine(&mut self, frame: &Frame, copied: bool) -> Result<Refined, RenderError> {
        Ok(match Renderer::refine(self, frame)? {
            false => Refined::Complete,
            true if copied => Refined::Copied(self.image()?),
            true => Refined::Drawn,
        })
    }

    fn bounds(&self) -> Aabb {
        Renderer::bounds(self)
    }

    fn is_stale(&mut self) -> bool {
        Renderer::is_stale(self)
    }
}

impl Draws for Painter {
    fn device(&self) -> Option<&Gpu> {
        self.renderer().map(Renderer::gpu)
    }

    fn took_s(&self) -> f64 {
        self.renderer().map_or(0.0, Renderer::took_s)
    }

    fn draw(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<View, RenderError> {
        match self.renderer_mut() {
            Some(renderer) => Draws::draw(renderer, frame, size, detail),
            None => Draws::picture(self, frame, size, detail).map(|(view, _)| view),
        }
    }

    fn texture(&self) -> Option<&Texture> {
        self.renderer().map(Renderer::texture)
    }

    fn picture(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<(View, Cow<'_, Image>), RenderError> {
        self.fit(size, detail)?;
        Painter::draw(self, frame)?;
        // Of the parts that this picture has.
        Ok((self.view(frame), self.seen()?))
    }

    fn refine(&mut self, frame: &Frame, copied: bool) -> Result<Refined, RenderError> {
        Ok(match Painter::refine(self, frame)? {
            false => Refined::Complete,
            true if copied => Refined::Copied(self.image()?),
            true => Refined::Drawn,
        })
    }

    fn bounds(&self) -> Aabb {
        Painter::bounds(self)
    }

    fn is_stale(&mut self) -> bool {
        Painter::is_stale(self)
    }
}
