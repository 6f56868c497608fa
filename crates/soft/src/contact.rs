//! Springs on the tissue, with the solver's present nodes: each implicit, one after the other, in
//! an explicit step.
//!
//! # Theory
//! A tool's spring with its damper is stiffer than an explicit step bears on light nodes. To use
//! less of it would break action and reaction: the hand feels all of it. So spring c is taken by
//! backward Euler, on what the step would do without it. With v the velocities that loads and
//! springs before it would give the nodes by the end of the step, x̄ = Σ wᵢ xᵢ, v̄ = Σ wᵢ vᵢ·n, d =
//! offset + x̄·n and γ the velocity that a force gives a mass (dt where nothing damps):
//!
//! ```text
//! v̄⁺ = v̄ - γ p Σ wᵢ²/mᵢ     p = k (d + dt c⁺) + b c⁺     c = v̄ - v_tool
//! p = max(0, (k (d + dt c) + b c) / (1 + γ (k dt + b) Σ wᵢ²/mᵢ))
//! ```
//! The tool goes on during the step: were it to stand, the force would lack `k dt v_tool`.
//! At rest v̄ is what undoes p in a step, so p = k d: stiffness, masses and step move the way there
//! and not the end. With the mesh's own ω and q = γ (k dt + b) Σ wᵢ²/mᵢ the step stays stable for
//! `dt² ω² ≤ 4 + 2 q`: never for less than without the spring, however stiff and damped it is.
//! Springs that share nodes see what those before them did.
//!
//! A plane acts on a node from the moment that the node reaches it, within the step: a light node
//! in front of its plane would otherwise be free for a step. The damping of that step counts for
//! the share of it in which the node is in the plane, `(d + dt v̄) / (dt v̄)`.
//!
//! A spring's damping across its normal is taken implicitly too, node by node, because a contact
//! that is found anew every millisecond follows a node's sliding late, and what is late drives
//! light nodes: on a curved wall the normal of a pressed node turns a millisecond after it slid.
//! Planes damp it by their node's depth ([`PlaneContact::sliding_damping`]). It changes no rest.
//! Springs with it are stable by themselves; beside springs of thousands of N/mm with other normals
//! on the same nodes they are not, near the stable step.
//!
//! # Practice
//! 10 ns for each node of each spring. Nodes outside the mesh are left out.

use trepan_contact::{NodalContact, NodalContacts, PlaneContact};
use trepan_geometry::Vec3;

/// A node as it would be at the end of a step without springs.
#[derive(Clone, Copy, Debug)]
pub struct FreeNode {
    /// Where it is now, mm.
    pub position: Vec3,
    /// How fast it would be, mm/ms.
    pub velocity: Vec3,
    /// 1/m, 1/g; 0 when it is fixed.
    pub inverse_mass: f32,
}

/// What a step of a length does with a force.
#[derive(Clone, Copy, Debug)]
pub struct Gain {
    /// Length of the step, ms.
    pub dt_ms: f32,
    /// Velocity that a force gives a mass in it, ms: `dt` where nothing damps.
    pub gain_ms: f32,
}

/// Presses springs on a body, with what they did so far in a step by node.
#[derive(Clone, Debug)]
pub struct ImplicitSprings {
    /// Time for which the tools have gone on since the contacts were given, ms.
    pub elapsed_ms: f32,
    moved: Vec<Vec3>,
}

impl ImplicitSprings {
    /// For a body of so many nodes.
    pub fn on_nodes(nodes: usize) -> Self {
        Self { elapsed_ms: 0.0, moved: vec![Vec3::ZERO; nodes] }
    }

