//! From what a driver delivers to 8-bit grey.
//!
//! `GREY` and the first plane of `NV12` are grey already and lent as they lie in the driver's memory. Everything else is
//! written once, into a buffer that was allocated at the start.

mod jpeg;

use fencepost_core::picture::{Picture, PictureError};

use super::format::PixelFormat;
use super::settings::PackedLayout;
use jpeg::JpegPictures;

/// Makes grey pictures of a camera's buffers.
#[derive(Clone, Debug)]
pub struct Unpacker {
    format: PixelFormat,
    width: usize,
    height: usize,
    stride: usize,
    grey: Vec<u8>,
    jpeg: Option<JpegPictures>,
}

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
    /// Width or height cannot be halved, so that no two pictures can lie in it.
    NotHalved {
        /// The width or the height, px.
        length: usize,
    },
    /// Fewer bytes than the picture needs.
    TooShort {
        /// Bytes there.
        found: usize,
        /// Bytes needed.
        needed: usize,
    },
    /// A JPEG picture that cannot be decoded, or not to its end; says what the decoder says.
    Jpeg(String),
    /// A JPEG picture of another size.
    JpegSize {
        /// Width and height found, px.
        found: (usize, usize),
        /// Width and height wanted, px.
        wanted: (usize, usize),
    },
}

impl Unpacker {
    /// For pictures of `width` by `height` pixels whose rows lie `stride` bytes apart; 0 where the driver does not say.
    ///
    /// # Errors
    /// When there are no pixels, or rows overlap.
    pub fn new(format: PixelFormat, width: usize, height: usize, stride: usize) -> Result<Self, PixelError> {
        let stride = if stride == 0 { format.row_bytes(width) } else { stride };
        format.needed_bytes(width, height, stride)?;
        let copied = if format.is_lent() { 0 } else { width.saturating_mul(height) };
        let jpeg = (format == PixelFormat::Mjpg).then(|| JpegPictures::new((width, height)));
        Ok(Self { format, width, height, stride, grey: vec![0; copied], jpeg })
    }

    /// The picture that `bytes` hold: all of them, or a buffer that goes on behind it.
    ///
    /// Nothing is allocated, except by the decoder of `MJPG`, which allocates a few rows and its tables for each picture.
    ///
    /// # Errors
    /// When there are too few bytes, or they are no JPEG picture of this size.
    ///
    /// # Bound
    /// One pass over `width * height` pixels; none for formats that are lent.
    pub fn picture<'a>(&'a mut self, bytes: &'a [u8]) -> Result<Picture<'a>, PixelError> {
        let needed = self.format.needed_bytes(self.width, self.height, self.stride)?;
        if bytes.len() < needed {
            return Err(PixelError::TooShort { found: bytes.len(), needed });
        }
        match self.format {
            PixelFormat::Grey | PixelFormat::Nv12 => {
                return Ok(Picture::new(bytes, self.width, self.height, self.stride)?);
            }
            PixelFormat::Y10 => self.unpack(bytes, |low, high| high << 6 | low >> 2),
            PixelFormat::Y12 => self.unpack(bytes, |low, high| high << 4 | low >> 4),
            PixelFormat::Y16 => self.unpack(bytes, |_, high| high),
            PixelFormat::Yuyv => self.unpack(bytes, |luma, _| luma),
            PixelFormat::Uyvy => self.unpack(bytes, |_, luma| luma),
            PixelFormat::Mjpg => {
                if let Some(jpeg) = &mut self.jpeg {
                    jpeg.decode(bytes, &mut self.grey)?;
                }
            }
        }
        Ok(Picture::packed(&self.grey, self.width, self.height)?)
    }

    /// Makes a grey value of each two bytes.
    fn unpack(&mut self, bytes: &[u8], grey: impl Fn(u8, u8) -> u8) {
        for (row, from) in self.grey.chunks_exact_mut(self.width).zip(bytes.chunks(self.stride)) {
            for (pixel, pair) in row.iter_mut().zip(from.chunks_exact(2)) {
                if let [first, second] = pair {
                    *pixel = grey(*first, *second);
                }
            }
        }
    }
}

/// The left and the right picture of one that holds both.
///
/// # Errors
/// When it cannot be halved.
pub fn split(both: Picture<'_>, layout: PackedLayout) -> Result<(Picture<'_>, Picture<'_>), PixelError> {
    let (width, height, stride) = (both.width(), both.height(), both.stride());
    let (length, half, start) = match layout {
        PackedLayout::SideBySide => (width, (width / 2, height), width / 2),
        PackedLayout::TopBottom => (height, (width, height / 2), height / 2 * stride),
    };
    if length < 2 || !length.is_multiple_of(2) {
        return Err(PixelError::NotHalved { length });
    }
    let right = both.data().get(start..).unwrap_or_default();
    Ok((Picture::new(both.data(), half.0, half.1, stride)?, Picture::new(right, half.0, half.1, stride)?))
}

impl From<PictureError> for PixelError {
    fn from(error: PictureError) -> Self {
        match error {
            PictureError::Empty => Self::NoPixels,
            PictureError::StrideTooShort => Self::StrideTooShort { stride: 0, needed: 0 },
            PictureError::Truncated { needed, found } => Self::TooShort { found, needed },
        }
    }
}

impl core::fmt::Display for PixelError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoPixels => write!(f, "the picture has no pixels"),
            Self::StrideTooShort { stride, needed } => {
                write!(f, "rows are {stride} bytes apart, but take {needed} bytes each")
            }
            Self::NotHalved { length } => write!(f, "{length} px cannot be halved into two pictures"),
            Self::TooShort { found, needed } => write!(f, "{found} of {needed} bytes have come"),
            Self::Jpeg(reason) => write!(f, "the JPEG picture cannot be decoded: {reason}"),
            Self::JpegSize { found: (fw, fh), wanted: (w, h) } => {
                write!(f, "the JPEG picture is {fw} x {fh}, not {w} x {h}")
            }
        }
    }
}

impl core::error::Error for PixelError {}

#[cfg(test)]
mod tests;
