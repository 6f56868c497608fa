//! Sorts slices into a stack by position, never by file name.
//!
//! # Theory
//! With the row direction r and the column direction c, n = r × c is the slices' normal and
//! `n · position` sorts them. The step s = (last - first) / (count - 1) is the third axis. With a
//! tilted gantry it is not parallel to n, and the affine is sheared:
//!
//! ```text
//! world = diag(-1, -1, 1) · ( i · column spacing · r + j · row spacing · c + k · s + first )
//! DICOM is LPS, the world RAS
//! ```

use super::slice::Slice;
use crate::{Note, ReadError};
use glam::{DAffine3, DMat3, DVec3};
use std::path::Path;

/// One picture of the stack.
#[derive(Clone, Copy)]
pub(super) struct Picture<'a> {
    pub slice: &'a Slice,
    pub frame: usize,
    pub position: DVec3,
}

/// A sorted stack with its affine.
pub(super) struct Stack<'a> {
    pub pictures: Vec<Picture<'a>>,
    pub world_from_voxel: DAffine3,
    pub notes: Vec<Note>,
}

/// Tilts under this are rounding, degrees.
const LEAST_TILT: f64 = 0.1;

/// Sorts the pictures of some files and checks that they are evenly spaced.
pub(super) fn stack<'a>(place: &Path, slices: &[&'a Slice]) -> Result<Stack<'a>, ReadError> {
    let first = slices.first().ok_or_else(|| series(place, "no pictures are there".into(), "choose another folder"))?;
    if let Some(field) = slices.iter().find_map(|slice| slice.varies) {
        let remedy =
            "one affine cannot place them; export the frames of one orientation and size as a series of their own";
        return Err(ReadError::Field {
            file: first.file.clone(),
            field,
            found: "different between frames".into(),
            remedy,
        });
    }
    let [row, column] = first.orientation.ok_or_else(|| missing(first, "ImageOrientationPatient"))?;
    let [between_rows, between_columns] = first.spacing.ok_or_else(|| missing(first, "PixelSpacing"))?;
    let normal = row.cross(column).normalize();
    let mut pictures = Vec::new();
    for slice in slices {
        if slice.positions.len() != slice.frames {
            return Err(missing(slice, "ImagePositionPatient (for every frame)"));
        }
        let of = |(frame, &position): (usize, &DVec3)| Picture { slice, frame, position };
        pictures.extend(slice.positions.iter().enumerate().map(of));
    }
    pictures.sort_by(|a, b| normal.dot(a.position).total_cmp(&normal.dot(b.position)));
    let [bottom, .., top] = &pictures[..] else {
        let remedy = "give the folder of the whole series";
        return Err(series(place, format!("{} picture is no volume", pictures.len()), remedy));
    };
    let step = (top.position - bottom.position) / (pictures.len() - 1) as f64;
    let heights: Vec<f64> = pictures.iter().map(|p| normal.dot(p.position)).collect();
    let decimals = slices.iter().map(|slice| slice.decimals).max().unwrap_or(0);
    let half_digit = 0.5 * 0.1f64.powi(decimals.min(16) as i32) * normal.abs().element_sum();
    let rounded = check_gaps(place, &heights, half_digit)?;
    check_line(place, &pictures, step)?;
    let degrees = (step.dot(normal) / step.length()).clamp(-1.0, 1.0).acos().to_degrees();
    let lps = DAffine3 {
        matrix3: DMat3::from_cols(row * between_columns, column * between_rows, step),
        translation: bottom.position,
    };
    let world_from_voxel = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * lps;
    let tilt = (degrees > LEAST_TILT).then_some(Note::Tilt { degrees });
    Ok(Stack { world_from_voxel, notes: tilt.into_iter().chain(rounded).collect(), pictures })
}

/// Rejects doubled, missing and uneven slices. Heights that were rounded to the digits they are
/// written with may lie half of the last digit off an even line.
fn check_gaps(place: &Path, heights: &[f64], half_digit: f64) -> Result<Option<Note>, ReadError> {
    let mut gaps: Vec<f64> = heights.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let doubled = gaps.iter().filter(|&&gap| gap < 1e-3).count();
    if doubled > 0 {
        let found = format!("{doubled} of {} slices lie where another one lies", heights.len());
        return Err(series(
            place,
            found,
            "a folder must hold each slice once; move repeats or phases to folders of their own",
        ));
    }
    gaps.sort_by(f64::total_cmp);
    let usual = gaps[gaps.len() / 2];
    let slack = (0.02 * usual).min(0.1) + 0.01;
    let lost: f64 = gaps.iter().map(|gap| (gap / usual).round() - 1.0).sum();
    let whole = gaps.iter().all(|gap| (gap - usual * (gap / usual).round()).abs() < slack);
    let off = off_line(heights);
    let at = heights.windows(2).find(|pair| (pair[1] - pair[0] - usual).abs() >= slack);
    match at {
        None => Ok(None),
        Some(pair) if whole && lost > 0.0 => {
            let found = format!(
                "{lost} slices are missing: slices lie {usual:.3} mm apart, but {:.3} mm at height {:.3} mm",
                pair[1] - pair[0],
                pair[0]
            );
            Err(series(place, found, "export the series again, or choose a complete one"))
        }
        Some(_) if off <= half_digit * 1.001 => Ok(Some(Note::Rounded { by_mm: off })),
        Some(_) => {
            let (low, high) = (gaps[0], gaps[gaps.len() - 1]);
            let found = format!("slices lie unevenly, {low:.3} to {high:.3} mm apart");
            Err(series(place, found, "choose an evenly spaced series, or resample it where it was made"))
        }
    }
}

/// Largest distance of heights from the evenly spaced ones that fit them best.
fn off_line(heights: &[f64]) -> f64 {
    let spread = |step: f64| {
        let off = heights.iter().enumerate().map(|(n, height)| height - n as f64 * step);
        let (low, high) = off.fold((f64::MAX, f64::MIN), |(low, high), off| (low.min(off), high.max(off)));
        high - low
    };
    // The spread is convex in the step.
    let (mut low, mut high) = (0.0, heights[heights.len() - 1] - heights[0]);
    for _ in 0..100 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if spread(a) < spread(b) { high = b } else { low = a }
    }
    0.5 * spread(0.5 * (low + high))
}

/// Rejects positions off the line from the first to the last.
fn check_line(place: &Path, pictures: &[Picture], step: DVec3) -> Result<(), ReadError> {
    let off = |(n, picture): (usize, &Picture)| (pictures[0].position + n as f64 * step).distance(picture.position);
    let worst = pictures.iter().enumerate().map(off).fold(0.0, f64::max);
    match worst <= 0.02 * step.length() + 0.1 {
        true => Ok(()),
        false => {
            let found = format!("slices lie up to {worst:.2} mm beside the line through the first and the last");
            Err(series(place, found, "the folder mixes several stacks; move them to folders of their own"))
        }
    }
}

fn missing(slice: &Slice, field: &'static str) -> ReadError {
    let written = slice.wrong.iter().find(|(wrong, _)| *wrong == field);
    let (found, remedy) = match written {
        Some((_, written)) => (
            written.clone(),
            "numbers must stand there, of a direction two at right angles of length 1; correct them, or export the original series",
        ),
        None => ("missing".into(), "without it the picture has no place in the patient; export the original series"),
    };
    ReadError::Field { file: slice.file.clone(), field, found, remedy }
}

fn series(place: &Path, found: String, remedy: &'static str) -> ReadError {
    ReadError::Series { folder: place.into(), found, remedy }
}
