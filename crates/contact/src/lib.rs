//! Contact manifolds, force models, the god-object and the force guard
