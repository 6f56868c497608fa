//! Haptic devices: scripted, replayed, mouse and simulated, all behind one guarded seam
