//! can.
