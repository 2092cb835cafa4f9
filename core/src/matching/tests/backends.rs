//! Every backend against the plain one, row by row.

use super::*;
use crate::arch::Backend;

/// Wide and deep enough for real pictures.
const WIDEST: usize = 1248;
const MOST: usize = 160;

/// Widths of real pictures.
const REAL: [usize; 7] = [320, 376, 512, 640, 752, 1226, 1242];

/// The plain matcher and all others that this processor can run, side by side.
struct Runner {
    plain: Box<Matcher<WIDEST, MOST>>,
    others: Vec<Box<Matcher<WIDEST, MOST>>>,
    /// Rows that each backend really worked on: where its vectors do not fit, a slower one serves.
    rows: BTreeMap<Backend, usize>,
}

impl Runner {
    fn new() -> Self {
        let matcher = |backend: Backend| {
            let mut matcher = Box::new(Matcher::new());
            assert!(matcher.set_backend(backend));
            matcher
        };
        let others: Vec<_> =
            Backend::ALL.iter().copied().filter(|b| b.is_available() && *b != Backend::Plain).map(matcher).collect();
        std::println!("{} backends beside the plain one", others.len());
        Self { plain: matcher(Backend::Plain), others, rows: BTreeMap::new() }
    }

    /// Matches a pair with all of them and compares every pixel.
    fn check(&mut self, settings: &MatchSettings, pair: &Pair) {
        let (width, height) = (pair.left[0].len(), pair.left.len());
        self.plain.configure(settings, width, height).unwrap();
        let expected = rows(&mut self.plain, pair);
        for matcher in &mut self.others {
            matcher.configure(settings, width, height).unwrap();
            let backend = matcher.backend();
            let found = rows(matcher, pair);
            *self.rows.entry(backend).or_default() += height;
            for (place, (found, expected)) in found.iter().zip(&expected).enumerate() {
                assert!(
                    found == expected,
                    "{} at ({}, {}): {:?}, not {:?}; {settings:?} {width} x {height}",
                    backend.name(),
                    place % width,
                    place / width,
                    found.get(),
                    expected.get(),
                );
            }
        }
    }

    /// Says how much was looked at, and that each backend had its share.
    fn report(&self) {
        std::println!("rows by backend: {:?}", self.rows);
        for matcher in &self.others {
            let asked = if matcher.is_forced { matcher.backend } else { Backend::Plain };
            let rows = self.rows.get(&asked).copied().unwrap_or_default();
            assert!(
                rows * self.others.len() * 4 > self.rows.values().sum::<usize>(),
                "{}: only {rows} rows",
                asked.name()
            );
        }
    }
}

fn rows(matcher: &mut Matcher<WIDEST, MOST>, pair: &Pair) -> Vec<DisparityPixel> {
    let width = pair.left[0].len();
    let mut picture = vec![DisparityPixel::default(); width * pair.left.len()];
    let mut next = 0;
    matcher.begin();
    for ((left, right), spans) in pair.left.iter().zip(&pair.right).zip(&pair.spans) {
        matcher.push(left, right, spans.0, spans.1);
        while matcher.pull(next, picture.get_mut(next * width..(next + 1) * width).unwrap_or_default()) {
            next += 1;
        }
    }
    picture
}

/// Settings for pictures of any width, Hamming distances mostly, with windows of the given size.
fn settings_with(random: &mut Random, window: Option<[u16; 2]>) -> MatchSettings {
    let round = random.below(100);
    let mut settings = settings(random, round);
    // In full vectors, in parts of them, and more than keys have room for.
    settings.disparities = match random.below(4) {
        0 => 16 * (1 + random.below(8) as u16),
        1 => 8 + random.below(24) as u16,
        2 => 64,
        _ => 8 + random.below(MOST as u32 - 8) as u16,
    };
    if random.below(10) > 0 {
        settings.cost = MatchCost::Census;
    }
    if let Some([width, height]) = window {
        (settings.window_width, settings.window_height) = (width, height);
        settings.wide_window_width = [0, 31.max(width), 63][random.below(3) as usize];
    }
    let fits = settings.check().is_ok();
    if fits { settings } else { MatchSettings { wide_window_width: 0, ..settings } }
}

