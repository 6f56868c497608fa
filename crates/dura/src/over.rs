//! The sheet over a place of the brain.
//!
//! # Theory
//! A taut sheet lies on the gyri and spans the sulci: over a height field it is the lowest surface
//! that nowhere lies below the field or below the mean of its surroundings (the obstacle problem of
//! a membrane). It is found by raising each node to the mean of its six neighbours.

use std::collections::BTreeMap;
use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh};

/// Shortest edge of the sheet, mm, and edges on its radius at most, numerical.
const EDGES: (f32, f32) = (2.0, 10.0);
/// Rounds in which nodes are raised, numerical.
const ROUNDS: usize = 200;
/// How far the sheet lies above the brain, mm, numerical: none is drawn through the other.
const ABOVE_MM: f32 = 0.3;

/// A grid of triangles over the brain, relative to its middle, with its edge, mm.
pub(crate) struct Grid {
    pub middle: Vec3,
    pub rest: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    pub edge_mm: f32,
    /// Where the brain bears each node.
    pub feet: Vec<Option<Foot>>,
}

/// A point of the brain's border.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    nodes: [u32; 3],
    weights: [f32; 3],
    /// Height at rest along the outward direction, mm.
    rest_mm: f32,
}

impl Foot {
    /// How far it has moved outwards, mm; `None` without its nodes.
    pub fn risen_mm(&self, positions: &[Vec3], outward: Vec3) -> Option<f32> {
        let mut mm = -self.rest_mm;
        for (&node, weight) in self.nodes.iter().zip(self.weights) {
            mm += weight * positions.get(node as usize)?.dot(outward);
        }
        mm.is_finite().then_some(mm)
    }
}

impl Grid {
    /// Over the brain below a place, as far as a radius; `None` where no brain is.
    pub fn over(brain: &TetMesh, place: Vec3, outward: Vec3, radius_mm: f32) -> Option<Self> {
        let outward = outward.try_normalize()?;
        let (x, y) = outward.any_orthonormal_pair();
        let edge_mm = EDGES.0.max(radius_mm / EDGES.1);
        let rings = (radius_mm / edge_mm).ceil() as i32;
        let cells = (-rings..=rings).flat_map(|i| (-rings..=rings).map(move |j| (i, j)));
        let cells: Vec<(i32, i32)> = cells.filter(|(i, j)| (i + j).abs() <= rings).collect();
        let number: BTreeMap<(i32, i32), usize> = cells.iter().enumerate().map(|(n, cell)| (*cell, n)).collect();
        let flat = |&(i, j): &(i32, i32)| edge_mm * ((i as f32 + 0.5 * j as f32) * x + 0.75f32.sqrt() * j as f32 * y);
        let flats: Vec<Vec3> = cells.iter().map(flat).collect();
        let (mut heights, feet) = heights(brain, place, [x, y, outward], &flats);
        if heights.iter().all(|height| !height.is_finite()) {
            return None;
        }
        let around = |&(i, j): &(i32, i32)| {
            let three = [(1, 0), (0, 1), (1, -1)];
            three.map(|(di, dj)| [(i + di, j + dj), (i - di, j - dj)].map(|cell| number.get(&cell).copied()))
        };
        raise(&mut heights, &cells.iter().map(around).collect::<Vec<_>>());
        let middle = number[&(0, 0)];
        let base = heights[middle];
        let rest = flats.iter().zip(&heights).map(|(flat, height)| *flat + (height - base) * outward).collect();
        let corner = |cell: (i32, i32)| number.get(&cell).map(|n| *n as u32);
        let triangles = cells.iter().flat_map(|&(i, j)| {
            let pairs = [[(i + 1, j), (i, j + 1)], [(i + 1, j - 1), (i + 1, j)]];
            pairs.map(|[b, c]| Some([corner((i, j))?, corner(b)?, corner(c)?]))
        });
        let triangles = triangles.flatten().collect();
        Some(Self { middle: place + (base + ABOVE_MM) * outward, rest, triangles, edge_mm, feet })
    }
}

