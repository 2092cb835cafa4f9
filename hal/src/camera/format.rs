//! How a driver lays the pixels of a picture out in memory.

use serde::{Deserialize, Serialize};

use super::pixels::PixelError;

/// A pixel format that pictures are taken from. The names are those of the Linux kernel's documentation ("Image Formats").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum PixelFormat {
    /// 8 bits of grey.
    Grey,
    /// 10 bits of grey in 16-bit words, little endian.
    Y10,
    /// 12 bits of grey in 16-bit words, little endian.
    Y12,
    /// 16 bits of grey, little endian.
    Y16,
    /// Colour, Y U Y V: every other byte is grey.
    Yuyv,
    /// Colour, U Y V Y: every other byte is grey.
    Uyvy,
    /// Colour in planes: a picture of grey, then one of colours.
    Nv12,
    /// JPEG, a picture at a time.
    Mjpg,
}

impl PixelFormat {
    /// Every format, the most welcome first: what can be lent before what must be copied, more bits before fewer, and what
    /// was compressed with loss last.
    pub const ALL: [Self; 8] =
        [Self::Grey, Self::Nv12, Self::Y16, Self::Y12, Self::Y10, Self::Yuyv, Self::Uyvy, Self::Mjpg];

    /// The name in configuration files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Grey => "GREY",
            Self::Y10 => "Y10",
            Self::Y12 => "Y12",
            Self::Y16 => "Y16",
            Self::Yuyv => "YUYV",
            Self::Uyvy => "UYVY",
            Self::Nv12 => "NV12",
            Self::Mjpg => "MJPG",
        }
    }

    /// The four characters that V4L2 knows it by.
    pub const fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Grey => *b"GREY",
            Self::Y10 => *b"Y10 ",
            Self::Y12 => *b"Y12 ",
            Self::Y16 => *b"Y16 ",
            Self::Yuyv => *b"YUYV",
            Self::Uyvy => *b"UYVY",
            Self::Nv12 => *b"NV12",
            Self::Mjpg => *b"MJPG",
        }
    }

    /// The format with these four characters, if it is one of ours. `JPEG` is `MJPG` under the name that a few drivers give it.
    pub fn from_fourcc(fourcc: [u8; 4]) -> Option<Self> {
        let known = Self::ALL.into_iter().find(|format| format.fourcc() == fourcc);
        known.or((fourcc == *b"JPEG").then_some(Self::Mjpg))
    }

    /// Whether the driver's own memory can be lent: its grey values lie one after another.
    pub const fn is_lent(self) -> bool {
        matches!(self, Self::Grey | Self::Nv12)
    }

    /// Whether two pixels share their colour, so that the width must be even (and the height too, of `NV12`).
    pub const fn is_subsampled(self) -> bool {
        matches!(self, Self::Yuyv | Self::Uyvy | Self::Nv12)
    }

    /// Fewest bytes of a row of `width` pixels; 0 for JPEG, which has no rows.
    pub const fn row_bytes(self, width: usize) -> usize {
        match self {
            Self::Grey | Self::Nv12 => width,
            Self::Y10 | Self::Y12 | Self::Y16 => width.saturating_mul(2),
            // A pair of pixels is never cut apart.
            Self::Yuyv | Self::Uyvy => width.div_ceil(2).saturating_mul(4),
            Self::Mjpg => 0,
        }
    }

    /// Fewest bytes that hold the grey values of `height` rows of `width` pixels, `stride` bytes apart; 1 for JPEG.
    ///
    /// # Errors
    /// When there are no pixels, or rows overlap.
    pub const fn needed_bytes(self, width: usize, height: usize, stride: usize) -> Result<usize, PixelError> {
        if width == 0 || height == 0 {
            return Err(PixelError::NoPixels);
        }
        let row = self.row_bytes(width);
        if row == 0 {
            return Ok(1);
        }
        if stride < row {
            return Err(PixelError::StrideTooShort { stride, needed: row });
        }
        Ok(height.saturating_sub(1).saturating_mul(stride).saturating_add(row))
    }
}

impl core::fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_files_and_fourccs_those_of_v4l2() {
        for format in PixelFormat::ALL {
            let text = serde_json::to_string(&format).unwrap();
            assert_eq!(text, format!("\"{format}\""));
            assert_eq!(serde_json::from_str::<PixelFormat>(&text).unwrap(), format);
            assert_eq!(PixelFormat::from_fourcc(format.fourcc()), Some(format));
            assert_eq!(String::from_utf8_lossy(&format.fourcc()).trim_end(), format.name());
        }
        assert_eq!(PixelFormat::from_fourcc(*b"JPEG"), Some(PixelFormat::Mjpg));
        assert_eq!(PixelFormat::from_fourcc(*b"H264"), None);
    }

    #[test]
    fn sizes() {
        use PixelFormat::*;
        // Rows of 5 pixels, 3 of them; the last row is not followed by a gap.
        for (format, row) in [(Grey, 5), (Nv12, 5), (Y10, 10), (Y12, 10), (Y16, 10), (Yuyv, 12), (Uyvy, 12)] {
            assert_eq!(format.row_bytes(5), row, "{format}");
            assert_eq!(format.needed_bytes(5, 3, row + 4), Ok(2 * (row + 4) + row), "{format}");
            assert_eq!(
                format.needed_bytes(5, 3, row - 1),
                Err(PixelError::StrideTooShort { stride: row - 1, needed: row })
            );
            assert_eq!(format.needed_bytes(0, 3, row), Err(PixelError::NoPixels));
            assert_eq!(format.needed_bytes(5, 0, row), Err(PixelError::NoPixels));
            // Sizes that no machine has saturate, they do not wrap round to a small one.
            assert_eq!(format.needed_bytes(5, usize::MAX, usize::MAX), Ok(usize::MAX));
        }
        assert_eq!(Mjpg.needed_bytes(5, 3, 0), Ok(1));
    }
}
