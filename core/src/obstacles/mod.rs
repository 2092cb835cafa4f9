//! obstacles.
