//! CT and cut around a tool, on the nodes of the cut.

use crate::solid::Fine;
use crate::window::{Window, WindowContent};
use glam::IVec3;
use trepan_bone::BoneVolume;

/// How far behind its surface a cut stops a tool, mm, at least: a burr would lock in its bore.
const CLEARANCE_MM: f32 = 0.004;
/// The same for tools of few nodes, nodes, times the square of the radius in nodes: what the
/// splines are uncertain by.
const CLEARANCE_NODES: f32 = 0.06;

/// How far behind its surface a cut stops a tool of that radius, nodes.
pub(crate) fn clearance(node_mm: f32, radius_mm: f32) -> f32 {
    let of_nodes = node_mm / radius_mm.max(node_mm);
    (CLEARANCE_NODES * of_nodes * of_nodes).max(CLEARANCE_MM / node_mm)
}

/// Two windows that show the same box of nodes.
pub(crate) struct Nodes {
    cut: Window,
    density: Window,
    /// Nodes from one voxel to the next.
    stride: i32,
    /// Whether anything was cut nearby.
    near: bool,
    /// Radius of the tool, mm.
    radius_mm: f32,
}

impl Nodes {
    /// For a tool of that radius.
    pub fn new(radius_mm: f32) -> Self {
        let [cut, density] = [WindowContent::Cut, WindowContent::Density].map(Window::new);
        Self { cut, density, stride: 1, near: false, radius_mm }
    }

    /// Everything is to be read anew.
    pub fn forget(&mut self) {
        self.cut.forget();
        self.density.forget();
    }

    /// Makes the windows hold all nodes within `half` of `centre`. Returns the nodes read, or
    /// `None` when that is more than they can hold.
    pub fn cover(&mut self, bone: &BoneVolume, centre: IVec3, half: i32) -> Option<u32> {
        self.stride = bone.cut_nodes();
        self.near = bone.is_cut_near(centre - half, centre + half);
        self.density.cover(bone, centre, half)?;
        self.cut.clear(clearance(bone.node_mm(), self.radius_mm));
        self.cut.cover(bone, centre, half)
    }

    /// Reads anew what others have changed. Returns whether there was anything.
    pub fn renew(&mut self, bone: &BoneVolume) -> bool {
        self.cut.renew(bone) | self.density.renew(bone)
    }

    /// The bone that they show.
    pub fn fine(&self) -> Fine<'_> {
        Fine { density: &self.density, cut: &self.cut, stride: self.stride, near: self.near }
    }

    /// The cut.
    pub fn cut(&self) -> &Window {
        &self.cut
    }

    /// The densities.
    pub fn density(&self) -> &Window {
        &self.density
    }

    /// The window of the cut, to change it, and that of the densities.
    pub fn split(&mut self) -> (&mut Window, &Window) {
        (&mut self.cut, &self.density)
    }
}
