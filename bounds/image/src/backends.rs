//! Every backend of this processor against plain Rust, on the processor itself: rows of pictures made by chance, in every width and
//! with every window that the settings allow.
//!
//! Prints `rows COUNT`, and `differs ...` at the first pixel that is not the same.
#![no_std]
#![no_main]

mod board;

use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use fencepost_core::{
    arch::Backend,
    disparity::DisparityPixel,
    matching::{MatchCost, MatchSettings, Matcher, ValidSpan},
};

const WIDTH: usize = 330;
const DISPARITIES: usize = 128;

/// Rows of a picture: enough for the highest window.
const HEIGHT: usize = 34;

/// Pictures; each with other settings.
const ROUNDS: usize = 220;

struct Matchers {
    plain: &'static mut Matcher<WIDTH, DISPARITIES>,
    other: &'static mut Matcher<WIDTH, DISPARITIES>,
}

#[entry]
fn main() -> ! {
    static mut PLAIN: Matcher<WIDTH, DISPARITIES> = Matcher::new();
    static mut OTHER: Matcher<WIDTH, DISPARITIES> = Matcher::new();
    let mut matchers = Matchers { plain: PLAIN, other: OTHER };
    let backend = Backend::fastest();
    if backend == Backend::Plain || !matchers.plain.set_backend(Backend::Plain) || !matchers.other.set_backend(backend)
    {
        board::fail("there is nothing to compare");
    }
    let mut random = Random(0x5eed_0201);
    let mut rows = 0;
    for round in 0..ROUNDS {
        let settings = settings(&mut random, round);
        // Every width up to 200 once, and wide ones.
        let width = if round < 200 { 1 + round } else { 200 + random.below(WIDTH as u32 - 200) as usize };
        if let Some(worked) = matchers.compare(&settings, width, &mut random) {
            rows += worked;
        }
    }
    hprintln!("rows {}", rows);
    hprintln!("done");
    board::succeed()
}

/// Windows of every size in turn; disparities in blocks mostly.
fn settings(random: &mut Random, round: usize) -> MatchSettings {
    let sizes = (MatchSettings::MAX_WINDOW - MatchSettings::MIN_WINDOW) as usize / 2 + 1;
    let edge = |place: usize| MatchSettings::MIN_WINDOW + 2 * (place % sizes) as u16;
    let usual = round % 3 == 0;
    let default = MatchSettings::DEFAULT;
    MatchSettings {
        disparities: if random.below(8) == 0 {
            8 + random.below(120) as u16
        } else {
            8 * (1 + random.below(16) as u16)
        },
        min_disparity: if random.below(3) == 0 { random.below(20) as u16 } else { 0 },
        window_width: if usual { default.window_width } else { edge(round) },
        window_height: if usual { default.window_height } else { edge(round / sizes) },
        wide_window_width: [0, 31, 63][random.below(3) as usize],
        weak_texture: [224, 1000][random.below(2) as usize],
        texture: random.below(3) as u16 * 16,
        uniqueness_percent: [0, 6, 12][random.below(3) as usize],
        wide_uniqueness_percent: [0, 6, 12][random.below(3) as usize],
        back_check: random.below(4) > 0,
        cost: MatchCost::Census,
        ..default
    }
}

impl Matchers {
    /// Rows that the other backend worked on; `None` where settings do not go together.
    fn compare(&mut self, settings: &MatchSettings, width: usize, random: &mut Random) -> Option<usize> {
        for matcher in [&mut *self.plain, &mut *self.other] {
            matcher.configure(settings, width, HEIGHT).ok()?;
        }
        let span = |random: &mut Random| {
            let cut = |random: &mut Random| if random.below(4) == 0 { random.below(9) as usize } else { 0 };
            let start = cut(random).min(width);
            ValidSpan::from(start..width.saturating_sub(cut(random)).max(start))
        };
        let spans = [span(random), span(random)];
        // Noise that is the same in both pictures but for a shift in steps, and faint stripes in places.
        let shift = random.below(40) as usize;
        let contrast = [255, 24, 3][random.below(3) as usize];
        let mut next = [0; 2];
        for y in 0..HEIGHT {
            let mut left = [0; WIDTH];
            let mut right = [0; WIDTH];
            let stripes = random.below(12) as usize;
            for x in 0..width {
                left[x] = if x / 16 % 12 == stripes {
                    100 + (x % 4) as u8 * 9
                } else {
                    90 + random.below(contrast) as u8 % 160
                };
            }
            for x in 0..width {
                let noise = if random.below(16) == 0 { 1 } else { 0 };
                right[x] = left[(x + shift + y / 9).min(width - 1)].wrapping_add(noise);
            }
            let mut pictures = [[DisparityPixel::default(); WIDTH]; 2];
            for (matcher, next) in [&mut *self.plain, &mut *self.other].into_iter().zip(&mut next) {
                matcher.push(&left[..width], &right[..width], spans[0], spans[1]);
                let _ = next;
            }
            loop {
                let mut came = [false; 2];
                for (i, matcher) in [&mut *self.plain, &mut *self.other].into_iter().enumerate() {
                    came[i] = matcher.pull(next[i], &mut pictures[i][..width]);
                }
                if came != [true; 2] {
                    break;
                }
                let [plain, other] = &pictures;
                if let Some(x) = (0..width).find(|&x| plain[x] != other[x]) {
                    hprintln!(
                        "differs at ({}, {}) of {}: {:?}, not {:?}",
                        x,
                        next[0],
                        width,
                        other[x].get(),
                        plain[x].get()
                    );
                    hprintln!("{:?} {:?} {}", settings, spans, self.other.backend().name());
                    board::fail("the backends differ");
                }
                next = next.map(|next| next + 1);
            }
        }
        (self.other.backend() != Backend::Plain).then_some(HEIGHT)
    }
}

/// Marsaglia's xorshift.
struct Random(u32);

impl Random {
    /// A number below `end`.
    fn below(&mut self, end: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0 % end.max(1)
    }
}
