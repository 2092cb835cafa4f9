//! Disparity against truth.

use serde::Serialize;

use super::share;

/// Units of a disparity in a file to a pixel.
const PER_PX: usize = 256;
/// Errors that are counted by their size: all that two 16-bit values can be apart.
const SIZES: usize = 1 << 16;

/// Counts over any number of frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DisparityCounts {
    /// Pixels with truth.
    pixels: u64,
    /// Of those with a value, how many are off by how many 1/256 px; empty before the first frame.
    by_error: Vec<u64>,
}

/// What the disparity is worth. The names are those of the field's scripts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DisparityScore {
    /// Pixels with truth.
    pub pixels: u64,
    /// Share of them that have a value.
    pub density: f64,
    /// Share of those with a value that are off by more than 1 px.
    pub bad1: f64,
    /// Share of those with a value that are off by more than 3 px.
    pub bad3: f64,
    /// Share of the pixels with truth that have a value within 3 px: density and accuracy in one figure.
    pub good3: f64,
    /// Median error, px; `None` if no pixel has a value.
    pub median: Option<f64>,
}

impl DisparityCounts {
    /// Counts a frame: `truth` and `found` in 1/256 px, row by row, 0 where there is none; `sizes` are width and height of both.
    ///
    /// # Errors
    /// A sentence, where the pictures have different sizes.
    ///
    /// # Bound
    /// One look at each pixel.
    pub fn frame(
        &mut self,
        number: u32,
        truth: &[u16],
        found: &[u16],
        sizes: [(usize, usize); 2],
    ) -> Result<(), String> {
        let [(width, height), (found_width, found_height)] = sizes;
        if sizes[0] != sizes[1] {
            return Err(format!(
                "frame {number}: the true disparity is {width} x {height}, the picture {found_width} x {found_height}; give \
                 truth of the left picture after rectification"
            ));
        }
        self.by_error.resize(SIZES, 0);
        for (truth, found) in truth.iter().zip(found).filter(|(truth, _)| **truth > 0) {
            self.pixels += 1;
            if *found > 0
                && let Some(count) = self.by_error.get_mut(usize::from(truth.abs_diff(*found)))
            {
                *count += 1;
            }
        }
        Ok(())
    }

    /// The figures; `None` without a frame.
    pub fn score(&self) -> Option<DisparityScore> {
        let have = self.by_error.iter().sum();
        let above = |px: usize| self.by_error.iter().skip(px * PER_PX + 1).sum::<u64>();
        (!self.by_error.is_empty()).then(|| DisparityScore {
            pixels: self.pixels,
            density: share(have, self.pixels),
            bad1: share(above(1), have),
            bad3: share(above(3), have),
            good3: share(have - above(3), self.pixels),
            median: self.median(have),
        })
    }

    /// The middle error, or the mean of the two in the middle.
    fn median(&self, have: u64) -> Option<f64> {
        let ranked = |rank: u64| {
            let mut before = 0;
            self.by_error.iter().position(|count| {
                before += count;
                before > rank
            })
        };
        let (low, high) = (ranked(have.checked_sub(1)? / 2)?, ranked(have / 2)?);
        Some((low + high) as f64 / (2 * PER_PX) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(pairs: &[(u16, u16)]) -> DisparityScore {
        let (truth, found): (Vec<u16>, Vec<u16>) = pairs.iter().copied().unzip();
        let mut counts = DisparityCounts::default();
        counts.frame(0, &truth, &found, [(pairs.len(), 1); 2]).unwrap();
        counts.score().unwrap()
    }

    #[test]
    fn limits_themselves_are_good() {
        let score = score(&[(2560, 2560), (2560, 2816), (2560, 2817), (2560, 3328), (2560, 1791), (2560, 0), (0, 500)]);
        assert_eq!(score.pixels, 6, "where there is no truth nothing is judged");
        assert_eq!((score.density, score.bad1, score.bad3), (5.0 / 6.0, 3.0 / 5.0, 1.0 / 5.0));
        assert_eq!((score.good3, score.median), (4.0 / 6.0, Some(257.0 / 256.0)));
    }

    #[test]
    fn the_median_of_an_even_number_lies_between_two() {
        assert_eq!(score(&[(100, 100), (100, 101)]).median, Some(0.5 / 256.0));
        assert_eq!(score(&[(100, 101), (100, 101), (100, 90), (1, 60000)]).median, Some(5.5 / 256.0));
        assert_eq!(score(&[(100, 0)]).median, None);
        assert_eq!(score(&[(100, 0)]).bad3, 0.0);
    }

    #[test]
    fn frames_add_up_and_sizes_must_agree() {
        let mut counts = DisparityCounts::default();
        assert_eq!(counts.score(), None);
        counts.frame(0, &[256], &[256], [(1, 1); 2]).unwrap();
        counts.frame(1, &[256], &[2560], [(1, 1); 2]).unwrap();
        assert!(counts.frame(2, &[256; 2], &[2560], [(2, 1), (1, 1)]).unwrap_err().contains("frame 2"));
        let score = counts.score().unwrap();
        assert_eq!((score.pixels, score.bad3), (2, 0.5));
    }
}
