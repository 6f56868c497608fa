//! One collision step, readable as a list: place the points, fit the surface, find, respond.

use crate::config::{Config, ConfigError};
use crate::method::{Method, Response};
use crate::narrow::{Hits, NONE};
use crate::outcome::TissueStep;
use crate::response::responder;
use crate::response::{Foundation, Law, Respond, Spring};
use crate::scene::Scene;
use crate::seam::{Search, SearchInputs};
use crate::surface::MovingSurface;
use trepan_contact::SurfacePatch;
use trepan_geometry::{Aabb, Pointshell, Spread, Tool, ToolState, Vec3};
use trepan_mesh::{FACES, Split, TetMesh, Topology};

/// Tests one ball-tipped tool against one moving tetrahedral mesh.
///
/// Everything is allocated in [`new`](Self::new) and [`resectable`](Self::resectable); nodes move,
/// and tetrahedra may be taken away.
pub struct TissueCollision {
    tets: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    nodes: usize,
    shell: Pointshell,
    radius_mm: f32,
    points: Vec<Vec3>,
    surface: MovingSurface,
    search: Box<dyn Search>,
    responder: Box<dyn Respond>,
    uses_surface: bool,
    method: Method,
    hits: Hits,
    spring: Spring,
    foundation: Option<Foundation>,
    /// Whether each tetrahedron is still there; empty where none can be taken away.
    live: Vec<bool>,
}

impl TissueCollision {
    /// Prepares for this mesh and tool.
    ///
    /// # Errors
    /// When a number in the config, the tool or the mesh makes no sense; the error names it.
    pub fn new(mesh: &TetMesh, tool: &Tool, config: &Config) -> Result<Self, ConfigError> {
        config.check(tool.tip_radius_mm)?;
        check_mesh(mesh)?;
        let shell = Pointshell::sphere(tool.tip_radius_mm, config.points, Spread::Fibonacci);
        let count = shell.points.len() + 1;
        let cell_mm = config.cell_mm.unwrap_or_else(|| usual_cell_mm(mesh));
        let spring = Spring { stiffness: config.stiffness, damping: config.damping };
        let method = config.method.descriptor();
        let response = config.response.unwrap_or(method.response);
        let responder = responder(response);
        let law =
            Law { stiffness_per_mm2: config.stiffness_per_mm2, friction: config.friction, damping: config.damping };
        let foundation = || Foundation::new(mesh.positions.len(), tool, config.shaft, law);
        Ok(Self {
            neighbours: Topology::of(mesh).neighbours,
            tets: mesh.tets.clone(),
            nodes: mesh.positions.len(),
            radius_mm: tool.tip_radius_mm,
            points: vec![Vec3::ZERO; count],
            surface: MovingSurface::of(mesh),
            search: (method.build)(&SearchInputs { mesh, points: count, cell_mm }),
            uses_surface: responder.needs_surface() || method.uses_surface,
            responder,
            method: config.method,
            hits: Hits::with_points(count),
            shell,
            spring,
            foundation: (response == Response::Ball).then(foundation),
            live: Vec::new(),
        })
    }

    /// Makes room for taking tetrahedra away, 18 bytes for each and 80 for each of their faces.
    ///
    /// # Errors
    /// For a search that is not of this crate: it may keep a border of its own.
    pub fn resectable(mut self, mesh: &TetMesh, may_go: impl Fn(u32) -> bool) -> Result<Self, ConfigError> {
        if !Method::OWN.contains(&self.method) {
            return Err(ConfigError::FixedBorder { search: self.method.name() });
        }
        self.surface = MovingSurface::resectable(mesh, &self.neighbours, may_go);
        self.live = vec![true; mesh.tets.len()];
        Ok(self)
    }

    /// Tetrahedron of each of the tool's points that was inside the tissue in the last step.
    pub fn tets_touched(&self) -> impl Iterator<Item = u32> {
        self.hits.tet[..self.hits.tet.len() - 1].iter().copied().filter(|&tet| tet != NONE)
    }

    /// Number of the tool's points.
    pub fn points(&self) -> usize {
        self.shell.points.len()
    }

    /// Tells what is left of a tetrahedron, of 65535: its surface presses by as much.
    ///
    /// With nothing left it is gone from the next step on, and what it covered is border. Nothing
    /// happens to one that [`resectable`](Self::resectable) did not name.
    pub fn thin(&mut self, tet: u32, fill: u16) {
        if self.surface.may_go(tet) {
            self.surface.thin(tet, f32::from(fill) / f32::from(u16::MAX));
            if fill == 0 {
                self.remove(tet);
            }
        }
    }

    /// Follows splits of nodes: faces that have other nodes than what is across them are border.
    ///
    /// From then on a step takes the positions of the copies too. Allocates; 0.3 ms for 8,000
    /// tetrahedra. Nothing happens without [`resectable`](Self::resectable).
    pub fn split(&mut self, splits: &[Split]) {
        if self.live.is_empty() {
            return;
        }
        for split in splits {
            let (tet, corner) = split.place();
            self.tets[tet][corner] = split.node;
            self.nodes = self.nodes.max(split.node as usize + 1);
        }
        self.surface.follow(&self.tets, self.nodes);
        if let Some(foundation) = &mut self.foundation {
            foundation.make_room(self.nodes);
        }
        for (tet, split) in splits.iter().map(|split| (split.corner / 4, split)) {
            for face in (0..4).filter(|&face| FACES[face].contains(&(split.corner as usize % 4))) {
                let next = self.neighbours[tet as usize][face];
                let held = self.tets.get(next as usize).copied().unwrap_or([NONE; 4]);
                let is_apart = FACES[face].iter().any(|&c| !held.contains(&self.tets[tet as usize][c]));
                if next != NONE && is_apart {
                    let back = self.neighbours[next as usize].iter().position(|&n| n == tet).unwrap_or_default();
                    self.neighbours[tet as usize][face] = NONE;
                    self.neighbours[next as usize][back] = NONE;
                    self.surface.expose(tet, face);
                    self.surface.expose(next, back);
                }
            }
        }
    }

