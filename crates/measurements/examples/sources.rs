//! Prints every measured value with its source.

fn main() {
    for rows in trepan_measurements::ALL {
        for row in *rows {
            let spread = if row.spread.is_nan() { String::new() } else { format!(" ± {}", row.spread) };
            let at = if row.at.is_nan() { String::new() } else { format!(" at {}", row.at) };
            println!("{}{at}: {}{spread} {} ({}; {})", row.name(), row.value, row.unit, row.mark.name(), row.source);
        }
    }
}
