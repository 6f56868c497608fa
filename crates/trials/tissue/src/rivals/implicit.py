"""scikit-fem: quadratic tetrahedra, compressible neo-Hookean as in TLED, Newton's method, f64, straight to rest."""
