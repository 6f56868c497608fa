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

/// Picks from what may be chosen.
/// Of those in time, the cheapest within the tolerance, else the most accurate. If none runs in
/// time, the cheapest. Ties go to the more accurate or cheaper one.
pub(crate) fn choose<T: Copy>(all: impl Iterator<Item = Neighbour<T>>, tolerance: f64) -> Option<Choice<T>> {
    let all: Vec<_> = all.collect();
    let least = |keep: &dyn Fn(&Neighbour<T>) -> bool, key: fn(&Neighbour<T>) -> [f64; 2]| {
        let order = |a: &&Neighbour<T>, b: &&Neighbour<T>| {
            let (a, b) = (key(a), key(b));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
        };
        all.iter().filter(|n| keep(n)).min_by(order).copied()
    };
    let cheapest = |keep: &dyn Fn(&Neighbour<T>) -> bool| least(keep, |n| [n.cost, n.error]);
    let most_accurate = |keep: &dyn Fn(&Neighbour<T>) -> bool| least(keep, |n| [n.error, n.cost]);
    let taken = cheapest(&|n| n.in_time && n.error <= tolerance)
        .or_else(|| most_accurate(&|n| n.in_time))
        .or_else(|| cheapest(&|_| true))?;
    let Neighbour { what, error, cost, in_time } = taken;
    let better = cheapest(&|n| n.error < error);
    let cheaper = most_accurate(&|n| n.cost < cost);
    Some(Choice { what, error, cost, meets_tolerance: error <= tolerance, in_time, better, cheaper })
}
