//! One part of a plan: the choice and its neighbours.

use crate::TissueForce;

/// The choice for one part, and its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice<T> {
    /// The chosen model.
    pub what: T,
    /// Bound of its error in this scene.
    pub error: f64,
    /// Its force on tissue, where that was measured.
    pub force: Option<TissueForce>,
    /// Its cost on this machine, cores (CPU seconds per second).
    pub cost: f64,
    /// Whether all errors are within the scene's tolerances.
    pub meets_tolerance: bool,
    /// Whether it runs in time.
    pub in_time: bool,
    /// The cheapest alternative with a smaller error.
    pub better: Option<Neighbour<T>>,
    /// The most accurate alternative that costs less.
    pub cheaper: Option<Neighbour<T>>,
}

/// An alternative choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour<T> {
    /// The alternative model.
    pub what: T,
    /// Its error.
    pub error: f64,
    /// Its force on tissue, where that was measured.
    pub force: Option<TissueForce>,
    /// Its cost, cores.
    pub cost: f64,
    /// Whether it runs in time.
    pub in_time: bool,
}

/// Picks from what may be chosen; `over` is the worst of the errors over their tolerances.
/// Of those in time, the cheapest within the tolerance, else the most accurate. If none runs in
/// time, the cheapest. Ties go to the more accurate or cheaper one.
pub(crate) fn choose<T: Copy>(
    all: impl Iterator<Item = Neighbour<T>>,
    over: impl Fn(&Neighbour<T>) -> f64,
) -> Option<Choice<T>> {
    let all: Vec<(Neighbour<T>, f64)> = all.map(|n| (n, over(&n))).collect();
    let least = |keep: &dyn Fn(&Neighbour<T>, f64) -> bool, key: fn(&Neighbour<T>, f64) -> [f64; 2]| {
        let order = |a: &&(Neighbour<T>, f64), b: &&(Neighbour<T>, f64)| {
            let (a, b) = (key(&a.0, a.1), key(&b.0, b.1));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
        };
        all.iter().filter(|(n, over)| keep(n, *over)).min_by(order).copied()
    };
    let cheapest = |keep: &dyn Fn(&Neighbour<T>, f64) -> bool| least(keep, |n, over| [n.cost, over]);
    let most_accurate = |keep: &dyn Fn(&Neighbour<T>, f64) -> bool| least(keep, |n, over| [over, n.cost]);
    let (taken, worst) = cheapest(&|n, over| n.in_time && over <= 1.0)
        .or_else(|| most_accurate(&|n, _| n.in_time))
        .or_else(|| cheapest(&|_, _| true))?;
    let Neighbour { what, error, force, cost, in_time } = taken;
    let better = cheapest(&|_, over| over < worst).map(|(n, _)| n);
    let cheaper = most_accurate(&|n, _| n.cost < cost).map(|(n, _)| n);
    Some(Choice { what, error, force, cost, meets_tolerance: worst <= 1.0, in_time, better, cheaper })
}
