//! Segments of a segmentation that 3D Slicer wrote.

use super::{Axes, header, one, starts};
use crate::source::Source;
use crate::{ReadError, Segment};
use std::collections::BTreeMap;
use std::path::Path;

/// The number of label volumes in a file and the segments that it names; 1 and none for other
/// formats.
///
/// A file of Slicer before 4.11 gives neither layer nor value: each segment is a layer of ones.
pub fn segments(path: &Path) -> Result<(usize, Vec<Segment>), ReadError> {
    if path.is_dir() || !starts(Source::open(path)?.peek(4)?) {
        return Ok((1, Vec::new()));
    }
    of_source(&mut Source::open(path)?)
}

pub(super) fn of_source(source: &mut Source) -> Result<(usize, Vec<Segment>), ReadError> {
    let keys = header(source)?;
    let mut fields: BTreeMap<usize, BTreeMap<&str, &str>> = BTreeMap::new();
    for (key, value) in keys.starting(":segment") {
        if let Some((number, field)) = key.split_once('_')
            && let Ok(number) = number.parse()
        {
            fields.entry(number).or_default().insert(field, value);
        }
    }
    let layers = if fields.is_empty() { 1 } else { Axes::of(source, &keys)?.of as usize };
    if layers > fields.len().max(1) {
        return Err(source.field("sizes", format!("that of {layers} layers"), "each layer must hold a named segment"));
    }
    let mut segments = Vec::new();
    for (number, of) in fields {
        let layer = if layers > 1 { number } else { 0 };
        let layer = of.get("layer").map_or(Ok(layer), |text| one(source, "SegmentN_Layer", text))?;
        let value = of.get("labelvalue").map_or(Ok(1), |text| one(source, "SegmentN_LabelValue", text))?;
        if layer >= layers {
            return Err(source.field("SegmentN_Layer", layer, "it must be one of the layers that the sizes announce"));
        }
        let named = of.get("name").or(of.get("id")).filter(|name| !name.is_empty());
        let name = named.map_or_else(|| format!("Segment_{}", number.saturating_add(1)), |name| name.to_string());
        segments.push(Segment { name, layer, value });
    }
    Ok((layers, segments))
}
