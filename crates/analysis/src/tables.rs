//! Columns of the Parquet tables `ticks`, `events`, `scores` and `cases`, with their units.
//!
//! # Practice
//! Each field's metadata has its `unit`, and a column's name ends with it. Vectors are three columns,
//! quaternions four. Columns of the second hand begin with `second_` and are null without it.

use anyhow::Result;
use datafusion::arrow::array::{
    ArrayRef, BooleanArray, Float32Array, Float64Array, RecordBatch, UInt8Array, UInt32Array, UInt64Array,
};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::parquet::basic::{Compression, Encoding, ZstdLevel};
use datafusion::parquet::file::metadata::KeyValue;
use datafusion::parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use std::sync::{Arc, LazyLock};
use trepan_geometry::{Quat, Vec3};
use trepan_link::wire::{SecondRecord, TickRecord};

/// Names of the tables.
pub const TABLES: [&str; 4] = ["ticks", "events", "scores", "cases"];
/// Version of the columns; raised when a column changes its name, type or meaning.
pub const VERSION: &str = "1";
/// Key of the version in a file's metadata.
pub const VERSION_KEY: &str = "trepan.tables";
/// Key of what a session's files were exported from, in a file's metadata.
pub const SOURCE_KEY: &str = "trepan.source";
/// Longest row group, rows.
const ROW_GROUP: usize = 1 << 17;

/// How the values of a column come from a tick, or from the second hand's.
#[derive(Clone, Copy)]
enum Get {
    F64(fn(&TickRecord) -> f64),
    F32(fn(&TickRecord) -> f32),
    /// A component of a vector.
    Axis(fn(&TickRecord) -> Vec3, usize),
    /// A component of a rotation's quaternion.
    Turn(fn(&TickRecord) -> Quat, usize),
    U64(fn(&TickRecord) -> u64),
    U32(fn(&TickRecord) -> u32),
    U8(fn(&TickRecord) -> u8),
    Flag(u32),
    SecondF32(fn(&SecondRecord) -> f32),
    SecondAxis(fn(&SecondRecord) -> Vec3, usize),
    SecondTurn(fn(&SecondRecord) -> Quat, usize),
    SecondU32(fn(&SecondRecord) -> u32),
    SecondFlag(u32),
}

/// A column of `ticks`.
struct Column {
    name: String,
    unit: &'static str,
    get: Get,
}

static TICK_COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let mut all = Vec::new();
    first_hand(&mut all);
    second_hand(&mut all);
    all
});

/// Adds columns: of each name with its `*`, x, y, z and, for four, w.
fn add<const N: usize>(all: &mut Vec<Column>, name: &str, unit: &'static str, get: impl Fn(usize) -> Get) {
    let axis = |at: usize| if N == 1 { "" } else { ["x", "y", "z", "w"][at] };
    all.extend((0..N).map(|at| Column { name: name.replace('*', axis(at)), unit, get: get(at) }));
}

fn first_hand(all: &mut Vec<Column>) {
    use Get::{Axis, F32, F64, Flag, Turn, U8, U32, U64};
    add::<1>(all, "tick", "1", |_| U64(|t| t.tick));
    add::<1>(all, "time_ms", "ms", |_| F64(|t| t.time_ms));
    add::<3>(all, "device_*_mm", "mm", |at| Axis(|t| t.device.translation, at));
    add::<4>(all, "device_q*", "1", |at| Turn(|t| t.device.rotation, at));
    add::<3>(all, "velocity_*_m_s", "m/s", |at| Axis(|t| t.twist.linear, at));
    add::<3>(all, "rotation_*_rad_ms", "rad/ms", |at| Axis(|t| t.twist.angular, at));
    add::<1>(all, "buttons", "bits", |_| U32(|t| t.buttons));
    add::<3>(all, "proxy_*_mm", "mm", |at| Axis(|t| t.proxy.translation, at));
    add::<4>(all, "proxy_q*", "1", |at| Turn(|t| t.proxy.rotation, at));
    add::<3>(all, "force_*_n", "N", |at| Axis(|t| t.wrench.force, at));
    add::<3>(all, "torque_*_n_mm", "N mm", |at| Axis(|t| t.wrench.torque, at));
    add::<1>(all, "tissue_n", "N", |_| F32(TickRecord::tissue_n));
    add::<3>(all, "normal_*", "1", |at| Axis(|t| t.contact_normal, at));
    add::<1>(all, "depth_mm", "mm", |_| F32(|t| t.depth_mm));
    add::<1>(all, "tissue_depth_mm", "mm", |_| F32(|t| t.tissue_depth_mm));
    add::<1>(all, "removed_mm3", "mm3", |_| F32(|t| t.removed_mm3));
    add::<1>(all, "spindle_rpm", "1/min", |_| F32(|t| t.spindle_rpm));
    add::<1>(all, "brain_distance_mm", "mm", |_| F32(|t| t.brain_distance_mm));
    add::<1>(all, "compute_us", "us", |_| F32(|t| t.compute_us));
    add::<1>(all, "phase", "1", |_| U8(|t| t.phase));
    add::<1>(all, "tool", "1", |_| U8(|t| t.tool));
    for (name, mask) in [
        ("late", TickRecord::LATE),
        ("held", TickRecord::HELD),
        ("clamped", TickRecord::CLAMPED),
        ("drilling", TickRecord::DRILLING),
        ("stale", TickRecord::STALE),
        ("released", TickRecord::RELEASED),
        ("lost", TickRecord::LOST),
        ("through", TickRecord::THROUGH),
        ("undoing", TickRecord::UNDOING),
    ] {
        add::<1>(all, name, "", |_| Flag(mask));
    }
}

