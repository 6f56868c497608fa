//! The pass of the contacts: springs with the device's own present nodes, one workgroup.

use crate::gpu::device_state::DeviceState;
use crate::gpu::forces::Forces;
use crate::gpu::pass::Pass;
use crate::gpu::topology::Topology;
use trepan_contact::{MAX_NODES, MAX_PLANES, MAX_SPRINGS, NodalContact, PlaneContact};
use trepan_gpu::Slot::{Storage, StorageMut, Uniform};
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_shaders::TLED_PRESS;

/// The contacts on the device.
pub(crate) struct Press {
    /// Of one workgroup.
    pub pass: Pass,
    springs: Buffer<Spring>,
    touched: Buffer<[u32; 4]>,
    /// Forces of the springs by place, N; zero where nothing presses.
    pub pushed: Buffer<[f32; 4]>,
    /// Sum over the springs in the newest step, N.
    pub pressure: Buffer<f32>,
    /// The springs of the next submission.
    pub list: List,
    /// By place, springs on it while a list is made; zeroes between lists.
    uses: Vec<u32>,
    /// Whether the last list held anything.
    presses: bool,
}

/// A spring as `press.wgsl` declares it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Spring {
    normal: [f32; 3],
    stiffness: f32,
    damping: f32,
    rest_depth: f32,
    tool_velocity: f32,
    unused: f32,
    lateral_velocity: [f32; 3],
    lateral_damping: f32,
    first: u32,
    count: u32,
    padding: [u32; 2],
}

/// Springs, and the place of every node that they touch. With it go the bits of its weight, of 1/m
/// and of the share of m that has weight.
pub(crate) struct List {
    springs: Vec<Spring>,
    touched: Vec<[u32; 4]>,
}

impl List {
    pub fn clear(&mut self) {
        self.springs.clear();
        self.touched.clear();
    }

    /// Adds a spring that is `rest_depth` mm deep where nothing moved. Nodes that the mesh lacks
    /// are left out.
    pub fn add(&mut self, spring: &NodalContact, rest_depth: f32, place_of: &[u32], state: &DeviceState) {
        let first = self.touched.len();
        for (n, w) in spring.nodes() {
            let Some(&place) = place_of.get(n as usize) else { continue };
            let [inverse_mass, weight] = state.mass_of(place);
            self.touched.push([place, w.to_bits(), inverse_mass.to_bits(), weight.to_bits()]);
        }
        self.springs.push(Spring {
            normal: spring.normal.to_array(),
            stiffness: spring.stiffness,
            damping: spring.damping,
            rest_depth,
            tool_velocity: spring.tool_normal_velocity,
            unused: 0.0,
            lateral_velocity: spring.lateral_velocity.to_array(),
            lateral_damping: spring.lateral_damping,
            first: first as u32,
            count: (self.touched.len() - first) as u32,
            padding: [0; 2],
        });
    }

    /// Adds a plane, after all springs, that is `rest_depth` mm deep where nothing moved; false
    /// where the mesh lacks its node.
    pub fn add_plane(&mut self, plane: &PlaneContact, rest_depth: f32, place_of: &[u32], state: &DeviceState) -> bool {
        let Some(&place) = place_of.get(plane.node as usize) else { return false };
        let [inverse_mass, weight] = state.mass_of(place);
        let first = self.touched.len() as u32;
        self.touched.push([place, 1f32.to_bits(), inverse_mass.to_bits(), weight.to_bits()]);
        self.springs.push(Spring {
            normal: plane.normal.to_array(),
            stiffness: plane.stiffness,
            damping: plane.damping,
            rest_depth,
            first,
            count: 1,
            ..Spring::default()
        });
        true
    }
}

impl Press {
    pub fn new(gpu: &Gpu, state: &DeviceState, topology: &Topology, forces: &Forces) -> Result<Self, GpuError> {
        // Room for 64 more: idle lanes read past the last spring's nodes.
        let most = MAX_SPRINGS * MAX_NODES + MAX_PLANES;
        let touched = Buffer::zeroed(gpu, "touched", most + MAX_NODES)?;
        let springs = Buffer::zeroed(gpu, "springs", MAX_SPRINGS + MAX_PLANES)?;
        let pushed = Buffer::zeroed(gpu, "pushed", state.u.len())?;
        let pressure = Buffer::zeroed(gpu, "pressure", 1)?;
        let bound = [
            (Uniform, (&state.step).into()),
            (StorageMut, (&springs).into()),
            (Storage, (&touched).into()),
            (Storage, (&state.u).into()),
            (Storage, (&state.v).into()),
            (Storage, (&topology.starts).into()),
            (Storage, (&forces.slots).into()),
            (StorageMut, (&pushed).into()),
            (StorageMut, (&pressure).into()),
            (Storage, (&state.anchors).into()),
        ];
        let pass = Pass::new(gpu, "press", TLED_PRESS, &bound, 1)?;
        let springs_of = Vec::with_capacity(MAX_SPRINGS + MAX_PLANES);
        let list = List { springs: springs_of, touched: Vec::with_capacity(most) };
        Ok(Self { pass, springs, touched, pushed, pressure, list, uses: vec![0; state.u.len()], presses: false })
    }

    /// Takes the springs of the next steps: those that share nodes, then those of one node that no
    /// other spring touches. `deep` tells how deep one is where nothing moved. Returns how many of
    /// each there are.
    pub fn list_springs(
        &mut self,
        springs: &[NodalContact],
        deep: impl Fn(&NodalContact) -> f32,
        place_of: &[u32],
        state: &DeviceState,
    ) -> [u32; 2] {
        let Self { list, uses, .. } = self;
        list.clear();
        let place = |(node, _): (u32, f32)| place_of.get(node as usize).map(|&place| place as usize);
        springs.iter().flat_map(NodalContact::nodes).filter_map(place).for_each(|at| uses[at] += 1);
        let is_single = |spring: &NodalContact| {
            let mut nodes = spring.nodes();
            nodes.next().and_then(place).is_some_and(|at| uses[at] == 1) && nodes.next().is_none()
        };
        let mut counts = [0; 2];
        for (n, count) in counts.iter_mut().enumerate() {
            for spring in springs.iter().filter(|spring| usize::from(is_single(spring)) == n) {
                list.add(spring, deep(spring), place_of, state);
                *count += 1;
            }
        }
        springs.iter().flat_map(NodalContact::nodes).filter_map(place).for_each(|at| uses[at] = 0);
        counts
    }

    /// Whether anything was handed over that presses.
    pub fn presses(&self) -> bool {
        self.presses
    }

    /// Hands the list over; returns the number of its nodes, and whether what pushed before must be
    /// cleared.
    pub fn hand_over(&mut self, gpu: &Gpu) -> (u32, bool) {
        let List { springs, touched } = &self.list;
        let before = std::mem::replace(&mut self.presses, !springs.is_empty());
        if self.presses {
            self.springs.write(gpu, 0, springs);
            self.touched.write(gpu, 0, touched);
        }
        (touched.len() as u32, before || self.presses)
    }
}
