//! Arithmetic that the compiler makes vector instructions of.

/// Pixels that floating-point work is done for side by side. A Cortex-M has no vectors of floating-point numbers: there each pixel goes
/// by itself, and those that say nothing are passed over.
pub(crate) const LANES: usize = if cfg!(target_arch = "arm") { 1 } else { 8 };

/// Adding this to a number below 2^22 leaves its nearest whole number in the lowest bits.
const ROUNDING: f32 = (3 << 22) as f32;

/// Largest whole number not above `x`, once `x` is held between `least` and `most`, which lie within 2^22 of zero; `least` for what is
/// no number.
///
/// The conversions of the language hold each number within its range, and there is no vector instruction for that.
#[inline(always)]
pub(crate) fn floor(x: f32, least: f32, most: f32) -> i32 {
    // Written out: the library's `clamp` and `max` lead around what is no number.
    let x = if x > least { x } else { least };
    let x = if x < most { x } else { most };
    let sum = x + ROUNDING;
    let nearest = (sum.to_bits() as i32).wrapping_sub(ROUNDING.to_bits() as i32);
    nearest.wrapping_sub(i32::from(sum - ROUNDING > x))
}

#[cfg(test)]
mod tests {
    use super::floor;
    use crate::test_random::Random;

    #[test]
    fn whole_numbers_are_those_of_the_language() {
        let mut random = Random::seeded("floor", 0x5eed_0207);
        let plain = |x: f32, least: f32, most: f32| x.clamp(least, most).floor() as i32;
        let check = |x: f32| {
            for (least, most) in [(-32768.0, 32767.0), (0.0, 255.0), (0.0, 39.0)] {
                assert_eq!(floor(x, least, most), plain(x, least, most), "{x} in {least}..={most}");
            }
        };
        for x in
            [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 0.99999994, -1.0e-40, 38.999996, 4.0e6, 1.0e30, f32::INFINITY, -1.0e9]
        {
            check(x);
        }
        for _ in 0..100_000 {
            let whole = random.below(70_000) as f32 - 35_000.0;
            check(whole);
            check(f32::from_bits(whole.to_bits().wrapping_add(random.below(3)).wrapping_sub(1)));
            check(whole + random.below(1 << 16) as f32 / 65_536.0);
        }
        assert_eq!(floor(f32::NAN, -3.0, 3.0), -3);
    }
}
