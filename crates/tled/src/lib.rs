//! Total Lagrangian Explicit Dynamics for soft tissue
