//! A library that is none of the vendors'.

#[unsafe(no_mangle)]
pub extern "C" fn fake_set(_: u32, _: f64) {}
