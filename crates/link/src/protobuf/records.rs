//! The numbered fields of each record. A number is never reused for another field.

use super::{Field, Fields, Value, Visit};
use crate::wire::{
    CollisionRecord, EventRecord, SecondRecord, SessionHeader, SolverRecord, StateRecord, TeacherRecord, TickRecord,
};
use trepan_geometry::{Pose, Quat, Twist, Vec3, Wrench};

/// Lists messages: the type, its name in files, the number and name of each field.
macro_rules! messages {
    ($($message:ty = $name:literal { $($number:literal $field:ident),* })*) => {$(
        impl Fields for $message {
            const NAME: &'static str = concat!("trepan.", $name);

            fn visit(&mut self, visit: &mut dyn Visit) {
                $(self.$field.visit_as($number, stringify!($field), visit);)*
            }
        }
    )*};
}

messages! {
    TickRecord = "Tick" {
        1 tick, 2 time_ms, 3 device, 4 twist, 5 buttons, 6 proxy, 7 wrench, 8 contact_normal, 9 depth_mm,
        10 tissue_depth_mm, 11 removed_mm3, 12 brain_distance_mm, 13 patch_seq, 14 compute_us, 15 flags, 16 phase,
        17 tool, 18 spindle_rpm, 19 tissue_force
    }
    SecondRecord = "Second" {
        1 tick, 2 time_ms, 3 device, 4 twist, 5 buttons, 6 proxy, 7 wrench, 8 depth_mm, 9 tissue_depth_mm, 10 flags
    }
    CollisionRecord = "Collision" { 1 seq, 2 tick, 3 solver_step, 4 depth_mm, 5 points, 6 compute_us }
    SolverRecord = "Solver" { 1 step, 2 contact_seq, 3 time_ms, 4 max_displacement_mm, 5 inverted, 6 compute_us, 7 cheaper, 8 splits }
    EventRecord = "Event" { 1 tick, 2 time_ms, 3 kind, 4 text }
    TeacherRecord = "Teacher" { 1 seq, 2 ghost, 3 marker, 4 flags }
    StateRecord = "State" { 1 tick, 2 time_ms, 3 words, 4 checksum }
    Vec3 = "Vector" { 1 x, 2 y, 3 z }
    Quat = "Quaternion" { 1 x, 2 y, 3 z, 4 w }
    Pose = "Pose" { 1 translation, 2 rotation }
    Twist = "Twist" { 1 linear, 2 angular }
    Wrench = "Wrench" { 1 force, 2 torque }
}

/// One text, the JSON of a recording's metadata; bytes that are none leave the header as it is.
impl Fields for SessionHeader {
    const NAME: &'static str = "trepan.Header";

    fn visit(&mut self, visit: &mut dyn Visit) {
        // Serialising a struct of strings and maps of strings cannot fail.
        let mut json = serde_json::to_string(self).unwrap_or_default();
        json.visit_as(1, "json", visit);
        if let Ok(header) = serde_json::from_str(&json) {
            *self = header;
        }
    }
}

/// Implements [`Field`] for the types that are a value themselves.
macro_rules! scalars {
    ($($scalar:ty = $value:ident),*) => {$(
        impl Field for $scalar {
            fn visit_as(&mut self, number: u32, name: &'static str, visit: &mut dyn Visit) {
                visit.field(number, name, Value::$value(self));
            }
        }
    )*};
}

scalars!(u32 = Uint32, u64 = Uint64, f32 = Float, f64 = Double, String = String, Vec<u64> = Words);

impl Field for u8 {
    fn visit_as(&mut self, number: u32, name: &'static str, visit: &mut dyn Visit) {
        let mut wide = u32::from(*self);
        wide.visit_as(number, name, visit);
        *self = Self::try_from(wide).unwrap_or(Self::MAX);
    }
}

impl<T: Fields> Field for T {
    fn visit_as(&mut self, number: u32, name: &'static str, visit: &mut dyn Visit) {
        visit.field(number, name, Value::Message(T::NAME, &mut |visit| self.visit(visit)));
    }
}
