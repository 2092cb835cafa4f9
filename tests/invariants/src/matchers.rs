//! The matcher alone, with search ranges that fill the widest vectors: every backend against plain Rust.

use std::cell::RefCell;

use fencepost_core::{
    arch::Backend,
    disparity::DisparityPixel,
    matching::{MatchSettings, Matcher, ValidSpan},
};

use crate::{
    Source,
    pairs::{GAP, draw},
    settings,
};

const WIDTH: usize = 192;
const DISPARITIES: usize = 96;

type Wide = Matcher<WIDTH, DISPARITIES>;

struct Matchers {
    plain: Wide,
    other: Wide,
    pictures: [Vec<u8>; 2],
    found: [Vec<DisparityPixel>; 2],
}

thread_local! {
    static MATCHERS: RefCell<Box<Matchers>> = RefCell::new(Box::new(Matchers {
        plain: Matcher::new(),
        other: Matcher::new(),
        pictures: Default::default(),
        found: Default::default(),
    }));
}

/// Pictures that are just high enough for a few rows under the window, with both.
pub(crate) fn check(source: &mut Source<'_>) {
    let any = 8 + source.below(73) as u16;
    let mut settings =
        MatchSettings { disparities: source.one_of(&[16, 32, 48, 64, 80, any]), ..settings::matching(source) };
    // Now and then more disparities, and one that is refused: windows without a middle, more disparities than there is room for.
    match source.byte() {
        0..232 => {}
        232..240 => settings.disparities = DISPARITIES as u16,
        240..250 => {
            (settings.window_width, settings.window_height) = source.one_of(&[(21, 21), (17, 5), (9, 17), (21, 15)]);
        }
        250 => settings.window_width += 1,
        251 => settings.window_height += 1,
        252 => settings.wide_window_width |= 16,
        253 => settings.wide_window_width += 1,
        _ => settings.disparities = DISPARITIES as u16 + 1 + u16::from(source.byte()),
    }
    let backend = source.one_of(Backend::ALL);
    let size = (source.one_of(&[64, 80, 100, WIDTH]), usize::from(settings.window_height) + 6 + source.below(3));
    let sides = [(source.below(20), source.below(20)), (source.below(20), source.below(20))];
    MATCHERS.with_borrow_mut(|matchers| {
        let Matchers { plain, other, pictures, found } = &mut **matchers;
        assert!(plain.set_backend(Backend::Plain), "plain Rust is always there");
        if !other.set_backend(backend) {
            return;
        }
        let configured = plain.configure(&settings, size.0, size.1);
        assert_eq!(other.configure(&settings, size.0, size.1), configured, "refused by a backend");
        let windows = [settings.window_width, settings.window_height, settings.wide_window_width.max(1)];
        if windows.iter().any(|edge| edge.is_multiple_of(2)) || usize::from(settings.disparities) > DISPARITIES {
            assert!(configured.is_err(), "taken: {settings:?}");
        }
        if configured.is_err() {
            return;
        }
        pictures.iter_mut().for_each(Vec::clear);
        draw(source, size, pictures);
        let mut spans = sides.map(|(first, last)| ValidSpan::from(first..size.0 - last));
        // A picture of which hardly anything is valid, on one side: less than a window, or nothing.
        match source.below(8) {
            5 => spans[0] = ValidSpan::from(30..33),
            6 => spans[1] = ValidSpan::from(30..33),
            7 => spans[1] = ValidSpan::from(9..9),
            _ => {}
        }
        for (matcher, found) in [plain, other].into_iter().zip(&mut *found) {
            run(matcher, size, pictures, spans, found);
        }
        let [plain, other] = found;
        for (place, (plain, other)) in plain.iter().zip(other).enumerate() {
            let (x, y) = (place % size.0, place / size.0);
            assert_eq!(plain, other, "{} at {x}, {y}: {settings:?}", backend.name());
            if plain.has_value() {
                let searched = 16 * u32::from(settings.min_disparity)
                    ..=16 * (u32::from(settings.min_disparity) + u32::from(settings.disparities) - 1);
                assert!(searched.contains(&u32::from(plain.steps())), "{plain:?} at {x}, {y}: {settings:?}");
            }
        }
    });
}

/// Pushes all rows, and one too many, and takes what comes.
fn run(
    matcher: &mut Wide,
    (width, height): (usize, usize),
    pictures: &[Vec<u8>; 2],
    spans: [ValidSpan; 2],
    found: &mut Vec<DisparityPixel>,
) {
    found.clear();
    found.resize(width * height, DisparityPixel::from_bits(0));
    matcher.begin();
    let mut next = 0;
    for y in (0..height).chain([0]) {
        let [left, right] = pictures.each_ref().map(|picture| &picture[y * (width + GAP)..][..width]);
        // Rows of another length are none.
        matcher.push(&left[1..], right, spans[0], spans[1]);
        matcher.push(left, &right[1..], spans[0], spans[1]);
        matcher.push(left, right, spans[0], spans[1]);
        while next < height && matcher.pull(next, &mut found[next * width..][..width]) {
            next += 1;
        }
    }
    assert_eq!(next, height, "rows that never came");
    assert!(!matcher.pull(height, &mut found[..width]), "a row below the picture");
    assert!(!matcher.pull(height - 1, &mut found[1..width]), "a row of another length");
}