/// A pair as high as it takes for up to `most` rows under the window.
fn pair_for(random: &mut Random, settings: &MatchSettings, width: usize, most: u32) -> Pair {
    let [_, margin] = settings.margins();
    let height = 2 * margin + 1 + random.below(most) as usize;
    // Spans are drawn up to four columns from either end.
    let mut pair = pair(random, width.max(4), height);
    for row in pair.left.iter_mut().chain(&mut pair.right) {
        row.truncate(width);
    }
    pair
}

#[test]
fn every_window_gives_the_same_with_every_backend() {
    let mut random = Random::seeded("windows of the backends", 0x5eed_0101);
    let mut runner = Runner::new();
    let edges = || (MatchSettings::MIN_WINDOW..=MatchSettings::MAX_WINDOW).step_by(2);
    for window in edges().flat_map(|width| edges().map(move |height| [width, height])) {
        let settings = settings_with(&mut random, Some(window));
        let width = 250 + random.below(200) as usize;
        let pair = pair_for(&mut random, &settings, width, 12);
        runner.check(&settings, &pair);
    }
    runner.report();
}

#[test]
fn every_width_gives_the_same_with_every_backend() {
    let mut random = Random::seeded("widths of the backends", 0x5eed_0102);
    let mut runner = Runner::new();
    for width in (1..=200).chain(REAL) {
        let settings = settings_with(&mut random, None);
        let pair = pair_for(&mut random, &settings, width, 12);
        runner.check(&settings, &pair);
    }
    runner.report();
}

/// Rows of every width from 1 to 200 under windows of every size, 10 000 of them or `FENCEPOST_ROWS`.
#[test]
fn random_rows_give_the_same_with_every_backend() {
    let mut random = Random::seeded("rows of the backends", 0x5eed_0103);
    let mut runner = Runner::new();
    let wanted = std::env::var("FENCEPOST_ROWS").map_or(10_000, |rows| rows.parse().unwrap());
    let edges = || (MatchSettings::MIN_WINDOW..=MatchSettings::MAX_WINDOW).step_by(2);
    let windows: Vec<_> = edges().flat_map(|width| edges().map(move |height| [width, height])).collect();
    let mut matched = 0;
    for round in 0.. {
        if matched >= wanted {
            break;
        }
        let settings = settings_with(&mut random, Some(windows[round % windows.len()]));
        let pair = pair_for(&mut random, &settings, 1 + round % 200, 80);
        runner.check(&settings, &pair);
        let [_, margin] = settings.margins();
        matched += pair.left.len() - 2 * margin;
    }
    std::println!("{matched} rows under the window");
    runner.report();
}

/// The default settings on pictures of the usual sizes use the vectors that were asked for.
#[test]
fn the_usual_sizes_need_no_slower_backend() {
    let mut runner = Runner::new();
    for (width, disparities) in [(320, 48), (512, 64), (640, 64), (752, 96), (1226, 128), (1242, 128)] {
        for matcher in &mut runner.others {
            let settings = MatchSettings { disparities, ..MatchSettings::DEFAULT };
            matcher.configure(&settings, width, 100).unwrap();
            assert_eq!(matcher.backend(), matcher.backend, "{width} {disparities}");
        }
    }
}

#[test]
fn a_backend_that_is_not_there_is_refused() {
    assert!(Backend::Plain.is_available());
    assert!(Backend::fastest().is_available());
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    for &backend in Backend::ALL {
        assert_eq!(matcher.set_backend(backend), backend.is_available(), "{}", backend.name());
    }
    #[cfg(target_arch = "x86_64")]
    for (backend, found) in [
        (Backend::Sse2, std::is_x86_feature_detected!("sse2")),
        (Backend::Sse41, std::is_x86_feature_detected!("sse4.1") && std::is_x86_feature_detected!("ssse3")),
        (Backend::Avx2, std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("bmi2")),
        (Backend::Avx512, std::is_x86_feature_detected!("avx512bw") && std::is_x86_feature_detected!("avx512bitalg")),
        (Backend::Neon, false),
    ] {
        assert_eq!(backend.is_available(), found, "{}", backend.name());
    }
    #[cfg(target_arch = "aarch64")]
    assert_eq!(Backend::fastest(), Backend::Neon);
}