    /// Adds every spring's force to the nodes, `add(node, N)`, then every plane's; gives the sum of
    /// all of them without their directions, N.
    pub fn press(
        &mut self,
        contacts: &NodalContacts,
        step: Gain,
        free: impl Fn(u32) -> FreeNode,
        mut add: impl FnMut(u32, Vec3),
    ) -> f32 {
        let springs: &[NodalContact] = contacts;
        let mut sum = 0.0;
        for spring in springs {
            let depth = self.depth_of(spring, &free);
            if depth.is_nan() || depth <= 0.0 {
                continue;
            }
            self.brake(spring, step, &free, &mut add);
            let force = self.force_of(spring, depth, step, &free);
            sum += force;
            for (n, w) in spring.nodes() {
                if let Some(moved) = self.moved.get_mut(n as usize) {
                    *moved -= spring.normal * (force * w * step.gain_ms * free(n).inverse_mass);
                    add(n, spring.normal * -(force * w));
                }
            }
        }
        for plane in contacts.planes() {
            let Some(moved) = self.moved.get(plane.node as usize) else { continue };
            let (force, brake) = force_of_plane(plane, *moved, step, free(plane.node));
            if force > 0.0 || brake != Vec3::ZERO {
                sum += force;
                add(plane.node, plane.normal * -force + brake);
            }
        }
        let touched = springs.iter().flat_map(NodalContact::nodes);
        touched.for_each(|(n, _)| self.moved.get_mut(n as usize).into_iter().for_each(|moved| *moved = Vec3::ZERO));
        sum
    }

    /// Damps the nodes of a spring across its normal, each for itself.
    fn brake(
        &mut self,
        spring: &NodalContact,
        step: Gain,
        free: &impl Fn(u32) -> FreeNode,
        add: &mut impl FnMut(u32, Vec3),
    ) {
        if spring.lateral_damping <= 0.0 {
            return;
        }
        for (n, w) in spring.nodes() {
            let Some(moved) = self.moved.get_mut(n as usize) else { continue };
            let FreeNode { velocity, inverse_mass, .. } = free(n);
            let sliding = (velocity + *moved - spring.lateral_velocity).reject_from_normalized(spring.normal);
            let gain = step.gain_ms * inverse_mass;
            let force = sliding * (-w * spring.lateral_damping / (1.0 + gain * w * spring.lateral_damping));
            if force.is_finite() {
                *moved += force * gain;
                add(n, force);
            }
        }
    }

    /// How deep the tissue is in a spring now, mm.
    fn depth_of(&self, spring: &NodalContact, free: &impl Fn(u32) -> FreeNode) -> f32 {
        let known = spring.nodes().filter(|(n, _)| (*n as usize) < self.moved.len());
        let offset_mm = spring.offset_mm - self.elapsed_ms * spring.tool_normal_velocity;
        offset_mm + known.map(|(n, w)| w * free(n).position.dot(spring.normal)).sum::<f32>()
    }

    fn force_of(&self, spring: &NodalContact, depth: f32, step: Gain, free: &impl Fn(u32) -> FreeNode) -> f32 {
        let (mut coming, mut compliance) = (0.0, 0.0);
        for (n, w) in spring.nodes() {
            let Some(moved) = self.moved.get(n as usize) else { continue };
            let node = free(n);
            coming += w * (node.velocity + *moved).dot(spring.normal);
            compliance += w * w * node.inverse_mass;
        }
        let held = 1.0 + step.gain_ms * (spring.stiffness * step.dt_ms + spring.damping) * compliance;
        let closing = coming - spring.tool_normal_velocity;
        let force = (spring.stiffness * (depth + step.dt_ms * closing) + spring.damping * closing) / held;
        if force.is_finite() && force > 0.0 { force } else { 0.0 }
    }
}