fn second_hand(all: &mut Vec<Column>) {
    use Get::{SecondAxis, SecondF32, SecondFlag, SecondTurn, SecondU32};
    add::<3>(all, "second_device_*_mm", "mm", |at| SecondAxis(|s| s.device.translation, at));
    add::<4>(all, "second_device_q*", "1", |at| SecondTurn(|s| s.device.rotation, at));
    add::<3>(all, "second_velocity_*_m_s", "m/s", |at| SecondAxis(|s| s.twist.linear, at));
    add::<3>(all, "second_rotation_*_rad_ms", "rad/ms", |at| SecondAxis(|s| s.twist.angular, at));
    add::<1>(all, "second_buttons", "bits", |_| SecondU32(|s| s.buttons));
    add::<3>(all, "second_proxy_*_mm", "mm", |at| SecondAxis(|s| s.proxy.translation, at));
    add::<4>(all, "second_proxy_q*", "1", |at| SecondTurn(|s| s.proxy.rotation, at));
    add::<3>(all, "second_force_*_n", "N", |at| SecondAxis(|s| s.wrench.force, at));
    add::<3>(all, "second_torque_*_n_mm", "N mm", |at| SecondAxis(|s| s.wrench.torque, at));
    add::<1>(all, "second_depth_mm", "mm", |_| SecondF32(|s| s.depth_mm));
    add::<1>(all, "second_tissue_depth_mm", "mm", |_| SecondF32(|s| s.tissue_depth_mm));
    for (name, mask) in [
        ("second_clamped", TickRecord::CLAMPED),
        ("second_stale", TickRecord::STALE),
        ("second_released", TickRecord::RELEASED),
        ("second_lost", TickRecord::LOST),
    ] {
        add::<1>(all, name, "", |_| SecondFlag(mask));
    }
}

impl Get {
    /// Type of the values, and whether they are null without a second hand.
    fn kind(self) -> (DataType, bool) {
        match self {
            Self::F64(_) => (DataType::Float64, false),
            Self::F32(_) | Self::Axis(..) | Self::Turn(..) => (DataType::Float32, false),
            Self::U64(_) => (DataType::UInt64, false),
            Self::U32(_) => (DataType::UInt32, false),
            Self::U8(_) => (DataType::UInt8, false),
            Self::Flag(_) => (DataType::Boolean, false),
            Self::SecondF32(_) | Self::SecondAxis(..) | Self::SecondTurn(..) => (DataType::Float32, true),
            Self::SecondU32(_) => (DataType::UInt32, true),
            Self::SecondFlag(_) => (DataType::Boolean, true),
        }
    }

    fn values(self, ticks: &[TickRecord], second: &[Option<SecondRecord>]) -> ArrayRef {
        let real = |get: &dyn Fn(&TickRecord) -> f32| {
            Arc::new(Float32Array::from_iter_values(ticks.iter().map(get))) as ArrayRef
        };
        let of_second = |get: &dyn Fn(&SecondRecord) -> f32| {
            Arc::new(second.iter().map(|s| s.as_ref().map(get)).collect::<Float32Array>()) as ArrayRef
        };
        match self {
            Self::F64(get) => Arc::new(Float64Array::from_iter_values(ticks.iter().map(get))),
            Self::F32(get) => real(&get),
            Self::Axis(get, at) => real(&|tick| get(tick)[at]),
            Self::Turn(get, at) => real(&|tick| get(tick).to_array()[at]),
            Self::U64(get) => Arc::new(UInt64Array::from_iter_values(ticks.iter().map(get))),
            Self::U32(get) => Arc::new(UInt32Array::from_iter_values(ticks.iter().map(get))),
            Self::U8(get) => Arc::new(UInt8Array::from_iter_values(ticks.iter().map(get))),
            Self::Flag(mask) => Arc::new(ticks.iter().map(|tick| Some(tick.has(mask))).collect::<BooleanArray>()),
            Self::SecondF32(get) => of_second(&get),
            Self::SecondAxis(get, at) => of_second(&|s| get(s)[at]),
            Self::SecondTurn(get, at) => of_second(&|s| get(s).to_array()[at]),
            Self::SecondU32(get) => Arc::new(second.iter().map(|s| s.as_ref().map(get)).collect::<UInt32Array>()),
            Self::SecondFlag(mask) => {
                Arc::new(second.iter().map(|s| s.as_ref().map(|s| s.has(mask))).collect::<BooleanArray>())
            }
        }
    }
}

