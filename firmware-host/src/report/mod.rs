//! `report.html`: one file that reads like the paper's Figure 11 and can be opened anywhere.

mod charts;
mod embedded;
mod frames;
mod page;
mod shown;
mod tables;

pub use embedded::Embedded;
pub use frames::{FramePainter, ReportFrame};
pub use page::PageInput;
pub use shown::{Painter, Shown};

pub(crate) use page::fill;

use crate::error::Failure;

/// Most frames that are shown in full.
pub const SHOWN: usize = 4;

/// The report of `replay` and `demo`.
pub type Report = Shown<FramePainter>;

impl Report {
    /// The page.
    ///
    /// # Errors
    /// When the template does not fit what it is given, which is a mistake of the program.
    pub fn page(&self, input: &PageInput<'_>) -> Result<String, Failure> {
        page::render(self.frames(), input)
    }
}
