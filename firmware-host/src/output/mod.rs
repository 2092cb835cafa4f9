//! Everything that `replay` writes for each frame.

mod files;
mod tables;

pub use files::{OutputFolder, WriteFile};
pub use tables::{CellRow, Tables};
