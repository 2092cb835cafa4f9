//! Limits of the settings.

use super::*;

#[test]
fn settings_that_cannot_be_are_named() {
    let good = MatchSettings::DEFAULT;
    let problem = |settings: MatchSettings| settings.check().unwrap_err();
    let field = |settings: MatchSettings| problem(settings).field;
    assert_eq!(good.check(), Ok(()));
    assert_eq!(field(MatchSettings::UNSET), "matching.disparities");
    assert_eq!(field(MatchSettings { disparities: 7, ..good }), "matching.disparities");
    assert_eq!(field(MatchSettings { disparities: 1025, ..good }), "matching.disparities");
    assert_eq!(field(MatchSettings { min_disparity: 1001, ..good }), "matching.min_disparity");
    for edge in [0, 3, 4, 22, 23, u16::MAX] {
        assert_eq!(field(MatchSettings { window_width: edge, ..good }), "matching.window_width");
        assert_eq!(field(MatchSettings { window_height: edge, ..good }), "matching.window_height");
    }
    for edge in (6..=20).step_by(2) {
        let wide = MatchSettings { window_width: edge, ..good };
        assert_eq!(problem(wide), ConfigError::new("matching.window_width", ConfigProblem::NotOdd));
        let high = MatchSettings { window_height: edge, ..good };
        assert_eq!(problem(high), ConfigError::new("matching.window_height", ConfigProblem::NotOdd));
    }
    assert_eq!(field(MatchSettings { weak_texture: 1001, ..good }), "matching.weak_texture");
    assert_eq!(field(MatchSettings { weak_uniqueness_percent: 101, ..good }), "matching.weak_uniqueness_percent");
    assert_eq!(field(MatchSettings { wide_uniqueness_percent: 101, ..good }), "matching.wide_uniqueness_percent");
    assert_eq!(field(MatchSettings { texture: 1001, ..good }), "matching.texture");
    assert_eq!(field(MatchSettings { uniqueness_percent: 101, ..good }), "matching.uniqueness_percent");
    assert_eq!(field(MatchSettings { back_check_px: 65, ..good }), "matching.back_check_px");
    assert_eq!(field(MatchSettings { saturated_percent: 0, ..good }), "matching.saturated_percent");
    assert_eq!(field(MatchSettings { saturated_percent: 101, ..good }), "matching.saturated_percent");
}

#[test]
fn the_second_window_is_odd_and_not_narrower_than_the_first() {
    let with =
        |window_width, wide_window_width| MatchSettings { window_width, wide_window_width, ..MatchSettings::DEFAULT };
    for window_width in (5..=21).step_by(2) {
        assert_eq!(with(window_width, 0).check(), Ok(()), "none");
        for wide in 1..=u16::from(u8::MAX) {
            let found = with(window_width, wide).check();
            if wide < window_width || wide > 63 {
                assert_eq!(found.unwrap_err().field, "matching.wide_window_width", "{window_width}, {wide}");
            } else if wide.is_multiple_of(2) {
                let expected = ConfigError::new("matching.wide_window_width", ConfigProblem::NotOdd);
                assert_eq!(found, Err(expected), "{window_width}, {wide}");
            } else {
                assert_eq!(found, Ok(()), "{window_width}, {wide}");
            }
        }
    }
}

/// The largest difference of a pixel: 8 bits of a code, twice the cut-off of the Sobel response, half a grey value.
#[test]
fn windows_whose_sums_do_not_fit_16_bits_are_refused() {
    let ways = [
        (MatchCost::Census, Prefilter::HorizontalSobel, 8),
        (MatchCost::Census, Prefilter::Grey, 8),
        (MatchCost::AbsoluteDifferences, Prefilter::HorizontalSobel, 62),
        (MatchCost::AbsoluteDifferences, Prefilter::Grey, 127),
    ];
    let mut refused = 0;
    for (cost, prefilter, largest) in ways {
        for window_height in (5..=21).step_by(2) {
            for wide_window_width in (21..=63).step_by(2) {
                let settings = MatchSettings {
                    cost,
                    prefilter,
                    window_height,
                    wide_window_width,
                    window_width: 21,
                    ..MatchSettings::DEFAULT
                };
                let needed = usize::from(window_height) * usize::from(wide_window_width) * largest;
                let expected = if needed > 65_535 {
                    refused += 1;
                    let problem = ConfigProblem::OverCapacity { needed, capacity: 65_535 };
                    Err(ConfigError::new("matching.wide_window_width x matching.window_height", problem))
                } else {
                    Ok(())
                };
                assert_eq!(settings.check(), expected, "{settings:?}");
            }
            // The largest first window always fits.
            let alone = MatchSettings {
                cost,
                prefilter,
                window_height,
                window_width: 21,
                wide_window_width: 0,
                ..MatchSettings::DEFAULT
            };
            assert_eq!(alone.check(), Ok(()));
        }
    }
    assert!(refused > 20, "{refused}");
}
