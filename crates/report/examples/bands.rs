//! Prints the band that the spread of tissue and bone leaves a force and a time, and the lessons.
//!
//! ```text
//! cargo run --release -p trepan-report --example bands [-- FORCE_N WAY_MM DEPTH_MM]
//! ```

use trepan_report::training::Lesson;
use trepan_report::uncertainty::Band;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given: Vec<f32> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let [force_n, way_mm, depth_mm] = given.try_into().unwrap_or([0.5, 4.0, 1.0]);
    let Band { value, low, high } = Band::of_tissue_force(force_n, way_mm, depth_mm);
    println!("a press with {value:.2} N: {low:.2} to {high:.2} N in tissue as soft or stiff as brains may be");
    let Band { value, low, high } = Band::of_drilling(3.0, 4.0);
    println!("{value:.1} s of drilling with 4 N: {low:.1} to {high:.1} s in bone as soft or hard as bone may be");
    for lesson in Lesson::all(None) {
        println!("lesson {}: {} steps, {} marks", lesson.title, lesson.steps.len(), lesson.marks.len());
    }
    Ok(())
}
