//! The numbered fields of each record. A number is never reused for another field.

use super::{Fields, Visit};
use crate::wire::{CollisionRecord, EventRecord, SecondRecord, SolverRecord, TeacherRecord, TickRecord};
use trepan_geometry::{Pose, Twist, Vec3, Wrench};

impl Fields for TickRecord {
    const NAME: &'static str = "trepan.Tick";

    fn visit(&mut self, v: &mut dyn Visit) {
        v.uint64(1, "tick", &mut self.tick);
        v.double(2, "time_ms", &mut self.time_ms);
        pose(v, 3, "device", &mut self.device);
        twist(v, 4, "twist", &mut self.twist);
        v.uint32(5, "buttons", &mut self.buttons);
        pose(v, 6, "proxy", &mut self.proxy);
        wrench(v, 7, "wrench", &mut self.wrench);
        vector(v, 8, "contact_normal", &mut self.contact_normal);
        v.float(9, "depth_mm", &mut self.depth_mm);
        v.float(10, "tissue_depth_mm", &mut self.tissue_depth_mm);
        v.float(11, "removed_mm3", &mut self.removed_mm3);
        v.float(12, "brain_distance_mm", &mut self.brain_distance_mm);
        v.uint64(13, "patch_seq", &mut self.patch_seq);
        v.float(14, "compute_us", &mut self.compute_us);
        v.uint32(15, "flags", &mut self.flags);
        byte(v, 16, "phase", &mut self.phase);
        byte(v, 17, "tool", &mut self.tool);
        v.float(18, "spindle_rpm", &mut self.spindle_rpm);
        vector(v, 19, "tissue_force", &mut self.tissue_force);
    }
}

impl Fields for SecondRecord {
    const NAME: &'static str = "trepan.Second";

    fn visit(&mut self, v: &mut dyn Visit) {
        v.uint64(1, "tick", &mut self.tick);
        v.double(2, "time_ms", &mut self.time_ms);
        pose(v, 3, "device", &mut self.device);
        twist(v, 4, "twist", &mut self.twist);
        v.uint32(5, "buttons", &mut self.buttons);
        pose(v, 6, "proxy", &mut self.proxy);
        wrench(v, 7, "wrench", &mut self.wrench);
        v.float(8, "depth_mm", &mut self.depth_mm);
        v.float(9, "tissue_depth_mm", &mut self.tissue_depth_mm);
        v.uint32(10, "flags", &mut self.flags);
    }
}

impl Fields for CollisionRecord {
    const NAME: &'static str = "trepan.Collision";

    fn visit(&mut self, v: &mut dyn Visit) {
        v.uint64(1, "seq", &mut self.seq);
        v.uint64(2, "tick", &mut self.tick);
        v.uint64(3, "solver_step", &mut self.solver_step);
        v.float(4, "depth_mm", &mut self.depth_mm);
        v.uint32(5, "points", &mut self.points);
        v.float(6, "compute_us", &mut self.compute_us);
    }
}

impl Fields for SolverRecord {
    const NAME: &'static str = "trepan.Solver";

    fn visit(&mut self, v: &mut dyn Visit) {
        v.uint64(1, "step", &mut self.step);
        v.uint64(2, "contact_seq", &mut self.contact_seq);
        v.double(3, "time_ms", &mut self.time_ms);
        v.float(4, "max_displacement_mm", &mut self.max_displacement_mm);
        v.uint32(5, "inverted", &mut self.inverted);
        v.float(6, "compute_us", &mut self.compute_us);
    }
}

impl Fields for EventRecord {
    const NAME: &'static str = "trepan.Event";

    fn visit(&mut self, v: &mut dyn Visit) {
        v.uint64(1, "tick", &mut self.tick);
        v.double(2, "time_ms", &mut self.time_ms);
        v.string(3, "kind", &mut self.kind);
        v.string(4, "text", &mut self.text);
    }
}

impl Fields for TeacherRecord {
    const NAME: &'static str = "trepan.Teacher";

    fn visit(&mut self, v: &mut dyn Visit) {
        v.uint64(1, "seq", &mut self.seq);
        pose(v, 2, "ghost", &mut self.ghost);
        vector(v, 3, "marker", &mut self.marker);
        v.uint32(4, "flags", &mut self.flags);
    }
}

fn byte(v: &mut dyn Visit, number: u32, name: &'static str, value: &mut u8) {
    let mut wide = u32::from(*value);
    v.uint32(number, name, &mut wide);
    *value = u8::try_from(wide).unwrap_or(u8::MAX);
}

fn vector(v: &mut dyn Visit, number: u32, name: &'static str, value: &mut Vec3) {
    v.message(number, name, "trepan.Vector", &mut |v| {
        v.float(1, "x", &mut value.x);
        v.float(2, "y", &mut value.y);
        v.float(3, "z", &mut value.z);
    });
}

fn pose(v: &mut dyn Visit, number: u32, name: &'static str, value: &mut Pose) {
    v.message(number, name, "trepan.Pose", &mut |v| {
        vector(v, 1, "translation", &mut value.translation);
        v.message(2, "rotation", "trepan.Quaternion", &mut |v| {
            v.float(1, "x", &mut value.rotation.x);
            v.float(2, "y", &mut value.rotation.y);
            v.float(3, "z", &mut value.rotation.z);
            v.float(4, "w", &mut value.rotation.w);
        });
    });
}

fn twist(v: &mut dyn Visit, number: u32, name: &'static str, value: &mut Twist) {
    v.message(number, name, "trepan.Twist", &mut |v| {
        vector(v, 1, "linear", &mut value.linear);
        vector(v, 2, "angular", &mut value.angular);
    });
}

fn wrench(v: &mut dyn Visit, number: u32, name: &'static str, value: &mut Wrench) {
    v.message(number, name, "trepan.Wrench", &mut |v| {
        vector(v, 1, "force", &mut value.force);
        vector(v, 2, "torque", &mut value.torque);
    });
}
