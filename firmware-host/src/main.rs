//! fencepost
fn main() {}
