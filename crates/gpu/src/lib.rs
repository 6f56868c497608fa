//! A thin layer over wgpu: device, buffers, textures, kernels, passes, timing, readback