/// Height of the brain's border over each place of a plane, mm, and what is there; not finite where
/// there is none.
fn heights(brain: &TetMesh, place: Vec3, [x, y, up]: [Vec3; 3], flats: &[Vec3]) -> (Vec<f32>, Vec<Option<Foot>>) {
    let seen = |p: Vec3| Vec3::new((p - place).dot(x), (p - place).dot(y), (p - place).dot(up));
    let flats: Vec<Vec3> = flats.iter().map(|flat| Vec3::new(flat.dot(x), flat.dot(y), 0.0)).collect();
    let (mut heights, mut feet) = (vec![f32::NEG_INFINITY; flats.len()], vec![None; flats.len()]);
    for corners in Surface::of(brain).triangles {
        let [a, b, c] = corners.map(|n| seen(brain.positions[n as usize]));
        let double = (b - a).truncate().perp_dot((c - a).truncate());
        // Only what faces outwards can be uppermost.
        if double <= 0.0 {
            continue;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for ((flat, height), foot) in flats.iter().zip(&mut heights).zip(&mut feet) {
            if flat.x < low.x || flat.x > high.x || flat.y < low.y || flat.y > high.y {
                continue;
            }
            let share = |p: Vec3, q: Vec3| (p - *flat).truncate().perp_dot((q - *flat).truncate()) / double;
            let weights = [share(b, c), share(c, a), share(a, b)];
            let z = weights[0] * a.z + weights[1] * b.z + weights[2] * c.z;
            if weights.iter().all(|weight| *weight >= 0.0) && z > *height {
                *height = z;
                *foot = Some(Foot { nodes: corners, weights, rest_mm: z + place.dot(up) });
            }
        }
    }
    (heights, feet)
}

/// Raises each height to the mean of those neighbours that have one opposite.
///
/// Unknown heights get the mean of any neighbours, else the lowest.
fn raise(heights: &mut [f32], around: &[[[Option<usize>; 2]; 3]]) {
    for _ in 0..ROUNDS {
        for n in 0..heights.len() {
            let mean = |of: [Option<usize>; 2]| Some(0.5 * (heights[of[0]?] + heights[of[1]?]));
            let any = |of: [Option<usize>; 2]| of.into_iter().flatten().map(|m| heights[m]).find(|h| h.is_finite());
            let is_known = heights[n].is_finite();
            let found = around[n].iter().filter_map(|&pair| if is_known { mean(pair) } else { any(pair) });
            let (sum, count) = found.fold((0.0, 0.0), |(sum, count), height| (sum + height, count + 1.0));
            let raised: f32 = sum / count;
            if raised.is_finite() {
                heights[n] = heights[n].max(raised);
            }
        }
    }
    let lowest = heights.iter().copied().filter(|height| height.is_finite()).fold(f32::INFINITY, f32::min);
    heights.iter_mut().filter(|height| !height.is_finite()).for_each(|height| *height = lowest);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block with a furrow of 6 mm, 8 mm deep, along y.
    #[test]
    fn the_sheet_lies_on_the_brain_and_spans_a_furrow() {
        let (n, h) = (16usize, 2.0f32);
        let node = |x: usize, y: usize, z: usize| (x + 17 * (y + 17 * z)) as u32;
        let positions =
            (0..17 * 17 * 6).map(|k| h * Vec3::new((k % 17) as f32, (k / 17 % 17) as f32, (k / 289) as f32));
        let split = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];
        let cubes =
            (0..n * n * 5).map(|k| (k % n, k / n % n, k / n / n)).filter(|c| !(c.2 > 0 && (7..10).contains(&c.0)));
        let tets = cubes
            .flat_map(|(x, y, z)| split.map(|t| t.map(|c: usize| node(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)))));
        let mesh = TetMesh { positions: positions.collect(), tets: tets.collect() };
        let grid = Grid::over(&mesh, Vec3::new(17.0, 16.0, 30.0), Vec3::Z, 12.0).unwrap();
        assert!((grid.middle - Vec3::new(17.0, 16.0, 10.3)).length() < 0.2, "{}", grid.middle);
        assert!(grid.rest.iter().all(|p| p.z.abs() < 0.2), "flat over the furrow");
        assert_eq!((grid.edge_mm, grid.rest.len()), (2.0, 127));
        assert!(Grid::over(&mesh, Vec3::new(200.0, 16.0, 30.0), Vec3::Z, 12.0).is_none());
    }
}
