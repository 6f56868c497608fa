//! A tool against moving tetrahedra: broad phases, narrow phase, response
