//! What is searched through: pictures, and pairs of pictures, that a few numbers describe.

use serde::{Deserialize, Serialize};

/// Numbers of a genome.
pub(super) const NUMBERS: usize = 12;

/// Numbers that a picture is made of: a pattern, and patches laid over it, each of a pattern of its own.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Genome {
    pub(super) numbers: [u32; NUMBERS],
    /// Seeds, in the order in which the patches were laid.
    pub(super) patches: Vec<u32>,
}

/// Random numbers that are the same everywhere (xorshift, Marsaglia 2003).
#[derive(Clone, Debug)]
pub(super) struct Random(u32);

impl Random {
    pub(super) fn seeded(seed: u32) -> Self {
        // Neighbouring seeds are to have nothing in common, and zero would stay zero.
        let mut random = Self(seed.wrapping_mul(0x9e37_79b1) ^ 0x5eed_0b0d | 1);
        (0..4).for_each(|_| _ = random.next());
        random
    }

    pub(super) fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    pub(super) fn below(&mut self, end: u32) -> u32 {
        self.next() % end.max(1)
    }
}

/// A number that belongs to a place.
fn scattered(x: usize, y: usize, seed: u32) -> u32 {
    let mut z = (x as u32).wrapping_mul(0x8da6_b343) ^ (y as u32).wrapping_mul(0xd816_3841) ^ seed;
    z = (z ^ z >> 15).wrapping_mul(0x2c1b_3c6d);
    z = (z ^ z >> 12).wrapping_mul(0x297a_2d39);
    z ^ z >> 15
}

impl Genome {
    /// A genome of random numbers.
    pub(super) fn random(random: &mut Random) -> Self {
        Self { numbers: core::array::from_fn(|_| random.next()), patches: Vec::new() }
    }

    /// One step from this one: a number is another, or a patch comes or goes.
    pub(super) fn changed(&self, random: &mut Random) -> Self {
        let mut changed = self.clone();
        match random.below(8) {
            0..4 => {
                let number = &mut changed.numbers[random.below(NUMBERS as u32) as usize];
                *number = match random.below(4) {
                    0 => random.next(),
                    1 => number.wrapping_add(1 + random.below(8)),
                    2 => number.wrapping_sub(1 + random.below(8)),
                    _ => *number ^ 1 << random.below(10),
                };
            }
            4 if !changed.patches.is_empty() => {
                let place = random.below(changed.patches.len() as u32) as usize;
                changed.patches.remove(place);
            }
            _ => changed.patches.push(random.next()),
        }
        changed
    }

    /// A disparity picture in 1/16 px, below `largest`; 0 is a pixel without a value.
    pub(super) fn disparities(&self, (width, height): (usize, usize), largest: u32) -> Vec<u16> {
        let pattern = Pattern::new(&self.numbers, height);
        let mut picture: Vec<u16> = (0..width * height).map(|i| pattern.steps(i % width, i / width, largest)).collect();
        for &seed in &self.patches {
            let mut random = Random::seeded(seed);
            let pattern = Pattern::new(&core::array::from_fn(|_| random.next()), height);
            let (x0, y0) = (random.below(width as u32) as usize, random.below(height as u32) as usize);
            let (across, down) = (1 + random.below(48) as usize, 1 + random.below(48) as usize);
            for y in y0..(y0 + down).min(height) {
                for x in x0..(x0 + across).min(width) {
                    picture[y * width + x] = pattern.steps(x, y, largest);
                }
            }
        }
        picture
    }

    /// Whether the cameras of the health are turned by a right angle, so that rows of the pair run across those of the pictures.
    pub(super) fn is_turned(stage: &str, numbers: &[u32; NUMBERS]) -> bool {
        stage == "health" && numbers[11] % 4 == 2
    }

    /// The pair of grey pictures that a stage begins with.
    pub(super) fn pair_of(&self, stage: &str, size: (usize, usize)) -> [Vec<u8>; 2] {
        if Self::is_turned(stage, &self.numbers) { self.turned(size) } else { self.pair(size) }
    }

