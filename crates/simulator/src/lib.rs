//! Threads, clocks, phases, warnings, scores and reports of the three simulators
