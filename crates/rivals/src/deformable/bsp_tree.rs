//! Points in a tree of planes of any direction (BSP), made anew at every step.
//!
//! Tetrahedra go down on the sides of each plane that their boxes reach.
//!
//! # Theory
//! Fuchs, Kedem and Naylor 1980: a plane cuts space in two, the halves are cut again. Here a plane
//! stands across the way from the first point of a half to its furthest, at the median.
//!
//! # When not to use it
//! For points that lie evenly: planes along the axes cost less and cut as well.
//!
//! # Sources
//! Fuchs et al. 1980, thesis 2.1.1. Liberties: their planes are those of the scene's polygons; the
//! tree is of points, since these are few and the tetrahedra many, as in `octree.rs`.

use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::{PointIndex, indexed, list_finite};
use trepan_geometry::Vec3;

/// A BSP tree of points; the plane of a range is kept at the number of its middle.
#[derive(Debug)]
pub struct BspTree {
    order: Vec<u32>,
    planes: Vec<Plane>,
}

#[derive(Clone, Copy, Debug)]
struct Plane {
    normal: Vec3,
    at: f32,
}

/// Points that are not cut apart any more.
const FEW: usize = 12;
/// Rounding of a distance along a normal, as a share of its size.
const ROUNDING: f32 = 1e-6;

impl BspTree {
    /// Room for so many points.
    pub fn new(points: usize) -> Self {
        Self { order: Vec::with_capacity(points), planes: vec![Plane { normal: Vec3::X, at: 0.0 }; points] }
    }
}

impl PointIndex for BspTree {
    fn place(&mut self, points: &[Vec3]) {
        list_finite(points, &mut self.order);
        split(&mut self.order, &mut self.planes, points);
    }

    fn visit(&self, points: &[Vec3], bounds: &Extent, mut found: impl FnMut(u32)) {
        search(&self.order, &self.planes, points, bounds, &mut found);
    }
}

fn split(range: &mut [u32], planes: &mut [Plane], points: &[Vec3]) {
    if range.len() <= FEW {
        return;
    }
    let place = |i: &u32| points[*i as usize];
    let first = place(&range[0]);
    let furthest = range
        .iter()
        .map(place)
        .fold(first, |far, p| if p.distance_squared(first) > far.distance_squared(first) { p } else { far });
    let (normal, middle) = ((furthest - first).normalize_or(Vec3::X), range.len() / 2);
    let along = |i: &u32| normal.dot(place(i));
    range.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
    planes[middle] = Plane { normal, at: along(&range[middle]) };
    let ((left, right), (left_planes, right_planes)) = (range.split_at_mut(middle), planes.split_at_mut(middle));
    split(left, left_planes, points);
    split(&mut right[1..], &mut right_planes[1..], points);
}

fn search(range: &[u32], planes: &[Plane], points: &[Vec3], bounds: &Extent, found: &mut impl FnMut(u32)) {
    let mut offer = |i: u32| {
        if bounds.contains(points[i as usize]) {
            found(i);
        }
    };
    if range.len() <= FEW {
        return range.iter().for_each(|&i| offer(i));
    }
    let middle = range.len() / 2;
    offer(range[middle]);
    let Plane { normal, at } = planes[middle];
    let (low, high) = (Vec3::from(bounds.low), Vec3::from(bounds.high));
    let (centre, reach) = (normal.dot(0.5 * (low + high)), normal.abs().dot(0.5 * (high - low)));
    let reach = reach + ROUNDING * (reach + centre.abs() + at.abs());
    if centre - reach <= at {
        search(&range[..middle], &planes[..middle], points, bounds, found);
    }
    if centre + reach >= at {
        search(&range[middle + 1..], &planes[middle + 1..], points, bounds, found);
    }
}

/// Points in the BSP tree.
pub const METHOD: Descriptor =
    Descriptor::of("bsp-tree", "Fuchs et al. 1980", |inputs| indexed(inputs, BspTree::new(inputs.points)));
