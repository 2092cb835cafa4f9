//! Pictures of a wanted size: cropped from the middle of the bottom edge, or laid side by side where they are too small.

/// How pictures of one size become pictures of another. Each is repeated as often as it takes to fill the wanted size, from the upper
/// left, and then cropped from the middle of the bottom edge: what is near the robot lies down there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fit {
    given: (usize, usize),
    wanted: (usize, usize),
    /// First column and row that are taken of the repeated pictures.
    first: (usize, usize),
}

impl Fit {
    /// From pictures of width and height `given`, which are not 0, to pictures of `wanted`.
    pub(super) const fn new(given: (u32, u32), wanted: (u32, u32)) -> Self {
        let (given, wanted) = ((given.0 as usize, given.1 as usize), (wanted.0 as usize, wanted.1 as usize));
        let repeated = (wanted.0.next_multiple_of(given.0), wanted.1.next_multiple_of(given.1));
        Self { given, wanted, first: ((repeated.0 - wanted.0) / 2, repeated.1 - wanted.1) }
    }

    /// The picture of the wanted size.
    pub(super) fn picture(&self, pixels: &[u8]) -> Vec<u8> {
        let (width, height) = self.given;
        let (columns, rows) = self.wanted;
        let row = |y: usize| &pixels[(self.first.1 + y) % height * width..][..width];
        let column = |x: usize| (self.first.0 + x) % width;
        (0..rows).flat_map(|y| (0..columns).map(move |x| row(y)[column(x)])).collect()
    }

    /// Where a place of the given picture lies in the wanted one, in the repetition that is in the middle of the bottom edge.
    pub(super) fn place(&self, (x, y): (f32, f32)) -> (f32, f32) {
        let repetition = (self.first.0 + self.wanted.0 / 2) / self.given.0;
        let right = (repetition * self.given.0) as f32 - self.first.0 as f32;
        let below = (self.first.1 + self.wanted.1 - self.given.1) as f32 - self.first.1 as f32;
        (x + right, y + below)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels that say where they come from.
    fn numbered(width: u32, height: u32) -> Vec<u8> {
        (0..height).flat_map(|y| (0..width).map(move |x| (16 * y + x) as u8)).collect()
    }

    #[test]
    fn crops_the_middle_of_the_bottom_edge() {
        let fit = Fit::new((6, 4), (3, 2));
        assert_eq!(fit.picture(&numbered(6, 4)), [33, 34, 35, 49, 50, 51]);
        assert_eq!(fit.place((1.0, 2.0)), (0.0, 0.0));
        assert_eq!(Fit::new((6, 4), (6, 4)).picture(&numbered(6, 4)), numbered(6, 4));
    }

    #[test]
    fn repeats_what_is_too_small() {
        // Three repetitions of 2 px, of which the middle 5 are taken; the bottom 3 of 4 rows.
        let fit = Fit::new((2, 2), (5, 3));
        assert_eq!(fit.picture(&numbered(2, 2)), [16, 17, 16, 17, 16, 0, 1, 0, 1, 0, 16, 17, 16, 17, 16]);
        let fitted = fit.picture(&numbered(2, 2));
        let (x, y) = fit.place((0.0, 0.0));
        assert_eq!((x, y), (2.0, 1.0));
        assert_eq!(fitted[y as usize * 5 + x as usize], 0, "the first pixel of the repetition in the middle");
    }
}
