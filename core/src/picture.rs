//! Grey pictures, lent by their owner.

/// A view of an 8-bit grey picture, row by row from the top, `stride` bytes from one row to the next.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

/// Why bytes cannot be seen as a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureError {
    /// Width or height is zero.
    Empty,
    /// The stride is shorter than a row.
    StrideTooShort,
    /// Fewer bytes than the last row needs.
    Truncated {
        /// Bytes needed.
        needed: usize,
        /// Bytes there.
        found: usize,
    },
}

impl<'a> Picture<'a> {
    /// Sees `data` as `height` rows of `width` pixels, `stride` bytes apart.
    ///
    /// # Errors
    /// [`PictureError`] if the picture is empty or `data` does not hold all of its rows.
    pub const fn new(data: &'a [u8], width: usize, height: usize, stride: usize) -> Result<Self, PictureError> {
        if width == 0 || height == 0 {
            return Err(PictureError::Empty);
        }
        if stride < width {
            return Err(PictureError::StrideTooShort);
        }
        let needed = (height - 1).saturating_mul(stride).saturating_add(width);
        if data.len() < needed {
            return Err(PictureError::Truncated { needed, found: data.len() });
        }
        Ok(Self { data, width, height, stride })
    }

    /// Sees `data` as rows without gaps between them.
    ///
    /// # Errors
    /// As [`Picture::new`].
    pub const fn packed(data: &'a [u8], width: usize, height: usize) -> Result<Self, PictureError> {
        Self::new(data, width, height, width)
    }

    /// Width in pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Bytes from the start of one row to the start of the next.
    pub const fn stride(&self) -> usize {
        self.stride
    }

    /// The bytes that hold the rows, [`Picture::stride`] apart.
    pub const fn data(&self) -> &'a [u8] {
        self.data
    }

    /// Row `y` from the top, `width` pixels; the last row for any `y` below the picture.
    pub fn row(&self, y: usize) -> &'a [u8] {
        let start = y.min(self.height.saturating_sub(1)).saturating_mul(self.stride);
        self.data.get(start..start.saturating_add(self.width)).unwrap_or_default()
    }
}

impl core::fmt::Display for PictureError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => write!(f, "the picture has no pixels"),
            Self::StrideTooShort => write!(f, "the stride is shorter than a row"),
            Self::Truncated { needed, found } => write!(f, "the picture needs {needed} bytes, {found} are there"),
        }
    }
}

impl core::error::Error for PictureError {}

#[cfg(test)]
#[path = "picture_tests.rs"]
mod tests;
