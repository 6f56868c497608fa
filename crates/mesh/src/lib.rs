//! Tetrahedra and triangles: topology, quality, files, and tetrahedra from a label volume
