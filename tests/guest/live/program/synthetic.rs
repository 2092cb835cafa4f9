//! Pictures that no fault of a camera makes: what stands before the lenses is to blame, or the way they were fixed.

/// A grey picture.
pub(super) struct Pixels {
    pub(super) width: usize,
    pub(super) grey: Vec<u8>,
}

impl Pixels {
    fn rows(&mut self) -> impl DoubleEndedIterator<Item = &mut [u8]> + ExactSizeIterator {
        self.grey.chunks_exact_mut(self.width)
    }
}

/// Left and right have nothing in common: nothing matches.
pub(super) fn unlike(pair: &mut [Pixels; 2], seed: &mut u64) {
    for picture in pair {
        picture.grey.fill_with(|| noise(seed));
    }
}

/// A rough wall below the uppermost quarter, so near that left and right show it 60 px apart: more than is searched.
pub(super) fn too_near(pair: &mut [Pixels; 2], seed: &mut u64) {
    const APART_PX: usize = 60;
    let [left, right] = pair;
    let top = left.rows().len() / 4;
    for (left, right) in left.rows().zip(right.rows()).skip(top) {
        let wall: Vec<u8> = std::iter::repeat_with(|| noise(seed)).take(left.len() + APART_PX).collect();
        left.copy_from_slice(&wall[..left.len()]);
        right.copy_from_slice(&wall[APART_PX..]);
    }
}

/// The robot lies on its back, but for left and right: the same disparities, and the ground above.
pub(super) fn upside_down(pair: &mut [Pixels; 2], _: &mut u64) {
    for picture in pair {
        let rows: Vec<Vec<u8>> = picture.rows().rev().map(|row| row.to_vec()).collect();
        picture.grey = rows.concat();
    }
}

/// Upper bits of a linear congruential generator (Knuth, MMIX).
fn noise(seed: &mut u64) -> u8 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 56) as u8
}