    fn remove(&mut self, tet: u32) {
        if !std::mem::take(&mut self.live[tet as usize]) {
            return;
        }
        for (face, next) in std::mem::replace(&mut self.neighbours[tet as usize], [NONE; 4]).into_iter().enumerate() {
            self.surface.cover(tet, face);
            if next != NONE {
                let back = self.neighbours[next as usize].iter().position(|&n| n == tet).unwrap_or_default();
                self.neighbours[next as usize][back] = NONE;
                self.surface.expose(next, back);
            }
        }
    }

    /// One step: where the tissue's nodes are now (mm, mm/ms), where the tool is, what touches.
    ///
    /// A pose that is not finite, or arrays of another length than the mesh, give no contact and
    /// `skipped` counts all tetrahedra.
    pub fn step(&mut self, positions: &[Vec3], velocities: &[Vec3], tool: &ToolState, out: &mut TissueStep) {
        self.clear(tool, out);
        if !tool.is_finite() || positions.len() != self.nodes || velocities.len() != self.nodes {
            self.reset();
            out.skipped = self.tets.len() as u32;
            return;
        }
        self.place_points(tool);
        if self.uses_surface {
            let reach = REACH * self.radius_mm;
            self.surface.refit(positions, Aabb::of_sphere(tool.tip(), reach).into());
        }
        let (tets, neighbours, points) = (&self.tets[..], &self.neighbours[..], &self.points[..]);
        let (radius_mm, live) = (self.radius_mm, &self.live[..]);
        let scene = Scene { positions, velocities, tets, neighbours, points, tool, radius_mm, live };
        self.search.find(&scene, &mut self.surface, &mut self.hits);
        count(&self.hits, out);
        let answer = self.responder.respond(&scene, &self.hits, &mut self.surface, out);
        let is_sound = match &answer {
            Some(answer) => self.spring.finish(&scene, answer, out),
            None => {
                out.forget_contact();
                true
            }
        };
        if let Some(foundation) = self.foundation.as_mut().filter(|_| is_sound) {
            foundation.press(&scene, &mut self.surface, out);
        }
        out.stale = self.surface.stale;
    }

    /// Forgets where the tool was, as after a tool change. Results do not depend on it, only the
    /// next step's time.
    pub fn reset(&mut self) {
        self.search.reset();
        self.responder.reset();
        self.surface.reset();
        self.foundation.iter_mut().for_each(Foundation::reset);
    }

    fn clear(&mut self, tool: &ToolState, out: &mut TissueStep) {
        self.hits.clear();
        out.patch = SurfacePatch { time_ms: tool.time_ms, tip_mm: tool.tip(), ..SurfacePatch::default() };
        out.forget_contact();
        out.surface_springs.clear();
        (out.points_in_contact, out.tests, out.overflow, out.skipped, out.stale) = (0, 0, 0, 0, 0);
    }

    /// The shell in world space, and the centre behind it.
    fn place_points(&mut self, tool: &ToolState) {
        let pose = &tool.world_from_tool;
        for (world, local) in self.points.iter_mut().zip(&self.shell.points) {
            *world = *pose * *local;
        }
        if let Some(centre) = self.points.last_mut() {
            *centre = tool.tip();
        }
    }
}

/// The surface is kept fitted this many radii around the tip.
const REACH: f32 = 2.5;

/// Default cell: this times the mean edge (the thesis's analytic optimum on its spheres).
const CELL_PER_EDGE: f32 = 1.45;

fn count(hits: &Hits, out: &mut TissueStep) {
    let shell = &hits.tet[..hits.tet.len() - 1];
    out.points_in_contact = shell.iter().filter(|&&t| t != NONE).count() as u32;
    (out.tests, out.skipped) = (hits.tests, hits.skipped);
    out.overflow += hits.overflow;
}

/// Refuses a mesh that cannot be collided with.
pub(crate) fn check_mesh(mesh: &TetMesh) -> Result<(), ConfigError> {
    let nodes = mesh.positions.len();
    if mesh.tets.is_empty() {
        return Err(ConfigError::EmptyMesh);
    }
    let unknown = |tet: &[u32; 4]| tet.iter().copied().find(|&n| n as usize >= nodes);
    if let Some((tet, node)) = mesh.tets.iter().enumerate().find_map(|(t, tet)| unknown(tet).map(|n| (t, n))) {
        return Err(ConfigError::NoSuchNode { tet, node, nodes });
    }
    match mesh.positions.iter().enumerate().find(|(_, p)| !p.is_finite()) {
        Some((node, &position)) => Err(ConfigError::NonFinite { node, position }),
        None => Ok(()),
    }
}

/// Edge of a grid cell for a mesh, mm.
pub(crate) fn usual_cell_mm(mesh: &TetMesh) -> f32 {
    CELL_PER_EDGE * mean_edge_mm(mesh)
}

fn mean_edge_mm(mesh: &TetMesh) -> f32 {
    const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let of_tet = |t: usize| {
        let corners = mesh.corners(t);
        EDGES.iter().map(|&[a, b]| corners[a].distance(corners[b]) as f64).sum::<f64>()
    };
    let sum: f64 = (0..mesh.tets.len()).map(of_tet).sum();
    (sum / (6 * mesh.tets.len()) as f64).max(1e-6) as f32
}
