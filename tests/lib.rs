//! Whole-system tests of Fencepost.
