//! Scenes with known truth, error measures, speed-accuracy rows and stability maps
