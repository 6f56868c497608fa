//! One part of a plan: the choice and its neighbours.

/// The choice for one part, and its neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice<T> {
    /// The chosen model.
    pub what: T,
    /// Bound of its error in this scene.
    pub error: f64,
    /// Its cost on this machine, cores (CPU seconds per second).
    pub cost: f64,
    /// Whether the error is within the scene's tolerance.
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
    /// Its cost, cores.
    pub cost: f64,
    /// Whether it runs in time.
    pub in_time: bool,
}

/// Picks from (what, error, cost, whether it runs in time).
/// Of those in time, the cheapest within the tolerance, else the most accurate. If none runs in
/// time, the cheapest. Ties go to the more accurate or cheaper one.
pub(crate) fn choose<T: Copy>(judged: impl Iterator<Item = (T, f64, f64, bool)>, tolerance: f64) -> Option<Choice<T>> {
    let all: Vec<Neighbour<T>> =
        judged.map(|(what, error, cost, in_time)| Neighbour { what, error, cost, in_time }).collect();
    let cheapest = |keep: &dyn Fn(&Neighbour<T>) -> bool| {
        let order =
            |a: &&Neighbour<T>, b: &&Neighbour<T>| (a.cost.total_cmp(&b.cost)).then(a.error.total_cmp(&b.error));
        all.iter().filter(|n| keep(n)).min_by(order).copied()
    };
    let most_accurate = |keep: &dyn Fn(&Neighbour<T>) -> bool| {
        let order =
            |a: &&Neighbour<T>, b: &&Neighbour<T>| (a.error.total_cmp(&b.error)).then(a.cost.total_cmp(&b.cost));
        all.iter().filter(|n| keep(n)).min_by(order).copied()
    };
    let taken = cheapest(&|n| n.in_time && n.error <= tolerance)
        .or_else(|| most_accurate(&|n| n.in_time))
        .or_else(|| cheapest(&|_| true))?;
    let Neighbour { what, error, cost, in_time } = taken;
    let better = cheapest(&|n| n.error < error);
    let cheaper = most_accurate(&|n| n.cost < cost);
    Some(Choice { what, error, cost, meets_tolerance: error <= tolerance, in_time, better, cheaper })
}
