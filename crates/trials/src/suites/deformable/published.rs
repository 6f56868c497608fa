//! What the thesis reports for its own method on its own machine of 2012, as far as its text gives
//! numbers.

use crate::engine::suite::Row;

/// Models of Tables 4.1 and 4.2: name, tetrahedra, cell, mm, and whether every step kept within 1
/// ms (Figures 4.8 and 4.12).
pub const MODELS: [(&str, usize, f64, bool); 12] = [
    ("Cube1", 1_715, 37.5, true),
    ("Cube2", 10_985, 20.0, true),
    ("Cube3", 53_240, 12.0, true),
    ("Cube4", 135_000, 8.7, false),
    ("Cube5", 320_000, 6.5, false),
    ("Cube6", 625_000, 5.2, false),
    ("Cube7", 1_080_000, 4.2, false),
    ("Brain1", 3_497, 15.5, true),
    ("Brain2", 12_511, 10.5, true),
    ("Brain3", 22_076, 8.6, false),
    ("Brain4", 40_584, 7.0, false),
    ("Brain5", 50_041, 6.4, false),
];

/// Largest change of force in a tick along its paths (Figure 4.19), N.
const FORCE_CHANGE_N: f64 = 0.8;

/// One row for each model, and one for the force.
pub fn rows() -> Vec<Row> {
    let model = |(name, tets, cell_mm, in_time): (&str, usize, f64, bool)| {
        Row::new(format!("{name}, {tets} tetrahedra"), "thesis, as published")
            .with("tets", tets)
            .with("cell_mm", cell_mm)
            .metric("within_1_ms_flag", f64::from(u8::from(in_time)))
    };
    let force = Row::new("Brain3, three paths", "thesis, as published").metric("force_change_max_n", FORCE_CHANGE_N);
    MODELS.into_iter().map(model).chain([force]).collect()
}
