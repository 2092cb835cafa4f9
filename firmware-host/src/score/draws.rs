//! The random numbers of numpy's `default_rng`, so that a truth that is found by drawing points is the same here and there.
//!
//! numpy draws with PCG64 (O'Neill, *PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random Number
//! Generation*, HMC-CS-2014-0905), seeds it with the successor of C++'s `seed_seq` (O'Neill, *Developing a seed_seq
//! Alternative*, 2015), and bounds integers by Lemire's method (*Fast Random Integer Generation in an Interval*, ACM TOMACS
//! 2019).

use rand_pcg::{Pcg64, rand_core::Rng};

/// A stream of whole numbers.
#[derive(Clone, Debug)]
pub(super) struct Draws {
    generator: Pcg64,
    /// The upper half of the last 64 bits drawn: numbers are made of 32 bits, the lower half first.
    spare: Option<u32>,
}

impl Draws {
    /// As `numpy.random.default_rng(seed)`.
    pub(super) fn new(seed: u32) -> Self {
        let words = Seeds::new(seed).words();
        let wide = |high: usize| (u128::from(words[high]) << 64) | u128::from(words[high + 1]);
        Self { generator: Pcg64::new(wide(0), wide(2)), spare: None }
    }

    /// A whole number below `end`, each as likely as any other: numpy's `integers(0, end)`. 0 if `end` is 1 or less, without
    /// drawing.
    pub(super) fn below(&mut self, end: u32) -> u32 {
        if end <= 1 {
            return 0;
        }
        // The product's upper half is the number; lower halves below this are those that come too often.
        let threshold = (u32::MAX - (end - 1)) % end;
        loop {
            let product = u64::from(self.next()) * u64::from(end);
            let low = product as u32;
            if low >= end || low >= threshold {
                return (product >> 32) as u32;
            }
        }
    }

    fn next(&mut self) -> u32 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let drawn = self.generator.next_u64();
        self.spare = Some((drawn >> 32) as u32);
        drawn as u32
    }
}

/// Spreads a seed over a pool of four words, from which any number of words are taken.
struct Seeds {
    pool: [u32; 4],
}

/// Each word that is hashed changes the constant that hashes the next one.
struct Hash {
    constant: u32,
    factor: u32,
}

impl Hash {
    const INTO_POOL: Self = Self { constant: 0x43b0_d7e5, factor: 0x931e_8875 };
    const OUT_OF_POOL: Self = Self { constant: 0x8b51_f9dd, factor: 0x58f3_8ded };

    fn of(&mut self, word: u32) -> u32 {
        let mixed = word ^ self.constant;
        self.constant = self.constant.wrapping_mul(self.factor);
        fold(mixed.wrapping_mul(self.constant))
    }
}

impl Seeds {
    fn new(seed: u32) -> Self {
        let mut hash = Hash::INTO_POOL;
        let mut pool = [seed, 0, 0, 0].map(|word| hash.of(word));
        for from in 0..pool.len() {
            for to in (0..pool.len()).filter(|to| *to != from) {
                let hashed = hash.of(pool[from]);
                pool[to] = fold(pool[to].wrapping_mul(0xca01_f9dd).wrapping_sub(hashed.wrapping_mul(0x4973_f715)));
            }
        }
        Self { pool }
    }

    /// Four words of 64 bits, each made of two of 32, the lower one first.
    fn words(&self) -> [u64; 4] {
        let mut hash = Hash::OUT_OF_POOL;
        let mut halves = self.pool.iter().cycle().map(|word| u64::from(hash.of(*word)));
        std::array::from_fn(|_| {
            let mut half = || halves.next().unwrap_or_default();
            let low = half();
            low | (half() << 32)
        })
    }
}

const fn fold(word: u32) -> u32 {
    word ^ (word >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `numpy.random.SeedSequence(seed).generate_state(4, numpy.uint64)` of numpy 2.4.
    #[test]
    fn seeds_are_spread_as_numpy_spreads_them() {
        for (seed, words) in [
            (0, [0xdb2c_d7e7_b0f4_78be, 0xabf4_641a_2c71_ba49, 0x20c6_ed6d_9d7b_8d41, 0x2c40_99de_223c_39d4]),
            (1, [0x672d_8ee5_6d67_91ff, 0x8ae1_9ca1_4eb1_072c, 0x4915_796d_1322_fc4a, 0xd0cc_2bdc_aba0_49bd]),
            (3735928559, [0x9418_c763_2a43_b469, 0xec7a_28fc_f09d_b92e, 0x7064_c39f_2cb8_b0e2, 0x0644_5652_dc4c_09df]),
        ] {
            assert_eq!(Seeds::new(seed).words(), words, "seed {seed}");
        }
    }

    /// `numpy.random.default_rng(seed).integers(0, end, 9)` of numpy 2.4.
    #[test]
    fn numbers_are_those_of_numpy() {
        for (seed, end, numbers) in [
            (0, 7, [5, 4, 3, 1, 2, 0, 0, 0, 1]),
            (0, 18_345, [15_604, 11_685, 9_376, 4_949, 5_647, 751, 1_380, 303, 3_215]),
            (
                1,
                3_000_000_000,
                [
                    1_535_464_873,
                    2_851_391_088,
                    104_557_657,
                    2_845_948_340,
                    935_494_355,
                    2_607_075_741,
                    1_269_979_346,
                    770_976_088,
                    1_227_597_408,
                ],
            ),
            (
                0,
                4_294_967_291,
                [
                    3_653_403_226,
                    2_735_729_611,
                    2_195_314_462,
                    1_158_725_110,
                    1_322_117_302,
                    175_979_944,
                    323_153_948,
                    70_985_653,
                    752_767_290,
                ],
            ),
        ] {
            let mut draws = Draws::new(seed);
            assert_eq!([(); 9].map(|()| draws.below(end)), numbers, "seed {seed}, below {end}");
        }
    }

    #[test]
    fn nothing_is_drawn_where_there_is_no_choice() {
        let mut draws = Draws::new(0);
        assert_eq!([draws.below(0), draws.below(1)], [0, 0]);
        assert_eq!(draws.below(1000), Draws::new(0).below(1000));
    }
}
