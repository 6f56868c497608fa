//! The soft-tissue solver seam, materials, rival solvers and an f64 implicit reference
