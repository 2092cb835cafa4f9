//! From what a driver delivers to 8-bit grey.

/// Why the bytes of a driver are no picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PixelError {
    /// Width or height is zero.
    NoPixels,
    /// Rows overlap.
    StrideTooShort {
        /// Bytes from row to row.
        stride: usize,
        /// Bytes of a row.
        needed: usize,
    },
}

impl core::fmt::Display for PixelError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoPixels => write!(f, "the picture has no pixels"),
            Self::StrideTooShort { stride, needed } => {
                write!(f, "rows are {stride} bytes apart, but take {needed} bytes each")
            }
        }
    }
}

impl core::error::Error for PixelError {}
