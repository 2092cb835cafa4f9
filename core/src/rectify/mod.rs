//! rectify.
