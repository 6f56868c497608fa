//! Columns of the Parquet tables `ticks`, `events`, `scores` and `cases`, with their units.
//!
//! # Practice
//! Each field's metadata has its `unit`, and a column's name ends with it. Vectors are three
//! columns, quaternions four. Columns of the second hand begin with `second_` and are null without
//! it.

use anyhow::Result;
use datafusion::arrow::array::{ArrayRef, BooleanArray, PrimitiveArray, RecordBatch};
use datafusion::arrow::datatypes::{
    ArrowPrimitiveType, DataType, Field, Float32Type, Float64Type, Schema, SchemaRef, UInt8Type, UInt32Type, UInt64Type,
};
use datafusion::parquet::basic::{Compression, Encoding, ZstdLevel};
use datafusion::parquet::file::metadata::KeyValue;
use datafusion::parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use std::sync::{Arc, LazyLock};
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

/// Values of a column from ticks and the second hand's records of the same numbers.
type Values = Box<dyn Fn(&[TickRecord], &[Option<SecondRecord>]) -> ArrayRef + Send + Sync>;

/// A column of `ticks`.
struct Column {
    field: Field,
    values: Values,
}

static TICK_COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let mut all = Columns(Vec::new());
    all.first_hand();
    all.second_hand();
    all.0
});

/// Columns in order. In a name, `*` stands for x, y, z and w.
struct Columns(Vec<Column>);

impl Columns {
    fn first<T: ArrowPrimitiveType>(
        &mut self,
        name: &str,
        unit: &str,
        get: impl Fn(&TickRecord) -> T::Native + Send + Sync + 'static,
    ) {
        let values: Values =
            Box::new(move |ticks, _| Arc::new(PrimitiveArray::<T>::from_iter_values(ticks.iter().map(&get))));
        self.0.push(Column { field: field(name, unit, T::DATA_TYPE, false), values });
    }

    fn second<T: ArrowPrimitiveType>(
        &mut self,
        name: &str,
        unit: &str,
        get: impl Fn(&SecondRecord) -> T::Native + Send + Sync + 'static,
    ) {
        let values: Values = Box::new(move |_, second| {
            let values = second.iter().map(|record| record.as_ref().map(&get));
            Arc::new(PrimitiveArray::<T>::from_iter(values))
        });
        self.0.push(Column { field: field(name, unit, T::DATA_TYPE, true), values });
    }

    fn vector<const N: usize>(&mut self, name: &str, unit: &str, get: fn(&TickRecord) -> [f32; N]) {
        for (at, axis) in AXES.into_iter().enumerate().take(N) {
            self.first::<Float32Type>(&name.replace('*', axis), unit, move |tick| get(tick)[at]);
        }
    }

    fn second_vector<const N: usize>(&mut self, name: &str, unit: &str, get: fn(&SecondRecord) -> [f32; N]) {
        for (at, axis) in AXES.into_iter().enumerate().take(N) {
            self.second::<Float32Type>(&name.replace('*', axis), unit, move |second| get(second)[at]);
        }
    }

