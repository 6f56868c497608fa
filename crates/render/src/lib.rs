//! The picture: ray-cast skull, deforming brain, tools, shadows and slices, headless or in a window
