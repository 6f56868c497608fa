//! Selective mass scaling: accelerations averaged over the elements, so that steps may be longer.
//!
//! # Theory
//! Elements of the mass `m_e` hold back motion of their corners against each other, not motion of
//! all four together:
//! ```text
//! a = M⁻¹ f     ā = P a     P = M⁻¹ Q     (Q a)_i = Σ_e m_e/4 · ¼ Σ_corners a
//! ```
//! The inverse mass `P M⁻¹` is symmetric and positive semi-definite, has the body's mass for
//! translation, and moves nothing that is at rest: equilibria are those of M. With no element's ω²
//! over Λ, `R = M - Q` bounds the stiffness, `K ≤ Λ R`, since K of an element resists differences
//! between its corners only.
//!
//! An element of a lower ω² is averaged by a share s of its mass only, `Λ s ≥ ω²`: large elements
//! hardly need it, and would slow the tissue around a moving tool. The share of one that has
//! stiffened beyond its own grows for that step (`dynamic_scaling.rs`).
//!
//! What is taken by backward Euler (contact springs, anchors) adds its stiffness C, times dt², to
//! the mass, not to Q: `ā = a - M_c⁻¹ R a`. So `R a` is a force against the nodes, and the springs
//! are taken anew beside it. With `Y = M_c - R` leapfrog is stable if
//! `dt² (K + 3 C) ≤ 4 M_c Y⁻¹ M_c = 4 (Y + 2 R + R Y⁻¹ R)`. Since `4 R Y⁻¹ R ≥ 4 R - Y`, the right
//! side less `3 dt² C` is at least `3 M + 9 R ≥ 12 R`: the stable step is √3 times as long as
//! without, whatever touches the nodes (without C: twice). Springs that share nodes are taken one
//! after the other, which this leaves out: stiff ones along one normal, on elements of half a mm,
//! turned elements over at √3 too, in three of eight pushes; those of sessions, one for each node,
//! did not in an operation on elements of that size. Errors of a choice are measured without.
//!
//! # Sources
//! L. Olovsson, K. Simonsson, M. Unosson: Selective mass scaling for explicit finite element
//! analyses, Int. J. Numer. Meth. Engng 63, 2005. A. Tkachuk, M. Bischoff: Direct and sparse
//! construction of consistent inverse mass matrices, Int. J. Numer. Meth. Engng 101, 2015.

use crate::scaling::Scaling;
use glam::Vec4;
use std::collections::BTreeMap;
use trepan_soft::Body;
use trepan_soft::simd::Layout;

/// Neighbours of every place, with the mass that they share, as rows of one list.
pub(crate) struct Averaging {
    starts: Vec<u32>,
    /// Place, and the sixteenth of the mass of the elements that both belong to, g.
    shared: Vec<(u32, f32)>,
    /// Sum of a row, g.
    total: Vec<f32>,
}

impl Averaging {
    /// Those of a body with scaled masses, the largest ω² `stiffest`, 1/ms², and a mass on each
    /// corner of each triangle of its membrane, g.
    pub fn of(
        body: &Body,
        layout: &Layout,
        (scaling, stiffest): (&Scaling, f32),
        of_membrane: impl Iterator<Item = f64>,
    ) -> Self {
        let mut rows = vec![BTreeMap::<u32, f64>::new(); layout.node_at.len()];
        for (t, tet) in body.mesh.tets.iter().enumerate() {
            let grams = f64::from(body.material(t).density_g_mm3()) * body.mesh.volume_mm3(t);
            let share = f64::from(share(scaling.omega2(t as u32), stiffest));
            let sixteenth = share * grams * scaling.factor(t as u32) / 16.0;
            let places = tet.map(|n| layout.place_of[n as usize]);
            for (a, b) in places.iter().flat_map(|a| places.iter().map(move |b| (*a, *b))).filter(|(a, b)| a != b) {
                *rows[a as usize].entry(b).or_default() += sixteenth;
            }
        }
        for (corners, grams) in body.membrane.triangles.iter().zip(of_membrane) {
            let places = corners.map(|n| layout.place_of[n as usize]);
            for (a, b) in places.iter().flat_map(|a| places.iter().map(move |b| (*a, *b))).filter(|(a, b)| a != b) {
                *rows[a as usize].entry(b).or_default() += grams / 3.0;
            }
        }
        let starts = std::iter::once(0).chain(rows.iter().scan(0, |end, row| {
            *end += row.len() as u32;
            Some(*end)
        }));
        let starts = starts.collect();
        let shared = rows.iter().flatten().map(|(&place, &grams)| (place, grams as f32)).collect();
        let total = rows.iter().map(|row| row.values().sum::<f64>() as f32).collect();
        Self { starts, shared, total }
    }

    /// `(M - Q) a` at a place, from a by place.
    #[inline(always)]
    pub fn opposed(&self, place: usize, of: impl Fn(usize) -> Vec4) -> Vec4 {
        let row = &self.shared[self.starts[place] as usize..self.starts[place + 1] as usize];
        let term = |&(other, grams): &(u32, f32)| of(other as usize) * grams;
        // Two sums, so that one addition does not wait for the other.
        let (pairs, last) = row.as_chunks::<2>();
        let [a, b] = pairs.iter().fold([Vec4::ZERO; 2], |[a, b], [x, y]| [a + term(x), b + term(y)]);
        of(place) * self.total[place] - last.iter().fold(a + b, |sum, x| sum + term(x))
    }
}

/// Stiffening that an element's share of averaging covers from the start.
const COVERED: f32 = 2.0;

/// Largest share at rest. Below 1 no motion is without mass of its own: Q is definite.
const MOST: f32 = 0.99;

/// Share of its mass by which an element is averaged, from its ω² and the largest one, 1/ms².
pub(crate) fn share(omega2: f32, stiffest: f32) -> f32 {
    (COVERED * omega2 / stiffest).min(MOST)
}

/// Cost of a step over that of one without, in a session.
pub(crate) const COST: f64 = 1.35;
/// Factor on the stable step, √3.
pub(crate) const LONGER: f32 = 1.732_050_8;