    /// What turned cameras see of a pair in which hardly anything matches but what the health looks at: in the upper half there is a spot
    /// at each of its places, and in the lower half the left picture has a texture that the right one lacks. Patches are none of it.
    fn turned(&self, (width, height): (usize, usize)) -> [Vec<u8>; 2] {
        let n = self.numbers.map(|number| number as usize);
        let (across, down) = (3 + n[1] % 16, 3 + n[2] % 16);
        let amount = |x: usize, y: usize, size: usize, seed: u32, contrast: usize| {
            scattered(x / (1 + size % 8), y / (1 + size % 8), seed) as usize % (1 + contrast % 128)
        };
        let is_spot = |x: usize, y: usize| {
            let (place, strip) = (x.saturating_sub(4) * 8 / (width - 8), (y * 34 / height).div_ceil(2));
            let middle = [4 + (width - 8) * (2 * place + 1) / 16, height * strip / 17];
            2 * x.abs_diff(middle[0]) < across && 2 * y.abs_diff(middle[1]) < down
        };
        [false, true].map(|right| {
            let pixel = |i: usize| {
                // The pair's row goes down the picture, which shows seven pixels for ten of it.
                let from =
                    |place: usize, edge: usize, of: usize| (10 * place + 7 * of / 2).saturating_sub(5 * edge) / 7;
                let (x, y) = (from(height - 1 - i / width, height, width), from(i % width, width, height));
                let x = if right { x + n[4] % 48 } else { x };
                let amount = match (2 * y < height, right) {
                    (true, _) if is_spot(x, y) => amount(x, y, n[5], 1, n[3]),
                    (true, _) => amount(x, y, n[6], 2 + u32::from(right), n[8] % 16),
                    (false, false) => amount(x, y, n[6], 2, n[7]),
                    (false, true) => amount(x, y, n[6], 3, n[0] % 64),
                };
                (64 + amount) as u8
            };
            (0..width * height).map(pixel).collect()
        })
    }

    /// A pair of grey pictures: a texture in the upper part and one in the lower, shifted from left to right or not the same at all.
    pub(super) fn pair(&self, (width, height): (usize, usize)) -> [Vec<u8>; 2] {
        let n = &self.numbers;
        let border = (n[0] % 17) as usize * height / 16;
        let texture = |x: usize, y: usize, right: bool, part: &[u32]| {
            let [kind, size, contrast, shift, ..] = *part else { return 0 };
            let shift = if right { (shift % 48) as usize } else { 0 };
            let size = 1 + (size % 8) as usize;
            let (u, v) = ((x + shift) / size, y / size);
            let contrast = contrast % 128;
            let amount = match kind % 4 {
                0 => 0,
                1 => scattered(u, v, 1) % (contrast + 1),
                2 => scattered(u, v, 2 + u32::from(right)) % (contrast + 1),
                _ => (u + v) as u32 % 2 * contrast,
            };
            (64 + amount) as u8
        };
        [false, true].map(|right| {
            let mut picture: Vec<u8> = (0..width * height)
                .map(|i| {
                    let (x, y) = (i % width, i / width);
                    texture(x, y, right, if y < border { &n[1..5] } else { &n[5..9] })
                })
                .collect();
            for &seed in &self.patches {
                let mut random = Random::seeded(seed);
                let part: [u32; 4] = core::array::from_fn(|_| random.next());
                let (x0, y0) = (random.below(width as u32) as usize, random.below(height as u32) as usize);
                for y in y0..(y0 + 1 + random.below(40) as usize).min(height) {
                    for x in x0..(x0 + 40).min(width) {
                        picture[y * width + x] = texture(x, y, right, &part);
                    }
                }
            }
            picture
        })
    }
}

/// A pattern of disparities that repeats.
struct Pattern {
    height: usize,
    kind: u32,
    size: [usize; 2],
    skew: usize,
    levels: usize,
    base: u32,
    step: u32,
    slope: [i32; 2],
    noise: u32,
    holes: u32,
}

impl Pattern {
    fn new(n: &[u32; NUMBERS], height: usize) -> Self {
        Self {
            height,
            kind: n[0] % 5,
            size: [1 + (n[1] % 40) as usize, 1 + (n[2] % 40) as usize],
            skew: (n[3] % 4) as usize,
            levels: 1 + (n[4] % 6) as usize,
            base: n[5] % 1024,
            step: n[6] % 256,
            slope: [(n[7] % 33) as i32 - 16, (n[8] % 33) as i32 - 16],
            noise: 1 + n[9] % 64,
            holes: n[10] % 128,
        }
    }

