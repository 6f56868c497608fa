//! A scene whose outputs are functions of physical constants, and the ranges of those constants.

use trepan_measurements::Row;

/// Outputs of every scene.
pub const OUTPUTS: usize = 2;

/// A physical constant and how far it may be off.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    /// What it is, in words.
    pub name: &'static str,
    /// Its row of the register.
    pub row: Row,
    /// The program's value, in the unit that the scene takes.
    pub value: f64,
}

impl Input {
    /// A constant that is its row's value, in the row's unit.
    pub const fn of(name: &'static str, row: Row) -> Self {
        Self { name, row, value: row.value }
    }

    /// The value at a place between 0 and 1 of the range: `value · factor^(2 place - 1)`.
    pub fn at(&self, place: f64) -> f64 {
        self.value * self.row.factor().powf(2.0 * place - 1.0)
    }
}

/// A function of constants that runs the program's own code.
pub struct Scene {
    /// Name.
    pub name: &'static str,
    /// The constants.
    pub inputs: Vec<Input>,
    /// Names of the outputs with their units; both are positive.
    pub outputs: [&'static str; OUTPUTS],
    /// The outputs of values of the constants, in their order.
    pub run: fn(&[f64]) -> [f64; OUTPUTS],
}

impl Scene {
    /// Outputs at the values of the program.
    pub fn nominal(&self) -> [f64; OUTPUTS] {
        self.at(&vec![0.5; self.inputs.len()])
    }

    /// Outputs at places of the ranges.
    pub fn at(&self, places: &[f64]) -> [f64; OUTPUTS] {
        let values: Vec<f64> = self.inputs.iter().zip(places).map(|(input, place)| input.at(*place)).collect();
        (self.run)(&values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_runs_from_the_value_over_its_factor_to_the_value_times_it() {
        let row = Row { value: 4.0, spread: 2.0, ..trepan_measurements::brain::DENSITY };
        let input = Input::of("stiffness", row);
        for (place, value) in [(0.0, 4.0 / 1.5), (0.5, 4.0), (1.0, 6.0)] {
            assert!((input.at(place) - value).abs() < 1e-12);
        }
    }
}
