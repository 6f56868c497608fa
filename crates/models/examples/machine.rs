//! Prints what the default models are made of, and what a step of them costs on this machine.
//!
//! ```text
//! cargo run --release -p trepan-models --example machine [-- KEY=VALUE ...]
//! ```

use trepan_budget::Quality;
use trepan_models::Ingredients;
use trepan_models::ingredients::KEYS;
use trepan_models::measure::{Parts, machine};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut made_of = Ingredients::of(Quality::Auto);
    for word in std::env::args().skip(1) {
        let (name, value) = word.split_once('=').ok_or("give KEY=VALUE, as in element=plain")?;
        let key = KEYS.iter().find(|key| key.name == name).ok_or_else(|| format!("{name} is not a key"))?;
        key.set(&mut made_of, value)?;
    }
    let plain = Ingredients::default();
    for key in KEYS.iter().filter(|key| key.value(&made_of) != key.value(&plain)) {
        println!("{:>20} {}", key.name, key.value(&made_of));
    }
    let here = machine(Parts { bone: true, tissue: true, picture: true }, false, &made_of);
    println!("{:20.1} ns a tetrahedron and step", here.ns_per_tet_step);
    println!("{:20.1} us a haptic tick on bone", here.us_per_rigid_tick);
    println!("{:20.0} ns a ray", here.ns_per_ray);
    Ok(())
}
