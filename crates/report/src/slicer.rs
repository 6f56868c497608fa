//! Plan, opening, flap line and tool path as markups, which 3D Slicer opens beside the CT.
//!
//! # Practice
//! One file each, positions in LPS: x and y are those of RAS with the other sign. The path has a
//! point where the tool moved `APART_MM`, at most `MOST_POINTS`: each is a handle in Slicer.
//!
//! # Sources
//! Schema v1.0.3:
//! <https://github.com/Slicer/Slicer/tree/main/Modules/Loadable/Markups/Resources/Schema>.

use crate::ReportError;
use crate::whole::whole;
use serde_json::{Value, json};
use std::f32::consts::TAU;
use std::path::Path;
use trepan_geometry::Vec3;
use trepan_link::wire::TickRecord;
use trepan_patient::Plan;

/// The point where the skull is opened, and those below it.
pub const OPENING: &str = "opening.mrk.json";
/// The line along which it is opened.
pub const PLAN: &str = "plan.mrk.json";
/// The planned outline on the outer table: of the flap, or of the burr hole.
pub const FLAP: &str = "flap-line.mrk.json";
/// The path of the tool's tip.
pub const PATH: &str = "tool-path.mrk.json";

const SCHEMA: &str = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";
/// A numerical parameter: least distance of two points of the path, mm.
const APART_MM: f32 = 0.5;
/// Largest number of points of the path.
const MOST_POINTS: usize = 2000;
/// Points of a burr hole's outline.
const ROUND: usize = 24;

/// Writes the four files.
pub fn write(out: &Path, plan: &Plan, ticks: &[TickRecord]) -> Result<(), ReportError> {
    for (name, markup) in files(plan, ticks) {
        let json = serde_json::to_vec_pretty(&json!({ "@schema": SCHEMA, "markups": [markup] }));
        whole(&out.join(name), &json.map_err(|fault| ReportError::Internal(format!("{name}: {fault}")))?)?;
    }
    Ok(())
}

fn files(plan: &Plan, ticks: &[TickRecord]) -> [(&'static str, Value); 4] {
    let site = &plan.site;
    let below = |mm: f32| site.entry + mm * site.inward;
    let mut opening = vec![("entry".to_string(), site.entry), ("inner table".into(), below(site.bone_mm))];
    if site.brain_mm.is_finite() {
        opening.push(("brain".into(), below(site.brain_mm)));
    }
    let line = vec![("outside".to_string(), below(-30.0)), ("inner table".into(), below(site.bone_mm))];
    let outline: Vec<Vec3> = match plan.outline.is_empty() {
        false => plan.outline.iter().map(|rim| rim.outer).collect(),
        true => hole(plan),
    };
    let outline = outline.into_iter().zip(1..).map(|(place, number)| (number.to_string(), place)).collect();
    [
        (OPENING, markup("Fiducial", &opening, true, [0.0, 0.45, 0.7])),
        (PLAN, markup("Line", &line, false, [0.0, 0.45, 0.7])),
        (FLAP, markup("ClosedCurve", &outline, false, [0.34, 0.71, 0.91])),
        (PATH, markup("Curve", &path(ticks), false, [0.84, 0.37, 0.0])),
    ]
}

/// Outline of the burr hole across the entry direction.
fn hole(plan: &Plan) -> Vec<Vec3> {
    let (right, up) = plan.site.inward.any_orthonormal_pair();
    let turn = |n: usize| n as f32 / ROUND as f32 * TAU;
    (0..ROUND).map(|n| plan.hole() + plan.hole_mm * (turn(n).cos() * right + turn(n).sin() * up)).collect()
}

/// Points of the tip's path, labelled with their time.
fn path(ticks: &[TickRecord]) -> Vec<(String, Vec3)> {
    let mut path: Vec<(String, Vec3)> = Vec::new();
    for tick in ticks {
        let place = tick.proxy.translation;
        if path.last().is_none_or(|(_, last)| last.distance(place) >= APART_MM) {
            path.push((format!("{:.2} s", 1e-3 * tick.time_ms), place));
        }
    }
    let every = path.len().div_ceil(MOST_POINTS).max(1);
    path.into_iter().step_by(every).collect()
}

fn markup(kind: &str, points: &Vec<(String, Vec3)>, labelled: bool, colour: [f32; 3]) -> Value {
    let point = |(number, (label, place)): (usize, &(String, Vec3))| {
        json!({
            "id": number.to_string(), "label": label, "description": "", "associatedNodeID": "",
            "position": [-place.x, -place.y, place.z],
            "orientation": [-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0],
            "selected": true, "locked": true, "visibility": true, "positionStatus": "defined",
        })
    };
    json!({
        "type": kind, "coordinateSystem": "LPS", "coordinateUnits": "mm", "locked": true,
        "fixedNumberOfControlPoints": false, "labelFormat": "%N-%d", "lastUsedControlPointNumber": points.len(),
        "controlPoints": (1..).zip(points).map(point).collect::<Vec<_>>(),
        "measurements": [],
        "display": {
            "visibility": true, "opacity": 1.0, "color": colour, "selectedColor": colour,
            "propertiesLabelVisibility": false, "pointLabelsVisibility": labelled,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Pose;
    use trepan_haptics::script::Site;

    #[test]
    fn markups_are_in_lps_and_hold_plan_and_path() {
        let site = Site { entry: Vec3::new(40.0, 30.0, 90.0), inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
        let plan = Plan::new(None, site, 3.0, 0.0).unwrap();
        let tick = |n: u16| TickRecord {
            time_ms: f64::from(n),
            proxy: Pose::from_translation(Vec3::new(0.01 * f32::from(n), 5.0, 7.0)),
            ..TickRecord::default()
        };
        let out = tempfile::tempdir().unwrap();
        write(out.path(), &plan, &(0..1000).map(tick).collect::<Vec<_>>()).unwrap();
        let read = |name: &str| -> Value {
            serde_json::from_slice::<Value>(&std::fs::read(out.path().join(name)).unwrap()).unwrap()["markups"][0]
                .take()
        };
        let places = |markup: &Value| -> Vec<Vec3> {
            let of = |point: &Value| Vec3::from([0, 1, 2].map(|n| point["position"][n].as_f64().unwrap() as f32));
            markup["controlPoints"].as_array().unwrap().iter().map(of).collect()
        };
        let opening = read(OPENING);
        assert_eq!((&opening["type"], &opening["coordinateSystem"]), (&json!("Fiducial"), &json!("LPS")));
        assert_eq!(places(&opening)[..2], [Vec3::new(-40.0, -30.0, 90.0), Vec3::new(-40.0, -30.0, 84.0)]);
        let hole = places(&read(FLAP));
        let far = |place: &Vec3| (place.distance(Vec3::new(-40.0, -30.0, 90.0)) - 3.0).abs();
        assert!(hole.len() == ROUND && hole.iter().all(|place| far(place) < 1e-4), "{hole:?}");
        let path = read(PATH);
        assert_eq!((path["controlPoints"][1]["label"].as_str(), places(&path).len()), (Some("0.05 s"), 20));
        assert_eq!(places(&path)[1], Vec3::new(-0.5, -5.0, 7.0));
    }
}
