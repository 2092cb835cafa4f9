//! Disparity pictures: a fixed-point disparity for a pixel, or the reason why it has none.

use fixed::{FixedU16, types::extra::U4};

use crate::arch::{self, Chosen, Steps};

/// Disparity in pixels of the left picture, `x_left - x_right`, with 4 fraction bits: steps of 1/16 px.
pub type Disparity = FixedU16<U4>;

/// Steps of [`Disparity`] in one pixel.
pub const STEPS_PER_PIXEL: u16 = 16;

/// Why a pixel has no disparity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Reason {
    /// The window does not lie wholly in the valid area of both rectified pictures.
    OutsideValidArea = 0,
    /// Too little texture under the window to tell one place from another.
    LowTexture = 1,
    /// Another place along the row fits nearly as well.
    NotUnique = 2,
    /// The match from right to left leads to another pixel.
    LeftRightMismatch = 3,
    /// Part of a contiguous surface that is too small to be believed.
    SmallSurface = 4,
    /// The window is over- or underexposed.
    Saturated = 5,
    /// The best match lies at an end of the disparity range: the true one may lie beyond.
    OutOfRange = 6,
}

impl Reason {
    /// Every reason, in the order of its code.
    pub const ALL: [Self; 7] = [
        Self::OutsideValidArea,
        Self::LowTexture,
        Self::NotUnique,
        Self::LeftRightMismatch,
        Self::SmallSurface,
        Self::Saturated,
        Self::OutOfRange,
    ];

    /// Name as it is written in summaries and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OutsideValidArea => "outside_valid_area",
            Self::LowTexture => "low_texture",
            Self::NotUnique => "not_unique",
            Self::LeftRightMismatch => "left_right_mismatch",
            Self::SmallSurface => "small_surface",
            Self::Saturated => "saturated",
            Self::OutOfRange => "out_of_range",
        }
    }
}

/// One pixel of a disparity picture: a disparity above zero, or a [`Reason`], in 16 bits.
///
/// Any 16 bits are a valid pixel: values from `0x8000` up carry a reason (unknown codes read as
/// [`Reason::OutsideValidArea`]), zero reads as [`Reason::OutOfRange`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(transparent)]
pub struct DisparityPixel(u16);

const REASON_FLAG: u16 = 0x8000;

impl DisparityPixel {
    /// A pixel with a disparity of `steps` sixteenths of a pixel; out of range for 0 and from `0x8000` up.
    pub const fn from_steps(steps: u16) -> Self {
        if steps == 0 || steps >= REASON_FLAG { Self::none(Reason::OutOfRange) } else { Self(steps) }
    }

    /// A pixel without a disparity.
    pub const fn none(reason: Reason) -> Self {
        Self(REASON_FLAG | reason as u16)
    }

    /// Takes the bits as they are.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The bits as they are stored.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Whether there is a disparity.
    pub const fn has_value(self) -> bool {
        self.0 != 0 && self.0 < REASON_FLAG
    }

    /// The disparity in sixteenths of a pixel, 0 if there is none.
    pub const fn steps(self) -> u16 {
        if self.has_value() { self.0 } else { 0 }
    }

    /// The disparity, or why there is none.
    ///
    /// # Errors
    /// The [`Reason`] of a pixel without a disparity.
    pub fn get(self) -> Result<Disparity, Reason> {
        if self.has_value() {
            return Ok(Disparity::from_bits(self.0));
        }
        if self.0 == 0 {
            return Err(Reason::OutOfRange);
        }
        let code = usize::from(self.0 & !REASON_FLAG);
        Err(*Reason::ALL.get(code).unwrap_or(&Reason::OutsideValidArea))
    }
}

/// A view of a disparity picture, rows without gaps from the top.
#[derive(Clone, Copy, Debug)]
pub struct DisparityPicture<'a> {
    pixels: &'a [DisparityPixel],
    width: usize,
    height: usize,
}

impl<'a> DisparityPicture<'a> {
    /// Sees `pixels` as rows of `width`. Pixels that do not fill a row are left out.
    pub const fn new(pixels: &'a [DisparityPixel], width: usize) -> Self {
        let height = match pixels.len().checked_div(width) {
            Some(height) => height,
            None => 0,
        };
        match pixels.split_at_checked(width.saturating_mul(height)) {
            Some((pixels, _rest)) => Self { pixels, width, height },
            // Cannot be: the height is what the pixels have room for.
            None => Self { pixels: &[], width, height: 0 },
        }
    }

    /// Width in pixels.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Row `y` from the top; empty below the picture.
    pub fn row(&self, y: usize) -> &'a [DisparityPixel] {
        let start = y.saturating_mul(self.width);
        self.pixels.get(start..start.saturating_add(self.width)).unwrap_or_default()
    }

    /// Pixels with a disparity, and those without, by [`Reason`].
    ///
    /// # Bound
    /// Eight comparisons for each pixel, many side by side.
    pub(crate) fn counts(&self, chosen: Chosen) -> (u32, [u32; Reason::ALL.len()]) {
        let mut counts = Default::default();
        arch::compiled(chosen, Count { picture: self, counts: &mut counts });
        counts
    }

    #[inline(always)]
    fn count(&self) -> (u32, [u32; Reason::ALL.len()]) {
        let mut with = 0u32;
        let mut without = [0u32; Reason::ALL.len()];
        // In short pieces counts fit 16 bits, as wide as the pixels.
        for piece in self.pixels.chunks(4096) {
            let has_value = how_many(piece, |pixel| pixel.has_value());
            // No count exceeds that of the pixels of a picture, which is less than 2^32.
            with = with.wrapping_add(has_value);
            let mut known = has_value;
            for (without, reason) in without.iter_mut().zip(Reason::ALL).skip(1) {
                let said = how_many(piece, |pixel| pixel == DisparityPixel::none(reason));
                *without = without.wrapping_add(said);
                known = known.wrapping_add(said);
            }
            let zero = how_many(piece, |pixel| pixel.bits() == 0);
            let outside = (piece.len() as u32).saturating_sub(known.wrapping_add(zero));
            for (reason, said) in [(Reason::OutOfRange, zero), (Reason::OutsideValidArea, outside)] {
                without[reason as usize] = without[reason as usize].wrapping_add(said);
            }
        }
        (with, without)
    }

    /// All pixels, row by row.
    pub const fn pixels(&self) -> &'a [DisparityPixel] {
        self.pixels
    }
}

/// Counts pixels with the instructions of a backend.
struct Count<'a> {
    picture: &'a DisparityPicture<'a>,
    counts: &'a mut (u32, [u32; Reason::ALL.len()]),
}

impl Steps for Count<'_> {
    #[inline(always)]
    fn run(self) {
        *self.counts = self.picture.count();
    }
}

/// How many of up to 2^16 - 1 pixels are as asked.
#[inline(always)]
fn how_many(pixels: &[DisparityPixel], is_so: impl Fn(DisparityPixel) -> bool) -> u32 {
    u32::from(pixels.iter().fold(0u16, |count, &pixel| count.wrapping_add(u16::from(is_so(pixel)))))
}

#[cfg(test)]
#[path = "disparity_tests.rs"]
mod tests;
