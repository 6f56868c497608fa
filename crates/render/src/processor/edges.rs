//! Smooths the edges of a picture at rest: more rays through the pixels that differ from their
//! neighbours.
//!
//! # Theory
//! A pixel within smooth bone looks the same wherever in it a ray passes. One at an edge is the
//! mean over its area: of the 4 x 4 places of [`View::sample`](crate::View).
//!
//! # Practice
//! One place for all edges a call. Their colours are averaged as bytes, as a screen shows them. A
//! tenth of the pixels are at an edge, so all 16 places take less than two pictures.

use crate::camera::SAMPLES;

/// A numerical parameter: difference of a colour from a neighbour's at which there is an edge, of
/// 255.
const EDGE: u8 = 6;

/// The pixels at edges, and what was seen through them.
#[derive(Debug, Default)]
pub(crate) struct Edges {
    /// Indices of the pixels, ascending.
    pub pixels: Vec<usize>,
    /// Colours through the centres.
    centres: Vec<[u8; 4]>,
    sums: Vec<[u16; 3]>,
    /// Places taken.
    pub taken: usize,
}

impl Edges {
    /// Finds the edges of a picture, `width` pixels in a row.
    pub fn of(picture: &[[u8; 4]], width: usize) -> Self {
        let mut is_edge = vec![false; picture.len()];
        let differ = |a: [u8; 4], b: [u8; 4]| (0..3).any(|c| a[c].abs_diff(b[c]) >= EDGE);
        let last = width - 1;
        for at in 0..picture.len() {
            let x = at % width;
            // To the right, and to the three below; the others have met this one already.
            let near = [(x < last, at + 1), (x > 0, at + last), (true, at + width), (x < last, at + width + 1)];
            for (_, beside) in near.into_iter().filter(|(inside, beside)| *inside && *beside < picture.len()) {
                if differ(picture[at], picture[beside]) {
                    (is_edge[at], is_edge[beside]) = (true, true);
                }
            }
        }
        let pixels: Vec<usize> = (0..picture.len()).filter(|&at| is_edge[at]).collect();
        let centres = pixels.iter().map(|&at| picture[at]).collect();
        let sums = vec![[0; 3]; pixels.len()];
        Self { pixels, centres, sums, taken: 0 }
    }

    /// Adds the colours through the next places, and writes the means into a picture.
    pub fn add(&mut self, colours: &[[u8; 4]], picture: &mut [[u8; 4]]) {
        self.taken += 1;
        // Until all are there the centre is one of them.
        let with_centre = u16::from(self.taken < SAMPLES);
        let count = self.taken as u16 + with_centre;
        for (n, &at) in self.pixels.iter().enumerate() {
            for c in 0..3 {
                self.sums[n][c] += u16::from(colours[n][c]);
                let sum = self.sums[n][c] + with_centre * u16::from(self.centres[n][c]);
                picture[at][c] = ((sum + count / 2) / count) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_of_an_edge_are_found_and_averaged() {
        // White to the right of column 2.
        let mut picture: Vec<[u8; 4]> = (0..30).map(|at| if at % 6 > 2 { [255; 4] } else { [0, 0, 0, 255] }).collect();
        let mut edges = Edges::of(&picture, 6);
        assert_eq!(edges.pixels, (0..30).filter(|at| [2, 3].contains(&(at % 6))).collect::<Vec<_>>());
        assert!(Edges::of(&[[7, 9, 9, 255]; 12], 4).pixels.is_empty());
        for n in 0..SAMPLES {
            let seen = if n % 4 == 0 { [255; 4] } else { [0; 4] };
            edges.add(&vec![seen; edges.pixels.len()], &mut picture);
        }
        // A quarter of all places was white.
        assert!(picture[2][0] == 64 && picture[3][0] == 64 && picture[1][0] == 0 && picture[4][0] == 255);
    }
}