    fn first_hand(&mut self) {
        self.first::<UInt64Type>("tick", "1", |t| t.tick);
        self.first::<Float64Type>("time_ms", "ms", |t| t.time_ms);
        self.vector("device_*_mm", "mm", |t| t.device.translation.to_array());
        self.vector("device_q*", "1", |t| t.device.rotation.to_array());
        self.vector("velocity_*_m_s", "m/s", |t| t.twist.linear.to_array());
        self.vector("rotation_*_rad_ms", "rad/ms", |t| t.twist.angular.to_array());
        self.first::<UInt32Type>("buttons", "bits", |t| t.buttons);
        self.vector("proxy_*_mm", "mm", |t| t.proxy.translation.to_array());
        self.vector("proxy_q*", "1", |t| t.proxy.rotation.to_array());
        self.vector("force_*_n", "N", |t| t.wrench.force.to_array());
        self.vector("torque_*_n_mm", "N mm", |t| t.wrench.torque.to_array());
        self.first::<Float32Type>("tissue_n", "N", TickRecord::tissue_n);
        self.vector("normal_*", "1", |t| t.contact_normal.to_array());
        self.first::<Float32Type>("depth_mm", "mm", |t| t.depth_mm);
        self.first::<Float32Type>("tissue_depth_mm", "mm", |t| t.tissue_depth_mm);
        self.first::<Float32Type>("removed_mm3", "mm3", |t| t.removed_mm3);
        self.first::<Float32Type>("spindle_rpm", "1/min", |t| t.spindle_rpm);
        self.first::<Float32Type>("brain_distance_mm", "mm", |t| t.brain_distance_mm);
        self.first::<Float32Type>("compute_us", "us", |t| t.compute_us);
        self.first::<UInt8Type>("phase", "1", |t| t.phase);
        self.first::<UInt8Type>("tool", "1", |t| t.tool);
        for (name, mask) in FLAGS {
            let is =
                move |ticks: &[TickRecord]| ticks.iter().map(|tick| Some(tick.has(mask))).collect::<BooleanArray>();
            let values: Values = Box::new(move |ticks, _| Arc::new(is(ticks)));
            self.0.push(Column { field: field(name, "", DataType::Boolean, false), values });
        }
    }

    fn second_hand(&mut self) {
        self.second_vector("second_device_*_mm", "mm", |s| s.device.translation.to_array());
        self.second_vector("second_device_q*", "1", |s| s.device.rotation.to_array());
        self.second_vector("second_velocity_*_m_s", "m/s", |s| s.twist.linear.to_array());
        self.second_vector("second_rotation_*_rad_ms", "rad/ms", |s| s.twist.angular.to_array());
        self.second::<UInt32Type>("second_buttons", "bits", |s| s.buttons);
        self.second_vector("second_proxy_*_mm", "mm", |s| s.proxy.translation.to_array());
        self.second_vector("second_proxy_q*", "1", |s| s.proxy.rotation.to_array());
        self.second_vector("second_force_*_n", "N", |s| s.wrench.force.to_array());
        self.second_vector("second_torque_*_n_mm", "N mm", |s| s.wrench.torque.to_array());
        self.second::<Float32Type>("second_depth_mm", "mm", |s| s.depth_mm);
        self.second::<Float32Type>("second_tissue_depth_mm", "mm", |s| s.tissue_depth_mm);
        for (name, mask) in
            FLAGS.into_iter().filter(|(name, _)| ["clamped", "stale", "released", "lost"].contains(name))
        {
            let values: Values = Box::new(move |_, second| {
                Arc::new(second.iter().map(|record| record.map(|record| record.has(mask))).collect::<BooleanArray>())
            });
            self.0.push(Column { field: field(&format!("second_{name}"), "", DataType::Boolean, true), values });
        }
    }
}

const AXES: [&str; 4] = ["x", "y", "z", "w"];
const FLAGS: [(&str, u32); 9] = [
    ("late", TickRecord::LATE),
    ("held", TickRecord::HELD),
    ("clamped", TickRecord::CLAMPED),
    ("drilling", TickRecord::DRILLING),
    ("stale", TickRecord::STALE),
    ("released", TickRecord::RELEASED),
    ("lost", TickRecord::LOST),
    ("through", TickRecord::THROUGH),
    ("undoing", TickRecord::UNDOING),
];

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
        "ticks" => TICK_COLUMNS.iter().map(|column| column.field.clone()).collect::<Vec<_>>(),
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
    let values = TICK_COLUMNS.iter().map(|column| (column.values)(ticks, second)).collect();
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
        let path = column.field.name().as_str().into();
        match column.field.data_type() {
            DataType::Float64 | DataType::Float32 => properties.set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT),
            DataType::UInt64 => properties.set_column_encoding(path, Encoding::DELTA_BINARY_PACKED),
            DataType::Boolean => properties,
            _ => properties.set_column_dictionary_enabled(path, true),
        }
    })
}
