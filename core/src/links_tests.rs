//! Bits against the plain pixels.

use std::vec::Vec;

use super::*;
use crate::test_random::Random;

/// Pixels of few levels, with holes; sometimes any bits.
fn random_row(random: &mut Random, length: usize) -> Vec<DisparityPixel> {
    let wild = random.below(4) == 0;
    let mut pixel = || match random.below(5) {
        0 => DisparityPixel::from_bits(0x8000 | random.below(9) as u16),
        _ if wild => DisparityPixel::from_bits(random.next() as u16),
        _ => DisparityPixel::from_bits(random.below(60) as u16),
    };
    (0..length).map(|_| pixel()).collect()
}

#[test]
fn links_are_those_of_neighbouring_pixels() {
    let mut random = Random::seeded("links", 0x5eed_0200);
    for _ in 0..3000 {
        let length = random.below(100) as usize;
        let (row, other) = (random_row(&mut random, length), random_row(&mut random, length));
        let first = [0, 1, 7, 20][random.below(4) as usize];
        let values = first..[0x8000, 50][random.below(2) as usize];
        let step = random.below(40) as u16;
        for x in (0..length + 40).step_by(13) {
            let at = |row: &[DisparityPixel], x: usize| row.get(x).map_or(0, |pixel| pixel.bits());
            let here = piece(&row, x);
            assert!((0..PIECE).all(|i| here[i] == at(&row, x + i)));
            let before = x.checked_sub(1).map_or(0, |x| at(&row, x));
            let links = Links::of(&here, before, &values, step);
            for i in 0..PIECE {
                let bit = |bits: u32| bits >> i & 1 == 1;
                let (pixel, left) = (here[i], if i > 0 { here[i - 1] } else { before });
                let value = values.contains(&pixel);
                let joined = value && values.contains(&left) && pixel.abs_diff(left) <= step;
                assert_eq!((bit(links.value), bit(links.left)), (value, joined), "{pixel} after {left}, step {step}");
                assert_eq!(bit(links.starts()), value && !joined);
                let above = piece(&other, x);
                assert_eq!(bit(near(&here, &above, step)), pixel.abs_diff(above[i]) <= step);
                let [a, b] = [here, above].map(|piece| piece.map(|bits| bits as u8 & 3));
                assert_eq!(bit(same(&a, &b)), a[i] == b[i]);
                assert_eq!(bit(changes(&a)), a[i] != if i > 0 { a[i - 1] } else { 0 });
            }
        }
    }
}

#[test]
fn values_are_those_of_the_pixels() {
    for bits in 0..=u16::MAX {
        assert_eq!(VALUES.contains(&bits), DisparityPixel::from_bits(bits).has_value(), "{bits:#x}");
    }
}

#[test]
fn bits_come_one_by_one() {
    assert_eq!(each_bit(0).count(), 0);
    assert_eq!(each_bit(0x8000_0105).collect::<Vec<_>>(), [1, 4, 0x100, 0x8000_0000]);
    assert_eq!(each_bit(u32::MAX).count(), 32);
}