/// Force of a plane against its normal, and force that brakes sliding, N, where the springs before
/// it `moved` the node's velocity, mm/ms.
fn force_of_plane(plane: &PlaneContact, moved: Vec3, step: Gain, node: FreeNode) -> (f32, Vec3) {
    let depth = plane.depth_mm(node.position);
    let (velocity, gain) = (node.velocity + moved, step.gain_ms * node.inverse_mass);
    let coming = velocity.dot(plane.normal);
    let ahead = depth + step.dt_ms * coming;
    // Share of the step in which the node is in the plane.
    let share = match (depth > 0.0, ahead > 0.0) {
        (true, _) => 1.0,
        (false, true) => ahead / (step.dt_ms * coming),
        (false, false) => return (0.0, Vec3::ZERO),
    };
    let damping = plane.stiffness * step.dt_ms + share * plane.damping;
    let force = (plane.stiffness * depth + damping * coming) / (1.0 + gain * damping);
    let sliding = velocity - plane.normal * coming;
    let braking = plane.sliding_damping(depth);
    let brake = sliding * (-braking / (1.0 + gain * braking));
    (if force.is_finite() { force.max(0.0) } else { 0.0 }, if brake.is_finite() { brake } else { Vec3::ZERO })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spring([stiffness, damping]: [f32; 2], normal: Vec3, nodes: &[(u32, f32)]) -> NodalContact {
        let mut spring = NodalContact::none();
        (spring.normal, spring.offset_mm, spring.stiffness, spring.damping) = (normal, 2.0, stiffness, damping);
        nodes.iter().for_each(|&(n, w)| spring.add(n, w));
        spring
    }

    fn listed(springs: &[NodalContact]) -> NodalContacts {
        let mut list = NodalContacts::with_room();
        springs.iter().for_each(|spring| list.push(*spring));
        list
    }

    /// A plane gives the force of the same contact as a spring on one node, before and after other
    /// springs.
    #[test]
    fn a_plane_is_the_spring_of_one_node() {
        let plane = |node, damping| PlaneContact { node, normal: Vec3::Z, offset_mm: 0.3, stiffness: 4.0, damping };
        let first = spring([2.0, 0.5], Vec3::Z, &[(0, 0.5), (1, 0.5)]);
        let free = |n: u32| FreeNode {
            position: Vec3::Z * 0.1 * n as f32,
            velocity: Vec3::new(0.2, 0.0, 0.3),
            inverse_mass: 1.0 + n as f32,
        };
        let step = Gain { dt_ms: 0.5, gain_ms: 0.45 };
        let pressed = |contacts: &NodalContacts| {
            let mut forces = [Vec3::ZERO; 4];
            let add = |n: u32, f: Vec3| forces[n as usize] += f;
            let sum = ImplicitSprings::on_nodes(4).press(contacts, step, free, add);
            (forces, sum)
        };
        let (mut planes, mut springs) = (NodalContacts::with_room(), NodalContacts::with_room());
        [&mut planes, &mut springs].into_iter().for_each(|list| list.push(first));
        for (node, damping) in [(1, 0.0), (2, 3.0), (3, 100.0)] {
            planes.push_plane(plane(node, damping));
            let plane = plane(node, damping);
            let mut spring = NodalContact::from(plane);
            spring.lateral_damping = plane.sliding_damping(plane.depth_mm(free(node).position));
            springs.push(spring);
        }
        planes.push_plane(plane(77, 1.0));
        let ((by_plane, sum), (by_spring, exact)) = (pressed(&planes), pressed(&springs));
        assert!((sum / exact - 1.0).abs() < 1e-5 && sum > 1.0, "{sum} N for {exact}");
        assert!(by_plane.iter().zip(by_spring).all(|(a, b)| a.distance(b) < 1e-5), "{by_plane:?} {by_spring:?}");
    }

    /// A node of 0.01 g that 5 mN push at a plane, which is found anew in each step, 6 µm nearer or
    /// farther. Free for a step, it moves by 0.21 mm; held, by 0.0023 mm.
    #[test]
    fn a_light_node_is_not_free_for_a_step_when_its_plane_recedes() {
        let (dt, inverse_mass, push_n) = (0.667f32, 100.0f32, 0.0047f32);
        let (mut x, mut v, mut most_mm) = (Vec3::ZERO, Vec3::ZERO, 0.0f32);
        for n in 0..400 {
            let offset_mm = if n % 3 == 0 { 0.006 } else { -0.006 };
            let plane = PlaneContact { node: 0, normal: Vec3::Z, offset_mm, stiffness: 1.1, damping: 2.2 };
            let free = FreeNode { position: x, velocity: v + Vec3::Z * (push_n * inverse_mass * dt), inverse_mass };
            let (force, _) = force_of_plane(&plane, Vec3::ZERO, Gain { dt_ms: dt, gain_ms: dt }, free);
            v = free.velocity - Vec3::Z * (force * inverse_mass * dt);
            x += v * dt;
            most_mm = most_mm.max(if n > 50 { (v * dt).length() } else { 0.0 });
        }
        assert!(most_mm < 0.004 && (x.z - push_n / 1.1).abs() < 0.01, "{most_mm} mm in a step, at {} mm", x.z);
        let beside = FreeNode { position: Vec3::Z * -0.1, velocity: Vec3::Z * 0.1, inverse_mass };
        let plane = PlaneContact { node: 0, normal: Vec3::Z, offset_mm: 0.0, stiffness: 1.1, damping: 2.2 };
        let step = Gain { dt_ms: dt, gain_ms: dt };
        assert_eq!(force_of_plane(&plane, Vec3::ZERO, step, beside), (0.0, Vec3::ZERO), "not within this step");
    }

    /// Steps eight masses of 2 g on springs of their own beside contact springs, by leapfrog at
    /// `dt² ω² = 3.6`. Gives positions, and the forces of a last step.
    fn settled(springs: &[NodalContact], steps: usize) -> (Vec<Vec3>, f32) {
        let contacts = listed(springs);
        let (dt, inverse_mass, damping) = (0.5f32, 0.5f32, 0.02f32);
        let own = 3.6 / (dt * dt * inverse_mass);
        let (keep, gain) = ((1.0 - 0.5 * damping * dt) / (1.0 + 0.5 * damping * dt), dt / (1.0 + 0.5 * damping * dt));
        let (mut x, mut v, mut sum) = ([Vec3::ZERO; 8], [Vec3::ZERO; 8], 0.0);
        let mut presser = ImplicitSprings::on_nodes(8);
        for _ in 0..steps {
            let coming: [Vec3; 8] = std::array::from_fn(|n| v[n] * keep - x[n] * (own * inverse_mass * gain));
            let free = |n: u32| FreeNode { position: x[n as usize], velocity: coming[n as usize], inverse_mass };
            let mut pushed = [Vec3::ZERO; 8];
            sum = presser.press(&contacts, Gain { dt_ms: dt, gain_ms: gain }, free, |n, f| pushed[n as usize] += f);
            for n in 0..8 {
                v[n] = coming[n] + pushed[n] * (inverse_mass * gain);
                x[n] += v[n] * dt;
            }
        }
        assert!(presser.moved.iter().all(|moved| *moved == Vec3::ZERO));
        (x.to_vec(), sum)
    }

    /// A tool 0.3 mm deep goes on at 0.04 mm/ms; after 0.5 ms it will be 0.02 mm deeper. By hand.
    #[test]
    fn a_moving_tool_presses_as_deep_as_it_will_be() {
        let mut press = spring([2.0, 0.5], Vec3::Z, &[(0, 1.0)]);
        (press.offset_mm, press.tool_normal_velocity) = (0.3, -0.04);
        let free = |_: u32| FreeNode { position: Vec3::ZERO, velocity: Vec3::ZERO, inverse_mass: 1.0 };
        let step = Gain { dt_ms: 0.5, gain_ms: 0.5 };
        let force = ImplicitSprings::on_nodes(1).press(&listed(&[press]), step, free, |_, _| {});
        let exact = (2.0 * 0.32 + 0.5 * 0.04) / (1.0 + 0.5 * (2.0 * 0.5 + 0.5));
        assert!((force - exact).abs() < 1e-6, "{force} N for {exact}");
    }

    /// Presses a spring of k by 2 mm on a mass's own spring K. The force is `k K/(k + K)` times 2
    /// mm, however stiff and damped it is.
    #[test]
    fn at_rest_the_tissue_bears_all_of_what_the_spring_says() {
        let own = 3.6f32 / (0.25 * 0.5);
        for (k, b) in [(0.3, 0.3), (1.0, 50.0), (300.0, 0.0), (300.0, 300.0), (1e4, 1.0)] {
            let (x, force) = settled(&[spring([k, b], Vec3::Z, &[(3, 1.0)])], 20_000);
            let exact = 2.0 * k * own / (k + own);
            assert!((force / exact - 1.0).abs() < 2e-3, "{force} N for {exact} with k {k}, b {b}");
            assert!((x[3].z + exact / own).abs() < 2e-3 * exact / own, "{} mm", x[3].z);
        }
    }

    /// Damping of 2 N ms/mm on 1 g and 3 g for half a millisecond, by hand. It leaves 1/(1 + b dt
    /// w/m) of the sliding, and all of what goes along the normal.
    #[test]
    fn lateral_damping_slows_what_slides_under_a_pressing_spring() {
        let masses = [1.0f32, 3.0];
        let before = [Vec3::new(4.0, 0.0, 1.0), Vec3::ZERO];
        let free = |n: u32| FreeNode {
            position: Vec3::ZERO,
            velocity: before[n as usize],
            inverse_mass: 1.0 / masses[n as usize],
        };
        let step = Gain { dt_ms: 0.5, gain_ms: 0.5 };
        let mut after = before;
        let mut press = spring([1e-6, 0.0], Vec3::Z, &[(0, 0.5), (1, 0.5)]);
        (press.lateral_damping, press.lateral_velocity) = (2.0, Vec3::new(1.0, 0.0, 9.0));
        let push = |n: u32, f: Vec3| after[n as usize] += f * (0.5 / masses[n as usize]);
        assert!(ImplicitSprings::on_nodes(2).press(&listed(&[press]), step, free, push) > 0.0);
        let exact = [1.0 + 3.0 / 1.5, 1.0 - 1.0 / (1.0 + 0.5 / 3.0)];
        assert!(after.iter().zip(exact).all(|(v, x)| (v.x - x).abs() < 1e-5), "{after:?} for {exact:?}");
        assert!((after[0].z - 1.0).abs() < 1e-5);
    }

    /// At 0.05 mm a plane damps sliding by a quarter of 0.8 N ms/mm: 1 g for 0.5 ms, by hand.
    #[test]
    fn planes_damp_sliding_and_let_go_of_it_without_a_step() {
        let plane = PlaneContact { normal: Vec3::Z, stiffness: 1.0, damping: 0.8, ..PlaneContact::default() };
        let slides = |depth_mm: f32| {
            let mut contacts = NodalContacts::none();
            contacts.push_plane(plane);
            let node = FreeNode { position: Vec3::Z * depth_mm, velocity: Vec3::X, inverse_mass: 1.0 };
            let mut after = Vec3::X;
            let step = Gain { dt_ms: 0.5, gain_ms: 0.5 };
            ImplicitSprings::on_nodes(1).press(&contacts, step, |_| node, |_, force| after += 0.5 * force);
            after.x
        };
        assert!((slides(0.05) - 1.0 / (1.0 + 0.5 * 0.2)).abs() < 1e-6);
        assert!((slides(0.4) - 1.0 / (1.0 + 0.5 * 0.8)).abs() < 1e-6);
        assert!((slides(1e-4) - 1.0).abs() < 1e-3);
        assert_eq!(slides(-0.1), 1.0);
    }

    #[test]
    fn a_spring_never_pulls_and_what_is_no_number_presses_nothing() {
        let mut away = spring([1.0, 1.0], Vec3::Z, &[(0, 1.0)]);
        away.offset_mm = -0.1;
        assert_eq!(settled(&[away], 1).1, 0.0);
        let mut strange = spring([f32::NAN, 0.0], Vec3::Z, &[(0, 1.0), (99, 1.0)]);
        assert_eq!(settled(&[strange], 1).1, 0.0);
        strange.stiffness = f32::MAX;
        assert!(settled(&[strange], 1000).0.iter().all(|x| x.is_finite() && x.length() < 5.0));
    }

    /// Springs of all nodes together, with weights, stiffness, damping and turns of the normals.
    fn shared(weights: &[[f32; 8]], stiffness: [f32; 6], damping: [f32; 6], turns: [f32; 6]) -> Vec<NodalContact> {
        let of = |(c, weights): (usize, &[f32; 8])| {
            let sum: f32 = weights.iter().sum::<f32>().max(1e-3);
            let nodes: Vec<_> = (0..8).zip(weights.iter().map(|w| w / sum)).collect();
            spring([stiffness[c], damping[c]], Vec3::new(turns[c].cos(), turns[c].sin(), 0.0), &nodes)
        };
        weights.iter().enumerate().map(of).collect()
    }

    /// A tool's foundation: a spring for each node, damped across its own normal.
    fn foundation([stiffness, damping, lateral]: [f32; 3], turn: f32) -> Vec<NodalContact> {
        let of = |n: u32| {
            let turn = turn + 0.2 * n as f32;
            let mut alone = spring([stiffness, damping], Vec3::new(turn.cos(), turn.sin(), 0.0), &[(n, 1.0)]);
            alone.lateral_damping = lateral;
            alone
        };
        (0..8).map(of).collect()
    }

    /// Largest distance at rest of masses that springs press by 2 mm, mm. The masses' own springs
    /// hold no more energy than the pressing ones had at the start.
    fn farthest_mm(springs: &[NodalContact]) -> f32 {
        let own = 3.6f32 / (0.25 * 0.5);
        2.0 * (springs.iter().map(|spring| spring.stiffness).sum::<f32>() / own).sqrt()
    }

    proptest! {
        #[test]
        fn no_springs_are_unstable(
            weights in prop::collection::vec(prop::array::uniform8(0.0f32..1.0), 1..6),
            stiffness in prop::array::uniform6(0.1f32..5000.0),
            damping in prop::array::uniform6(0.0f32..5000.0),
            turns in prop::array::uniform6(0.0f32..6.3),
            lateral in 0.0f32..5000.0,
        ) {
            for springs in [
                shared(&weights, stiffness, damping, turns),
                foundation([stiffness[5], damping[5], lateral], turns[5]),
            ] {
                let (x, _) = settled(&springs, 4000);
                let most = 1.001 * farthest_mm(&springs);
                prop_assert!(x.iter().all(|x| x.length() < most), "{x:?} of {most}");
            }
        }

        /// As a probe's tip and shaft press one patch of tissue, up to ten times as strongly.
        #[test]
        fn a_foundation_beside_other_springs_is_stable_at_the_stiffness_of_tissue(
            weights in prop::collection::vec(prop::array::uniform8(0.0f32..1.0), 1..3),
            stiffness in prop::array::uniform6(0.001f32..5.0),
            damping in prop::array::uniform6(0.0f32..5.0),
            turns in prop::array::uniform6(0.0f32..6.3),
        ) {
            let mut springs = foundation([stiffness[5], damping[5], stiffness[5]], turns[5]);
            springs.extend(shared(&weights, stiffness, damping, turns));
            let (x, _) = settled(&springs, 4000);
            prop_assert!(x.iter().all(|x| x.length() < 20.0), "{x:?}");
        }
    }
}
