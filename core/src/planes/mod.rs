//! planes.
