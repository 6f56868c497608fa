//! Trepan's WGSL shaders as strings
