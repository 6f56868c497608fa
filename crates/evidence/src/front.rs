//! Pareto front: the rows that no other row beats in both cost and error.

use crate::row::Row;

/// Change of a time within which two runs count as equal, as a share.
pub const SPREAD: f64 = 0.15;

/// Number of rows of a scene that beat a method's row in both metrics, in cost by more than the
/// spread of two runs. Rows with a missing or non-finite metric are ignored.
pub fn dominated(rows: &[Row], scene: &str, method: &str, cost: &str, error: &str) -> usize {
    let value = |row: &Row, name: &str| row.metrics.get(name).copied().filter(|v| v.is_finite());
    let pair = |row: &Row| Some((value(row, cost)?, value(row, error)?));
    let in_scene = || rows.iter().filter(|row| row.scene == scene);
    let Some(own) = in_scene().find(|row| row.method == method).and_then(pair) else { return usize::MAX };
    in_scene()
        .filter(|row| row.method != method)
        .filter_map(pair)
        .filter(|other| other.0 < own.0 * (1.0 - SPREAD) && other.1 < own.1)
        .count()
}

/// Indices of the points (cost, error) that no other point beats in both, cheapest first. Points
/// with a non-finite value are left out.
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let beaten = |p: &(f64, f64)| points.iter().any(|q| (q.0 < p.0 && q.1 <= p.1) || (q.0 <= p.0 && q.1 < p.1));
    let known = |p: &(f64, f64)| !p.0.is_nan() && !p.1.is_nan();
    let mut best: Vec<usize> = (0..points.len()).filter(|&i| known(&points[i]) && !beaten(&points[i])).collect();
    best.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0));
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_the_points_that_no_other_beats() {
        let points = [(1.0, 9.0), (2.0, 4.0), (3.0, 5.0), (4.0, 1.0), (4.5, 1.0)];
        assert_eq!(front(&points), [0, 1, 3]);
        assert_eq!(front(&[(0.5, f64::NAN), (1.0, 9.0)]), [1]);
        let rows: Vec<Row> = points
            .iter()
            .enumerate()
            .map(|(i, p)| Row::new("s", i.to_string()).metric("c", p.0).metric("e", p.1))
            .collect();
        assert_eq!(dominated(&rows, "s", "2", "c", "e"), 1);
        assert_eq!(dominated(&rows, "s", "3", "c", "e"), 0);
        assert_eq!(dominated(&rows, "s", "none", "c", "e"), usize::MAX);
    }
}
