//! surfaces.
