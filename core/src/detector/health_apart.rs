//! The health apart from the other stages, in whose rows it looks otherwise: for `fencepost-bounds`, which finds out what each stage
//! takes by itself.

use super::{Detection, Detector};
use crate::{health::Exposure, matching::ValidSpan, picture::Picture};

impl<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    /// Begins to look at a pair of pictures, as [`Self::detect`] does.
    ///
    /// # Bound
    /// The clearing of some tables.
    pub fn begin_health(&mut self, width: usize, height: usize) {
        self.content.begin(width, height, self.search_range());
    }

    /// Looks at row `y` of both rectified pictures, as [`Self::detect`] does; down to row `done` there are disparities, rows of `width`.
    ///
    /// # Bound
    /// Three passes over each of the rows, and in all of them together the matches of all strips.
    pub fn look_at_rows(&mut self, y: usize, rows: [&[u8]; 2], spans: [ValidSpan; 2], (width, done): (usize, usize)) {
        self.content.push(y, rows, spans);
        self.content.look(&self.matcher, &self.disparity, width, done);
    }

    /// Says how far what was found can be trusted, as [`Self::detect`] does; `None` before [`Self::configure`].
    ///
    /// # Bound
    /// A sixteenth of both pictures, half of the disparity picture, and the matching of a few strips.
    pub fn judge_health(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Option<&Detection<OBSTACLES, CELLS>> {
        let setup = self.setup?;
        let exposures = [Exposure::of(left), Exposure::of(right)];
        Some(self.judge(left, right, &setup, exposures))
    }
}

#[cfg(test)]
mod tests {
    use std::{string::String, vec};

    use super::{
        super::{
            Alone, Side,
            tests::{HEIGHT, Small, WIDTH, configured, good_pair, picture},
        },
        *,
    };
    use crate::disparity::DisparityPicture;

    /// What [`Detector::detect`] does, with the health apart.
    fn detect_apart(detector: &mut Small, left: &Picture<'_>, right: &Picture<'_>) {
        let setup = detector.begin(left, right).unwrap();
        detector.matcher.begin();
        detector.begin_health(WIDTH, HEIGHT);
        let mut rows = [vec![0; WIDTH], vec![0; WIDTH]];
        let mut next = 0;
        for y in 0..HEIGHT {
            let [left_row, right_row] = &mut rows;
            let left_span = ValidSpan::from(detector.rectifier.row(Side::Left, left, y, left_row));
            let right_span = ValidSpan::from(detector.rectifier.row(Side::Right, right, y, right_row));
            detector.matcher.push(left_row, right_row, left_span, right_span);
            while next < HEIGHT && detector.matcher.pull(next, &mut detector.disparity[next * WIDTH..][..WIDTH]) {
                next += 1;
            }
            detector.look_at_rows(y, [left_row, right_row], [left_span, right_span], (WIDTH, next));
        }
        detector.surface_size.run(&mut detector.disparity);
        let picture = DisparityPicture::new(&detector.disparity, WIDTH);
        detector.interpreter.run(picture, &setup, &mut detector.detection, &mut Alone, &mut ());
        detector.judge_health(left, right).unwrap();
    }

    /// All that a frame said, and the signs that the health has from the pictures.
    fn said(detector: &Small) -> String {
        std::format!("{:?} {:?}", detector.detection(), detector.content())
    }

    #[test]
    fn the_health_apart_says_what_that_of_the_whole_says() {
        let (good, other) = (good_pair(31), good_pair(32));
        let exchanged = (good.1.clone(), good.0.clone());
        let lowered = (good.0.clone(), [&good.1[3 * WIDTH..], &good.1[..3 * WIDTH]].concat());
        let covered = (good.0.clone(), vec![90; WIDTH * HEIGHT]);
        let late = (other.0.clone(), good.1.clone());
        let (mut whole, mut apart) = (configured(), configured());
        let mut told = 0;
        // Each twice, so that it is told: reasons, and what is remembered of the frames before, are those of the whole.
        for (left, right) in [&good, &other, &exchanged, &lowered, &covered, &late].map(|pair| [pair; 2]).concat() {
            let [left, right] = [left, right].map(|bytes| picture(bytes));
            whole.detect(&left, &right, &mut ()).unwrap();
            detect_apart(&mut apart, &left, &right);
            assert_eq!(said(&apart), said(&whole));
            told |= whole.detection().health.reasons;
        }
        assert!(told.count_ones() >= 4, "{told:b}");
        assert!(Small::new().judge_health(&picture(&good.0), &picture(&good.1)).is_none());
    }
}
