//! What of the last picture of a view still holds.
//!
//! # Practice
//! While the camera stands still, only tiles are drawn again in which the brain, the bone or the
//! overlay changed, a tool is or was, or its shadow falls or fell. What is seen in a tile lies in a
//! ball, by its least and greatest distance; the shadow is asked for that ball.

use super::brain::Fragments;
use super::light::{WET_MM, is_shaded};
use super::overlay::rectangle;
use super::rows;
use super::skull::Ray;
use super::tiles::{EDGE, Tiles};
use super::{Casting, Inputs};
use crate::bricks::NOTHING;
use crate::camera::View;
use crate::overlay::Item;
use crate::scene::Scene;
use crate::tool::ToolShape;
use glam::{Vec3, Vec4};

/// Parts of a tool's shaft whose tiles are marked on their own, numerical.
const PARTS: usize = 32;

/// Least and greatest distance of what is seen in a tile, mm; without anything, none.
const NOTHING_SEEN: [f32; 2] = [NOTHING, 0.0];

/// What the kept picture shows.
#[derive(Debug)]
pub(crate) struct LastPicture {
    view: View,
    scene: Scene,
    /// Versions of the paints, and whether there is a brain.
    fixed: ([Option<u64>; 2], bool),
    casting: Casting,
    /// Where the overlay is.
    items: Vec<[usize; 4]>,
    /// Where each tool is.
    tools: [Tiles; 2],
    /// Distances in each tile, mm.
    seen: Vec<[f32; 2]>,
    /// Where each tool's shadow may fall, of the tiles that were drawn anew.
    shadows: [Tiles; 2],
}

impl LastPicture {
    /// What a picture of these shows, before it is drawn.
    pub fn of(inputs: &Inputs, has_brain: bool, view: &View, items: &[Item], size: [usize; 2]) -> Self {
        let scene = inputs.scene;
        let tools = scene.tools.map(|tool| {
            let mut tiles = Tiles::of(size);
            mark(&tool, view, size, &mut tiles);
            tiles
        });
        let paints = [inputs.bone_paint, inputs.brain_paint].map(|paint| paint.map(|paint| paint.version));
        let items = items.iter().map(|item| rectangle(&item.tool, view, size)).collect();
        let fixed = (paints, has_brain);
        let shadows = [Tiles::of(size), Tiles::of(size)];
        Self {
            view: *view,
            scene: *scene,
            fixed,
            casting: inputs.bricks.casting,
            items,
            tools,
            seen: Vec::new(),
            shadows,
        }
    }

    /// Whether a picture differs from this one, drawn before it, in some tiles only.
    pub fn may_follow(&self, before: &Self) -> bool {
        let still = Scene { tools: self.scene.tools, light: self.scene.light, ..before.scene };
        // A cut of the brain changes with all of it.
        let is_cut = self.scene.brain_cut != Vec4::ZERO;
        !is_cut
            && self.view == before.view
            && self.fixed == before.fixed
            && self.casting == before.casting
            && still == self.scene
    }

    /// Marks the tiles in which tools, their shadows or the overlay differ from those before.
    pub fn mark(&self, before: &Self, tiles: &mut Tiles) {
        before.items.iter().chain(&self.items).for_each(|item| tiles.mark_rectangle(*item));
        let pairs = self.scene.tools.iter().zip(&before.scene.tools);
        let wets = self.scene.light.w != before.scene.light.w;
        for (n, (tool, was)) in pairs.enumerate().filter(|(n, (tool, was))| tool != was || *n == 0 && wets) {
            tiles.join(&self.tools[n]);
            tiles.join(&before.tools[n]);
            let light = self.scene.light.truncate();
            for (at, seen) in before.seen.iter().enumerate() {
                let Some((middle, radius_mm)) = ball(&self.scene, tiles, at, *seen) else { continue };
                let wet = |scene: &Scene, tool: &ToolShape| {
                    let away = middle.distance(tool.tip.truncate()) - tool.tip.w - radius_mm;
                    n == 0 && scene.light.w > 0.0 && away < WET_MM
                };
                let shaded = |tool: &ToolShape| is_shaded(light, middle, radius_mm, tool);
                if shaded(tool) || shaded(was) || wet(&self.scene, tool) || wet(&before.scene, was) {
                    tiles.mark_tile(at);
                }
            }
        }
    }

