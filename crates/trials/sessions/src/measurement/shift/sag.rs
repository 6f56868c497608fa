//! The brain in the closed skull when the head is turned: it floats, but weighs a thirtieth.

use super::head::{Head, Still};
use crate::measurement::comparison::{Comparison, How};
use anyhow::Result;
use glam::Vec3;
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::units::GRAVITY_MM_PER_MS2;
use trepan_measurements::sag;
use trepan_soft::Loads;

/// Time after which the brain is looked at, minutes: that within which positional shift is stable.
const MINUTES: f64 = sag::SETTLED.value;
/// Targets of stereotactic surgery lie within this distance of the brain's centre, mm.
const DEEP_MM: f32 = 25.0;

/// Why the brain moves less from lying to sitting.
const SITTING: &str = "in a person who sits up fluid leaves the skull for the spine and the ventricles shrink, which \
                       moves the brain further; here its weight in fluid turns and nothing else changes";

/// Why a value that the layer was fitted to may lie outside.
const FITTED_BY_HAND: &str = "the layer between brain and skull was fitted by hand, and the laws of brain changed \
                              after that";

/// Rows of the turned head.
pub fn findings(findings: &mut Findings) -> Result<()> {
    let head = Head::new()?;
    let (front, lying) = (Vec3::Y, Vec3::NEG_Y);
    let supine = turned(&head, front, lying)?;
    let deep: Vec<f64> = deep_nodes(&supine).iter().map(|node| supine.moved(*node).length().into()).collect();
    let [least, most] = [f64::min, f64::max].map(|pick| deep.iter().copied().reduce(pick).unwrap_or(f64::NAN));
    let side = turned(&head, Vec3::X, Vec3::NEG_X)?;
    let aside = deep_nodes(&side).iter().map(|node| side.moved(*node).length()).fold(0.0, f32::max);
    let sitting = turned(&head, lying, Vec3::NEG_Z)?;
    let (pineal, tonsil) = (pineal(&sitting), tonsil(&sitting));
    let (lost_mm, space_mm) = frontal_loss(&head)?;
    let fitted = |row, ours| Comparison::of(row, How::Fitted, ours);
    let predicted = |row, ours: f32| Comparison::of(row, How::Predicted, ours.into());
    findings.rows.extend(
        [
            fitted(&sag::PRONE_TO_SUPINE_LEAST, least).why(FITTED_BY_HAND),
            fitted(&sag::PRONE_TO_SUPINE_MOST, most).why(FITTED_BY_HAND),
            predicted(&sag::SIDE_TO_SIDE_MOST, aside).why(
                "the falx and the layer of arachnoid hold the brain as firmly to the side as to front and back here; \
                 in people it deforms more to the side",
            ),
            predicted(&sag::PINEAL_DOWN, -pineal.z).why(SITTING),
            predicted(&sag::PINEAL_FORWARD, pineal.y).why(SITTING),
            predicted(&sag::TONSIL_DOWN, -tonsil.z).why(
                "the stem is fixed at the foramen magnum here; in people it moves with the spinal cord, and the \
                 tonsils with it",
            ),
            predicted(&sag::FRONTAL_SPACE, 100.0 * lost_mm / space_mm).why(&format!(
                "the space is {space_mm:.1} mm on average here, between a CT and an MRI of two people, and the brain \
                 moves {lost_mm:.2} mm in it; the layer was fitted by hand on an earlier mesh, whose surface was wrong"
            )),
        ]
        .map(|comparison| comparison.row()),
    );
    let at_depth = |still: &Still| depth_line(&head, still);
    findings.series.push(Series::over(
        "Sag in the closed skull: displacement below the vertex (measured at deep structures: 0.52 to 0.77 mm)",
        ["depth below the vertex, mm", "displacement, mm"],
        [("prone to supine".into(), at_depth(&supine)), ("lying to sitting".into(), at_depth(&sitting))],
    ));
    Ok(())
}

/// The brain after its weight in fluid has turned from one direction to another.
fn turned(head: &Head, from: Vec3, to: Vec3) -> Result<Still> {
    let mut still = head.at_rest()?;
    let weight = GRAVITY_MM_PER_MS2 * sag::WEIGHT_IN_FLUID.f32() / sag::WEIGHT.f32();
    still.loads = Loads { gravity: weight * (to - from), ..Loads::default() };
    still.rest(MINUTES)?;
    Ok(still)
}

fn deep_nodes(still: &Still) -> Vec<usize> {
    let near = still.around(still.body.mesh.bounds().centre(), DEEP_MM);
    near.into_iter().filter(|node| still.is_tissue(*node)).collect()
}

/// Displacement of the pineal body, which lies behind the centre of the brain on the midline.
fn pineal(still: &Still) -> Vec3 {
    still.moved_around(still.body.mesh.bounds().centre() - 10.0 * Vec3::Y, 10.0)
}

/// Displacement of the tonsils: the lowest tissue behind the stem that is not fixed.
fn tonsil(still: &Still) -> Vec3 {
    let (mesh, fixed) = (&still.body.mesh, &still.body.fixed);
    let low = |node: &usize| mesh.positions[*node].z;
    let free = (0..mesh.positions.len()).filter(|node| !fixed.contains(&(*node as u32)));
    let lowest = free.min_by(|a, b| low(a).total_cmp(&low(b))).unwrap_or(0);
    still.moved_around(mesh.positions[lowest], 8.0)
}

/// Means of what is lost of the parasagittal frontal space from supine to prone, and of it, mm.
fn frontal_loss(head: &Head) -> Result<(f32, f32)> {
    let still = turned(head, Vec3::NEG_Y, Vec3::Y)?;
    let bounds = still.body.mesh.bounds();
    let (centre, size) = (bounds.centre(), bounds.size());
    let of = |anchor: &&trepan_soft::Anchor| {
        let at = still.body.mesh.positions[anchor.node as usize];
        let is_near = (at.x - centre.x).abs() < 25.0 && at.y > centre.y + 0.2 * size.y && at.z > centre.z;
        is_near && anchor.in_fluid > 0.0
    };
    let (mut lost, mut gap, mut count) = (0.0, 0.0, 0.0f32);
    for anchor in still.body.anchors.iter().filter(of) {
        lost += still.moved(anchor.node as usize).dot(anchor.normal);
        gap += head.gap_mm(still.body.mesh.positions[anchor.node as usize]);
        count += 1.0;
    }
    Ok((lost / count.max(1.0), gap / count.max(1.0)))
}

/// Displacement along the line from the vertex down.
fn depth_line(head: &Head, still: &Still) -> Vec<(f64, f64)> {
    let bounds = head.brain.mesh.bounds();
    let at = |depth: f32| bounds.centre().with_z(bounds.max.z - depth);
    let depths = (1..14).map(|n| 10.0 * n as f32).filter(|depth| *depth < bounds.size().z);
    depths.map(|depth| (depth.into(), still.moved_around(at(depth), 8.0).length().into())).collect()
}
