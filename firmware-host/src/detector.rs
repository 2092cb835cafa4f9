//! The program's detector.

/// Most obstacles of a frame.
pub const OBSTACLES: usize = 128;
/// Most cells of a map.
pub const CELLS: usize = 16384;

/// Largest picture, for people.
pub fn capacity_in_words() -> String {
    "2048 x 1536 px".to_string()
}
