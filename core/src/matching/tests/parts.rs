//! Parts of the pictures: some of the rows, strips of filtered rows, windows that are high and narrow.

use super::*;

/// Settings with one of the ways to compare and to filter, and a window.
fn with(round: u32, [window_width, window_height]: [u16; 2]) -> MatchSettings {
    MatchSettings {
        disparities: 16,
        wide_window_width: 21,
        window_width,
        window_height,
        cost: [MatchCost::Census, MatchCost::AbsoluteDifferences][round as usize % 2],
        prefilter: [Prefilter::HorizontalSobel, Prefilter::Grey][round as usize / 2 % 2],
        ..MatchSettings::DEFAULT
    }
}

#[test]
fn strips_are_the_filtered_rows_as_long_as_they_are_held() {
    const ROWS: usize = 15;
    let mut random = Random::seeded("strips", 0x5eed_0004);
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    let (mut lent, mut refused) = (0, 0);
    for round in 0..24 {
        let settings = with(round, [7, 5 + 2 * random.below(9) as u16]);
        let (width, height) = (30 + random.below(60) as usize, 16 + random.below(50) as usize);
        let pair = pair(&mut random, width, height);
        let plain = Plain::new(&pair, settings);
        let reach = if settings.cost == MatchCost::Census { 3 } else { 1 };
        matcher.configure(&settings, width, height).unwrap();
        assert!(!matcher.has_filtered(0) && matcher.strip::<ROWS>(7).is_none(), "nothing has come");
        for pushed in 1..=height {
            let ((left, right), spans) = ((&pair.left[pushed - 1], &pair.right[pushed - 1]), pair.spans[pushed - 1]);
            matcher.push(left, right, spans.0, spans.1);
            // Rows are filtered once those around have come.
            let newest = pushed.checked_sub(reach + 1).filter(|newest| *newest >= reach);
            for y in 0..height + 9 {
                assert_eq!(matcher.has_filtered(y), newest.is_some_and(|newest| y <= newest), "{y} of {pushed}");
                let there = newest.is_some_and(|newest| y >= reach + 7 && y + 7 <= newest && newest < y - 7 + 22);
                let Some(strip) = matcher.strip::<ROWS>(y) else {
                    assert!(!there, "row {y} of {pushed}");
                    refused += 1;
                    continue;
                };
                assert!(there, "row {y} of {pushed}");
                lent += 1;
                for (picture, rows) in [(&pair.left, strip.left), (&pair.right, strip.right)] {
                    for (row, y) in rows.iter().zip(y - 7..) {
                        let expected = (0..width as i32).map(|x| plain.filtered(picture, x, y as i32));
                        assert!(row.iter().map(|grey| i32::from(*grey)).eq(expected), "row {y} of {pushed}");
                    }
                }
                let around = &pair.spans[y - 7 - reach..=y + 7 + reach];
                let spans = [(strip.left_span, 0), (strip.right_span, 1)];
                for (span, side) in spans {
                    let of = |spans: &(ValidSpan, ValidSpan)| if side == 0 { spans.0 } else { spans.1 };
                    assert_eq!(Some(span.start), around.iter().map(|spans| of(spans).start).max());
                    assert_eq!(Some(span.end), around.iter().map(|spans| of(spans).end).min());
                }
            }
        }
    }
    std::println!("{lent} lent, {refused} refused");
    assert!(lent > 1000 && refused > 1000);
}

#[test]
fn some_rows_have_the_disparities_of_the_whole_picture() {
    let mut random = Random::seeded("some rows", 0x5eed_0005);
    let mut whole = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    let mut part = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    for round in 0..40 {
        let settings = with(round, [5 + 2 * random.below(4) as u16, 5 + 2 * random.below(4) as u16]);
        let (width, height) = (30 + random.below(60) as usize, 30 + random.below(20) as usize);
        let pair = pair(&mut random, width, height);
        whole.configure(&settings, width, height).unwrap();
        let expected = run(&mut whole, &pair);
        let first = random.below(15) as usize;
        let rows = first..(first + 16 + random.below(20) as usize).min(height);
        part.configure_as(&whole);
        part.set_height(rows.len());
        let [_, margin] = settings.margins();
        let some = Pair {
            left: pair.left[rows.clone()].to_vec(),
            right: pair.right[rows.clone()].to_vec(),
            spans: pair.spans[rows.clone()].to_vec(),
        };
        let found = run(&mut part, &some);
        for y in (rows.start + margin..rows.end - margin.min(rows.len())).filter(|y| *y >= margin) {
            let row = |y: usize| y * width..(y + 1) * width;
            assert!(found[row(y - rows.start)] == expected[row(y)], "round {round}, row {y} of {rows:?}: {settings:?}");
        }
    }
}

#[test]
fn rows_that_are_not_of_the_picture_are_left_out() {
    let mut random = Random::seeded("other rows", 0x5eed_0006);
    let (width, height) = (60, 24);
    let pair = pair(&mut random, width, height);
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    matcher.configure(&with(0, [7, 7]), width, height).unwrap();
    let expected = run(&mut matcher, &pair);
    matcher.begin();
    let whole = ValidSpan { start: 0, end: width as u16 };
    let mut row = vec![DisparityPixel::default(); width];
    assert!(!matcher.pull(0, &mut row), "nothing has come");
    let long = vec![9; width + 1];
    for y in 0..height {
        for (left, right) in [(&long[1..width], &pair.right[y][..]), (&pair.left[y], &long), (&long, &long), (&[], &[])]
        {
            matcher.push(left, right, whole, whole);
        }
        matcher.push(&pair.left[y], &pair.right[y], pair.spans[y].0, pair.spans[y].1);
    }
    matcher.push(&pair.left[3], &pair.right[3], whole, whole);
    assert!(!matcher.pull(height, &mut row) && !matcher.pull(0, &mut row[1..]) && !matcher.pull(0, &mut []));
    // Only the last rows can still be told: those before are no longer held.
    assert!(matcher.pull(height - 1, &mut row));
    assert!(row == expected[(height - 1) * width..]);
    let margin = 6;
    assert!(matcher.pull(height - 1 - margin, &mut row));
    assert!(row == expected[(height - 1 - margin) * width..(height - margin) * width]);
}

