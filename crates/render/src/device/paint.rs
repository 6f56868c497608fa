//! A paint's texture.

use crate::RenderError;
use crate::paint::{Paint, premultiplied};
use trepan_gpu::{Format, Gpu, Texture, TextureSpec};

/// A paint on the device; one transparent texel if there is none.
#[derive(Debug)]
pub(crate) struct Coat {
    label: &'static str,
    pub texture: Texture,
    version: Option<u64>,
}

impl Coat {
    pub fn new(gpu: &Gpu, label: &'static str) -> Result<Self, RenderError> {
        Ok(Self { label, texture: texture(gpu, label, [1; 3])?, version: None })
    }

    /// Uploads a paint if it has changed; returns whether its texture is new and must be rebound.
    pub fn follow(&mut self, gpu: &Gpu, paint: Option<&Paint>) -> Result<bool, RenderError> {
        let Some(paint) = paint else { return Ok(false) };
        paint.check()?;
        let other = self.texture.size() != paint.dims;
        if other {
            self.texture = texture(gpu, self.label, paint.dims)?;
        }
        if other || self.version != Some(paint.version) {
            let byte = |v: f32| v.round() as u8;
            let texels: Vec<[u8; 4]> = paint.rgba.iter().map(|&c| premultiplied(c).to_array().map(byte)).collect();
            self.texture.write(gpu, [0; 3], paint.dims, &texels);
            self.version = Some(paint.version);
        }
        Ok(other)
    }
}

fn texture(gpu: &Gpu, label: &'static str, size: [u32; 3]) -> Result<Texture, RenderError> {
    let format = Format::Rgba8Unorm;
    Ok(Texture::new(gpu, &TextureSpec { label, size, volume: true, format, drawn_to: false, stored_to: false })?)
}