    /// Takes the distances in tiles that are not marked from the picture before, measures the
    /// others and where shadows may fall in them.
    pub fn measure(&mut self, before: Option<Self>, tiles: &Tiles, rays: &[Ray], brain: &Fragments, threads: usize) {
        self.seen = before.map_or_else(Vec::new, |before| before.seen);
        self.seen.resize(tiles.marks().len(), NOTHING_SEEN);
        let (scene, columns) = (&self.scene, tiles.columns());
        let [width, height] = [scene.right.w as usize, scene.up.w as usize];
        rows::share(threads, self.seen.chunks_mut(columns.max(1)).enumerate(), |line, row| {
            for (column, seen) in row.iter_mut().enumerate().filter(|(n, _)| tiles.marks()[columns * line + n]) {
                let corner = [EDGE * column, EDGE * line];
                // Depths along the view become distances by the steepest and the straightest ray.
                let slants = corners(corner).map(|[x, y]| 1.0 / scene.ray_of(x, y).dot(self.view.forward));
                let [least, most] =
                    [slants.iter().fold(NOTHING, |a, b| a.min(*b)), slants.iter().fold(1.0f32, |a, b| a.max(*b))];
                *seen = NOTHING_SEEN;
                for y in corner[1]..(corner[1] + EDGE).min(height) {
                    for at in (corner[0]..(corner[0] + EDGE).min(width)).map(|x| x + width * y) {
                        let (t, nearness) = (rays[at].t, brain.nearness(at));
                        let [low, high] = if nearness > 0.0 { [least / nearness, most / nearness] } else { [t; 2] };
                        let [low, high] = if t < low { [t; 2] } else { [low, high] };
                        if low < NOTHING {
                            *seen = [seen[0].min(low), seen[1].max(high)];
                        }
                    }
                }
            }
        });
        for n in (0..tiles.marks().len()).filter(|n| tiles.marks()[*n]) {
            let Some((middle, radius_mm)) = ball(scene, tiles, n, self.seen[n]) else { continue };
            for (shadow, tool) in self.shadows.iter_mut().zip(&scene.tools) {
                if is_shaded(scene.light.truncate(), middle, radius_mm, tool) {
                    shadow.mark_tile(n);
                }
            }
        }
    }

    /// Tools that may be seen at a pixel, and those whose shadow may fall there.
    pub fn near(&self, at: [usize; 2]) -> [[bool; 2]; 2] {
        [&self.tools, &self.shadows].map(|of| [0, 1].map(|n| of[n].holds(at)))
    }
}

/// The corners of a tile, pixels.
fn corners([x, y]: [usize; 2]) -> [[usize; 2]; 4] {
    let far = EDGE - 1;
    [[x, y], [x + far, y], [x, y + far], [x + far, y + far]]
}

/// The ball around what is seen in a tile.
fn ball(scene: &Scene, tiles: &Tiles, n: usize, [near, far]: [f32; 2]) -> Option<(Vec3, f32)> {
    if near > far {
        return None;
    }
    let corner = [n % tiles.columns(), n / tiles.columns()].map(|n| EDGE * n);
    let rays = corners(corner).map(|[x, y]| scene.ray_of(x, y));
    let eye = scene.eye.truncate();
    let middle = eye + 0.125 * (near + far) * rays.iter().sum::<Vec3>();
    let away = |t: f32| rays.map(|ray| middle.distance(eye + t * ray)).into_iter().fold(0.0, f32::max);
    // Half a pixel around the corners' middles.
    Some((middle, 1.1 * away(near).max(away(far)) + 0.01))
}

/// Marks the tiles that show a tool, part by part of its shaft.
fn mark(tool: &ToolShape, view: &View, size: [usize; 2], tiles: &mut Tiles) {
    let at = |n: usize| tool.tip.truncate().lerp(tool.tail.truncate(), n as f32 / PARTS as f32);
    for n in 0..PARTS {
        let [from, to] = [at(n), at(n + 1)];
        let part = ToolShape { tip: from.extend(tool.tip.w), tail: to.extend(tool.tail.w), ..*tool };
        let is_behind = [from, to].iter().all(|p| (*p - view.eye).dot(view.forward) < -2.0 * tool.look.z);
        if !is_behind {
            tiles.mark_rectangle(rectangle(&part, view, size));
        }
    }
}
