//! Limits of the settings: what lies just beyond one is refused by its name.

use super::*;
use crate::error::ConfigProblem;

#[test]
fn settings_that_cannot_be_are_named() {
    let good = CostMapSettings::default();
    assert_eq!(good.check(), Ok(()));
    for (field, settings) in [
        ("max_deviation_m", CostMapSettings { max_deviation_m: 2.01, ..good }),
        ("min_points", CostMapSettings { min_points: 1, ..good }),
        ("max_level_m", CostMapSettings { max_level_m: 1.21, ..good }),
        ("min_columns", CostMapSettings { min_columns: 0, ..good }),
        ("min_height_m", CostMapSettings { min_height_m: 0.01, ..good }),
        ("max_height_m", CostMapSettings { max_height_m: 0.24, ..good }),
        ("obstacle_cost", CostMapSettings { obstacle_cost: 0, ..good }),
    ] {
        assert_eq!(settings.check().unwrap_err().field.strip_prefix("cost_map."), Some(field));
    }

    let good = GroundDeviationSettings::default();
    assert_eq!(good.check(), Ok(()));
    for (field, settings) in [
        ("deviation_px", GroundDeviationSettings { deviation_px: -0.1, ..good }),
        ("deviation_sigmas", GroundDeviationSettings { deviation_sigmas: 101.0, ..good }),
        ("fit_tolerance_px", GroundDeviationSettings { fit_tolerance_px: 0.06, ..good }),
        ("hypotheses", GroundDeviationSettings { hypotheses: 1001, ..good }),
        ("samples", GroundDeviationSettings { samples: 99, ..good }),
    ] {
        assert_eq!(settings.check().unwrap_err().field.strip_prefix("ground_deviation."), Some(field));
    }

    let good = DisparitySegmentSettings::default();
    assert_eq!(good.check(), Ok(()));
    for (field, settings) in [
        ("ground_tolerance_m", DisparitySegmentSettings { ground_tolerance_m: 0.0, ..good }),
        ("min_height_m", DisparitySegmentSettings { min_height_m: f32::NAN, ..good }),
    ] {
        assert_eq!(settings.check().unwrap_err().field.strip_prefix("disparity_segments."), Some(field));
    }

    let good = PixelNormalSettings::default();
    assert_eq!(good.check(), Ok(()));
    for (field, settings) in [
        ("window", PixelNormalSettings { window: 23, ..good }),
        ("min_filled_percent", PixelNormalSettings { min_filled_percent: 101, ..good }),
        ("max_rms_px", PixelNormalSettings { max_rms_px: 16.5, ..good }),
    ] {
        assert_eq!(settings.check().unwrap_err().field.strip_prefix("pixel_normals."), Some(field));
    }
    for window in (4..=20).step_by(2) {
        let even = PixelNormalSettings { window, ..good }.check().unwrap_err();
        assert_eq!((even.field, even.problem), ("pixel_normals.window", ConfigProblem::NotOdd));
    }

    let good = ConfidenceSettings::default();
    assert_eq!(good.check(), Ok(()));
    for (field, settings) in [
        ("disputed_percent", ConfidenceSettings { disputed_percent: 101, ..good }),
        ("unconfirmed_percent", ConfidenceSettings { unconfirmed_percent: 101, ..good }),
    ] {
        assert_eq!(settings.check().unwrap_err().field.strip_prefix("confidence."), Some(field));
    }
}
