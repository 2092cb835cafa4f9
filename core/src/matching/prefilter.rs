//! What is compared: the horizontal Sobel response or plain grey values, in at most 7 bits.

use super::Prefilter;

/// Where the Sobel response is cut off, either way. Strong edges would otherwise drown the rest of the window.
pub(super) const CAP: i32 = 31;

/// Filters the middle one of three rows into `out`.
///
/// The horizontal Sobel response is an eighth of the weighted sum, cut off at +-[`CAP`] and lifted by it; grey values are
/// halved so that the sum over a window of 21 x 21 fits 16 bits. The first and last pixel have no response.
#[inline(always)]
pub(super) fn filter(kind: Prefilter, above: &[u8], middle: &[u8], below: &[u8], out: &mut [u8]) {
    match kind {
        Prefilter::Grey => {
            for (out, &grey) in out.iter_mut().zip(middle) {
                *out = grey >> 1;
            }
        }
        Prefilter::HorizontalSobel => sobel(above, middle, below, out),
    }
}

#[inline(always)]
fn sobel(above: &[u8], middle: &[u8], below: &[u8], out: &mut [u8]) {
    let n = out.len().min(above.len()).min(middle.len()).min(below.len());
    if n < 3 {
        out.fill(CAP as u8);
        return;
    }
    out[0] = CAP as u8;
    out[n - 1] = CAP as u8;
    let right = above[2..n].iter().zip(&middle[2..n]).zip(&below[2..n]);
    let left = above[..n - 2].iter().zip(&middle[..n - 2]).zip(&below[..n - 2]);
    for ((out, ((&a1, &m1), &b1)), ((&a0, &m0), &b0)) in out[1..n - 1].iter_mut().zip(right).zip(left) {
        let difference =
            (i16::from(a1) - i16::from(a0)) + 2 * (i16::from(m1) - i16::from(m0)) + (i16::from(b1) - i16::from(b0));
        *out = (difference.clamp(-CAP as i16, CAP as i16) + CAP as i16) as u8;
    }
}

/// How much a filtered pixel says about where it lies along the row.
#[inline(always)]
pub(super) fn response(kind: Prefilter, filtered: u8, before: u8) -> u8 {
    match kind {
        Prefilter::HorizontalSobel => filtered.abs_diff(CAP as u8),
        Prefilter::Grey => filtered.abs_diff(before),
    }
}
