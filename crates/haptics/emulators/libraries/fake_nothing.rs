//! A library without any vendor's symbols.

#[unsafe(no_mangle)]
pub extern "C" fn fake_set(_: u32, _: f64) {}