/// Wherever narrow windows cannot tell, the wide one is asked, and says what the plain version says.
fn assert_wide_agrees(
    matcher: &mut Matcher<WIDTH, DISPARITIES>,
    pair: &Pair,
    [wide_window_width, window_height]: [u16; 2],
    seen: &mut Seen,
) {
    let settings = MatchSettings {
        wide_window_width,
        weak_texture: 1000,
        texture: 0,
        weak_uniqueness_percent: 100,
        wide_uniqueness_percent: 0,
        ..with(0, [5, window_height])
    };
    matcher.configure(&settings, pair.left[0].len(), pair.left.len()).unwrap();
    let expected = Plain::new(pair, settings).picture(seen);
    assert!(run(matcher, pair) == expected, "{window_height} rows, {wide_window_width} columns");
}

#[test]
fn high_and_narrow_windows_agree_with_the_plain_version() {
    let mut random = Random::seeded("high windows", 0x5eed_0007);
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    let mut seen = Seen::new();
    for (window_height, wide_window_width) in
        [(17, 7), (17, 15), (19, 9), (19, 13), (21, 7), (21, 11), (15, 17), (13, 19)]
    {
        // Pictures of noise that fit nowhere cost as much as there is; where all rows are alike, all of a column fits or nothing of it.
        for alike in [false, true] {
            let mut noise = || -> Grey {
                let mut row = || (0..100).map(|_| 1 + random.below(254) as u8).collect::<Vec<u8>>();
                if alike { vec![row(); 40] } else { (0..40).map(|_| row()).collect() }
            };
            let spans = vec![(ValidSpan { start: 0, end: 100 }, ValidSpan { start: 0, end: 100 }); 40];
            let pair = Pair { left: noise(), right: noise(), spans };
            assert_wide_agrees(&mut matcher, &pair, [wide_window_width, window_height], &mut seen);
        }
    }
    assert!(seen.iter().any(|((_, asked, reason), times)| (*asked, *reason) == (Asked::Wide, None) && *times > 1000));
}

/// A column of the window adds as much as there is where another leaves that adds nothing: on the left it is brighter than what lies
/// around and brighter from row to row, on the right darker and darker. What lies around repeats, so that narrow windows cannot tell.
#[test]
fn costs_of_high_windows_may_change_by_all_of_a_column() {
    const SHIFT: usize = 4;
    let mut random = Random::seeded("columns against each other", 0x5eed_0011);
    let mut matcher = Box::new(Matcher::<WIDTH, DISPARITIES>::new());
    let mut seen = Seen::new();
    for (window_height, wide_window_width) in [(17, 15), (19, 13), (21, 11), (15, 17)] {
        let repeated = || -> Vec<u8> { (0..5).map(|_| 80 + random.below(40) as u8).collect::<Vec<u8>>().repeat(20) };
        let rows: Vec<Vec<u8>> = core::iter::repeat_with(repeated).take(40).collect();
        let drawn = |shift: usize, column: fn(u8) -> u8| -> Grey {
            let mut picture: Vec<Vec<u8>> = rows.iter().map(|row| row[shift..96 + shift].to_vec()).collect();
            for (y, row) in picture.iter_mut().enumerate() {
                (20..96).step_by(25).for_each(|x| row[x - shift] = column(y as u8));
            }
            picture
        };
        let spans = vec![(ValidSpan { start: 0, end: 96 }, ValidSpan { start: 0, end: 96 }); 40];
        let pair = Pair { left: drawn(0, |y| 150 + 2 * y), right: drawn(SHIFT, |y| 70 - y), spans };
        assert_wide_agrees(&mut matcher, &pair, [wide_window_width, window_height], &mut seen);
    }
    assert!(seen.iter().any(|((_, asked, reason), times)| (*asked, *reason) == (Asked::Wide, None) && *times > 2000));
}

#[test]
fn rows_of_few_pixels_are_filtered_as_their_definition_says() {
    let mut random = Random::seeded("few pixels", 0x5eed_0008);
    for width in 1..12_usize {
        let mut row = || -> Vec<u8> { (0..width).map(|_| random.below(40) as u8).collect() };
        let rows = [row(), row(), row()];
        let mut out = vec![200; width];
        prefilter::filter(Prefilter::HorizontalSobel, &rows[0], &rows[1], &rows[2], &mut out);
        for (x, found) in out.iter().enumerate() {
            let at = |y: usize, x: usize| i32::from(rows[y][x]);
            let rise = |y: usize| at(y, x + 1) - at(y, x - 1);
            let inside = x > 0 && x + 1 < width;
            let expected = if inside { (rise(0) + 2 * rise(1) + rise(2)).clamp(-31, 31) } else { 0 };
            assert_eq!(i32::from(*found), expected + 31, "{x} of {width}");
        }
    }
}
