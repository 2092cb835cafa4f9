//! Which pixels belong to one object, for painting each object in its own colour.

use fencepost_core::surfaces::SurfaceClass;

use crate::view::FrameView;

/// Number of an object that stands for "none".
pub(crate) const NO_OBJECT: u32 = 0;

/// Joins neighbouring pixels (left, right, above, below) of the classes that `wanted` picks, where their disparities
/// differ by `step_sixteenths` or less, over the whole picture: the paper's Figure 11 (e) and (f). Objects are numbered
/// from 1, from the top; 0 is none.
pub(crate) fn joined(view: &FrameView<'_>, step_sixteenths: u16, wanted: impl Fn(SurfaceClass) -> bool) -> Vec<u32> {
    let (width, height) = view.size();
    let mut steps = vec![0_u16; width * height];
    for y in 0..height {
        for (x, pixel) in view.disparity.row(y).iter().enumerate() {
            if pixel.has_value() && (view.surface_at)(x, y).is_some_and(|s| wanted(s.class)) {
                steps[y * width + x] = pixel.steps();
            }
        }
    }
    let mut labels = vec![NO_OBJECT; steps.len()];
    let mut next = NO_OBJECT;
    let mut open = Vec::new();
    for seed in 0..steps.len() {
        if steps[seed] == 0 || labels[seed] != NO_OBJECT {
            continue;
        }
        next += 1;
        labels[seed] = next;
        open.push(seed);
        while let Some(at) = open.pop() {
            let (x, y) = (at % width, at / width);
            let neighbours = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then_some(at + 1),
                (y > 0).then(|| at - width),
                (y + 1 < height).then_some(at + width),
            ];
            for to in neighbours.into_iter().flatten() {
                if labels[to] == NO_OBJECT && steps[to] != 0 && steps[to].abs_diff(steps[at]) <= step_sixteenths {
                    labels[to] = next;
                    open.push(to);
                }
            }
        }
    }
    labels
}