/// A field with its unit in the metadata; none for an empty unit.
fn field(name: &str, unit: &str, kind: DataType, nullable: bool) -> Field {
    let metadata = (!unit.is_empty()).then(|| ("unit".to_owned(), unit.to_owned()));
    Field::new(name, kind, nullable).with_metadata(metadata.into_iter().collect())
}

/// Columns of a table, without the partition's column `session`.
pub fn schema(table: &str) -> SchemaRef {
    let text = |name, nullable| field(name, "", DataType::Utf8, nullable);
    let whole = |name, unit| field(name, unit, DataType::UInt64, false);
    let real = |name, unit| field(name, unit, DataType::Float64, false);
    let yes = |name| field(name, "", DataType::Boolean, false);
    Arc::new(Schema::new(match table {
        "ticks" => {
            let of = |Column { name, unit, get }: &Column| field(name, unit, get.kind().0, get.kind().1);
            TICK_COLUMNS.iter().map(of).collect::<Vec<_>>()
        }
        "events" => vec![whole("tick", "1"), real("time_ms", "ms"), text("kind", false), text("text", false)],
        "scores" => vec![text("name", false), real("value", ""), text("unit", false)],
        _ => vec![
            text("program", false),
            text("version", false),
            text("case_hash", true),
            text("device", true),
            text("second_device", true),
            text("task", false),
            text("participant", true),
            text("condition", true),
            text("quality", true),
            text("rigid", true),
            text("began_utc", true),
            whole("seed", "1"),
            real("duration_s", "s"),
            whole("ticks", "1"),
            whole("missing_ticks", "1"),
            yes("second_hand"),
            yes("complete"),
            yes("simulated"),
            text("losses", true),
        ],
    }))
}

/// Rows of `ticks`; `second` is as long as `ticks`.
pub fn tick_rows(ticks: &[TickRecord], second: &[Option<SecondRecord>]) -> Result<RecordBatch> {
    let values = TICK_COLUMNS.iter().map(|column| column.get.values(ticks, second)).collect();
    Ok(RecordBatch::try_new(schema("ticks"), values)?)
}

/// Compression and encodings of a table's files; `source` says what they were made from.
pub fn properties(table: &str, source: &str) -> WriterProperties {
    let entry = |key: &str, value: &str| KeyValue::new(key.to_owned(), value.to_owned());
    let about = vec![entry(VERSION_KEY, VERSION), entry(SOURCE_KEY, source)];
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_max_row_group_row_count(Some(ROW_GROUP))
        .set_key_value_metadata(Some(about));
    if table == "ticks" { of_ticks(properties) } else { properties }.build()
}

/// Bytes of equal weight of neighbouring numbers lie together, which compresses measured values.
fn of_ticks(properties: WriterPropertiesBuilder) -> WriterPropertiesBuilder {
    let properties = properties.set_dictionary_enabled(false);
    TICK_COLUMNS.iter().fold(properties, |properties, column| {
        let path = column.name.as_str().into();
        match column.get.kind().0 {
            DataType::Float64 | DataType::Float32 => properties.set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT),
            DataType::UInt64 => properties.set_column_encoding(path, Encoding::DELTA_BINARY_PACKED),
            DataType::Boolean => properties,
            _ => properties.set_column_dictionary_enabled(path, true),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_ends_with_its_unit() {
        for table in TABLES {
            for field in schema(table).fields() {
                let unit = field.metadata().get("unit").map_or("", String::as_str);
                let end = match unit {
                    "" | "1" | "bits" => continue,
                    "1/min" => "_rpm".to_owned(),
                    unit => format!("_{}", unit.replace([' ', '/'], "_").to_lowercase()),
                };
                assert!(field.name().ends_with(&end), "{} is in {unit}", field.name());
            }
        }
    }
}
