//! What bone costs by its density, from the law's documentation alone.

use crate::removal::RemovalLaw;
use trepan_measurements::skull;
use trepan_volume::AIR_HU;

/// Density at which a volume costs 1, HU.
const REFERENCE_HU: f64 = skull::DENSITY_OF_REFERENCE.value;
/// Borders of the dental classes D3 and D1, HU. Between them the energy for a HU rises from that
/// of cancellous to that of cortical bone.
const RISES_HU: [f64; 2] = [skull::DENSITY_CANCELLOUS.value, skull::DENSITY_CORTICAL.value];

/// Price of a volume of `hu`: `∫ m(hu) dhu` from air, over the same at the reference density.
pub fn price(law: &RemovalLaw, hu: f64) -> f64 {
    let RemovalLaw::Rate { cancellous_share, .. } = *law else { return 1.0 };
    let least = f64::from(cancellous_share);
    let m = |hu: f64| {
        let rise = ((hu - RISES_HU[0]) / (RISES_HU[1] - RISES_HU[0])).clamp(0.0, 1.0);
        least + rise * (1.0 - least)
    };
    // Between its corners m is straight: there the trapezoid is the integral.
    let to = |hu: f64| {
        let air = f64::from(AIR_HU);
        let ends = [air, RISES_HU[0], RISES_HU[1], f64::INFINITY].map(|end: f64| end.min(hu).max(air));
        ends.windows(2).map(|e| 0.5 * (m(e[0]) + m(e[1])) * (e[1] - e[0])).sum::<f64>()
    };
    to(hu) / to(REFERENCE_HU)
}