    fn steps(&self, x: usize, y: usize, largest: u32) -> u16 {
        let [across, down] = self.size;
        if self.kind == 1 && self.skew == 3 {
            return (self.base + self.packed(x, y)).clamp(1, largest - 1) as u16;
        }
        let level = match self.kind {
            // Stripes, checks and steps.
            0 => (x / across + self.skew * (y / down)) % self.levels,
            // Two combs for each tile, whose teeth lie between each other; or stripes, and combs where tiles are cut off.
            1 => {
                let is_cut = y / 32 * 32 + 32 > self.height;
                let last = 31.min(self.height - 1 - y / 32 * 32);
                match y % 32 {
                    0 if is_cut || down % 2 == 1 => 0,
                    // All but a few stripes are a pixel shorter: there are too many surfaces, and some go in every tile.
                    0 if down.is_multiple_of(4) && !x.is_multiple_of(6) => 2 + x % 2,
                    row if row == last && (is_cut || down % 2 == 1) => 1,
                    _ => x / (1 + across / 16) % 2,
                }
            }
            // Blocks with a level each.
            2 => scattered(x / across, y / down, 3) as usize % self.levels,
            // A roof over each tile.
            3 => 0,
            // Blocks with a seam around each; those of one level may begin some columns to the left.
            _ => {
                let left = if self.levels == 1 { self.skew } else { 0 };
                if (x + left).is_multiple_of(across) || y.is_multiple_of(down) {
                    return 0;
                }
                (x / across + self.skew * (y / down)) % self.levels
            }
        };
        if self.holes < 64 && scattered(x, y, 4) % 128 < self.holes {
            return 0;
        }
        let along = if self.kind == 3 { y % 32 } else { y };
        let sloped = (self.slope[0] * x as i32 + self.slope[1] * along as i32) / 8;
        let noise = if self.noise < 32 { scattered(x, y, 5) % self.noise } else { 0 };
        let steps = self.base as i32 + self.step as i32 * level as i32 + sloped + noise as i32;
        steps.clamp(1, largest as i32 - 1) as u16
    }

    /// As many surfaces of 24 pixels as tiles hold, nearly each pixel of which is a run, and next to none of its own surface: the upper 24
    /// of each column, and below them two combs for six columns, whose teeth lie between each other. Where a tile is cut off at 16 rows,
    /// one and a half columns.
    fn packed(&self, x: usize, y: usize) -> u32 {
        let (column, row) = (x % 32, y % 32);
        let noise = scattered(x, y, 5) % (1 + self.noise % 8);
        if y / 32 * 32 + 32 <= self.height {
            let level = match row {
                0..24 => 200 * (column % 2) as u32,
                // Their backs are the first row and the last.
                _ => {
                    let is_upper = row < 31 && (row == 24 || column.is_multiple_of(2));
                    400 + 100 * (column / 6 % 2) as u32 + if is_upper { 0 } else { 50 }
                }
            };
            return level + noise;
        }
        let (three, nth) = (column / 3, column % 3);
        let (level, first) = if nth == 0 || nth == 1 && row < 8 { (0, 0) } else { (300, 8) };
        let level = level + 100 * (three % 2) as u32;
        // Steps of 16 sixteenths hang together, of 24 they do not.
        match (row == first + self.levels, nth) {
            (true, 1) => level + 19,
            (true, _) => level + 9,
            (false, 1) => level + 26 + noise,
            (false, _) => level + noise,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_genome_is_the_same_picture_every_time() {
        let mut random = Random::seeded(7);
        let mut genome = Genome::random(&mut random);
        for _ in 0..20 {
            genome = genome.changed(&mut random);
        }
        assert_eq!(genome.disparities((64, 48), 700), genome.clone().disparities((64, 48), 700));
        assert_eq!(genome.pair((64, 48)), genome.clone().pair((64, 48)));
        assert!(genome.disparities((64, 48), 700).iter().all(|&steps| steps < 700));
    }
}
