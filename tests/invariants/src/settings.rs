//! Settings of all stages.

use fencepost_core::{
    ground::GroundSettings,
    health::HealthSettings,
    map::{MapGeometry, MapSettings},
    matching::{MatchCost, MatchSettings, Prefilter},
    methods::{
        ConfidenceSettings, CostMapSettings, DetectorKind, DisparitySegmentSettings, GroundDeviationSettings,
        PixelNormalSettings,
    },
    obstacles::ObstacleSettings,
    settings::Settings,
    surfaces::SurfaceSettings,
    validate::ValidateSettings,
};

use crate::Source;

/// Settings of all stages, with limits that small pictures reach.
pub(crate) fn read(source: &mut Source<'_>) -> Settings {
    let detector = source.one_of(&[
        DetectorKind::SurfaceNormals,
        DetectorKind::SurfaceNormals,
        DetectorKind::SurfaceNormals,
        DetectorKind::CostMap,
        DetectorKind::GroundDeviation,
        DetectorKind::DisparitySegments,
        DetectorKind::PixelNormals,
    ]);
    let other = source.one_of(&DetectorKind::ALL);
    // One that checks itself is refused, which is tried seldom.
    let cross_check = (source.below(4) == 3 && (other != detector || source.below(16) == 15)).then_some(other);
    Settings {
        detector,
        cross_check,
        matching: matching(source),
        validate: ValidateSettings {
            min_surface_px: source.one_of(&[0, 0, 8, 40]),
            step_sixteenths: source.one_of(&[8, 0, 16, 1024]),
        },
        surfaces: SurfaceSettings {
            step_sixteenths: source.one_of(&[16, 0, 1, 8, 64]),
            min_pixels: source.one_of(&[16, 16, 24, 100]),
            horizontal_deg: source.one_of(&[30.0, 10.0, 45.0]),
            vertical_deg: source.one_of(&[45.0, 60.0, 89.0]),
        },
        ground: ground(source),
        obstacles: obstacles(source),
        map: map(source),
        health: HealthSettings {
            low_coverage_percent: source.one_of(&[8.0, 0.0, 60.0]),
            blind_coverage_percent: source.one_of(&[1.0, 0.0, 30.0]),
            exchange_test_percent: source.one_of(&[15.0, 0.0, 100.0]),
            trigger_frames: 1 + source.below(2) as u8,
            release_frames: source.one_of(&[5, 1, 2]),
            ..HealthSettings::default()
        },
        cost_map: CostMapSettings {
            min_points: source.one_of(&[10, 2]),
            min_columns: source.one_of(&[24, 2]),
            obstacle_cost: source.one_of(&[20, 2]),
            ..CostMapSettings::default()
        },
        ground_deviation: GroundDeviationSettings {
            hypotheses: source.one_of(&[8, 0, 2]),
            samples: source.one_of(&[100, 400]),
            ..GroundDeviationSettings::default()
        },
        disparity_segments: DisparitySegmentSettings::default(),
        pixel_normals: PixelNormalSettings {
            window: source.one_of(&[11, 3, 5, 21, 11, 3, 5, 4]),
            min_filled_percent: source.one_of(&[50, 0, 100]),
            ..PixelNormalSettings::default()
        },
        confidence: ConfidenceSettings {
            disputed_percent: source.one_of(&[50, 0, 100]),
            unconfirmed_percent: source.one_of(&[80, 0, 100]),
        },
    }
}

/// Those of the matcher.
pub(crate) fn matching(source: &mut Source<'_>) -> MatchSettings {
    MatchSettings {
        disparities: source.one_of(&[12, 8, 9]),
        min_disparity: source.one_of(&[0, 0, 1, 3]),
        cost: source.one_of(&[MatchCost::Census, MatchCost::AbsoluteDifferences]),
        window_width: source.one_of(&[5, 9, 7]),
        window_height: source.one_of(&[5, 7]),
        wide_window_width: source.one_of(&[0, 15, 31]),
        weak_texture: source.one_of(&[224, 0, 1000]),
        prefilter: source.one_of(&[Prefilter::HorizontalSobel, Prefilter::Grey]),
        texture: source.one_of(&[32, 0, 200]),
        uniqueness_percent: source.one_of(&[6, 0, 20]),
        back_check: source.below(4) > 0,
        saturated_percent: source.one_of(&[60, 100, 1]),
        ..MatchSettings::DEFAULT
    }
}

fn ground(source: &mut Source<'_>) -> GroundSettings {
    GroundSettings {
        max_tilt_deg: source.one_of(&[20.0, 0.0, 45.0]),
        height_tolerance_m: source.one_of(&[0.5, 0.0, 5.0]),
        fit_noise_max_px: source.one_of(&[0.7, 0.0, 4.0]),
        surface_tolerance_m: source.one_of(&[0.06, 0.3]),
        terrain_patch_m: source.one_of(&[0.75, 0.1]),
        min_support_permille: source.one_of(&[2.0, 100.0]),
        other_height_support_permille: source.one_of(&[20.0, 0.0, 2000.0]),
        hold_frames: source.one_of(&[0, 1, 10]),
        ..GroundSettings::default()
    }
}

fn obstacles(source: &mut Source<'_>) -> ObstacleSettings {
    ObstacleSettings {
        min_height_m: source.one_of(&[0.25, 0.02]),
        min_pixels: source.one_of(&[40, 0, 16]),
        min_area_m2: source.one_of(&[0.02, 0.0]),
        min_size_m: source.one_of(&[0.15, 0.0]),
        max_range_m: source.one_of(&[40.0, 3.0]),
        ..ObstacleSettings::default()
    }
}

fn map(source: &mut Source<'_>) -> MapSettings {
    let (x_count, y_count) = source.one_of(&[(8, 8), (16, 4), (4, 16), (1, 1), (64, 1)]);
    MapSettings {
        geometry: MapGeometry {
            cell_size_mm: source.one_of(&[500, 250, 100, 2000]),
            x_first: source.one_of(&[0, 0, -2, -64]),
            x_count,
            y_first: source.one_of(&[-4, -4, -8, 0]),
            y_count,
        },
        obstacle_cover: source.one_of(&[0.1, 0.0, 1.0]),
        obstacle_min_pixels: source.one_of(&[4, 1, 24]),
        free_cover: source.one_of(&[0.03, 0.0, 1.0]),
        free_min_pixels: source.one_of(&[4, 1]),
        height_noise_px: source.one_of(&[0.8, 0.0]),
        smear_share: source.one_of(&[0.33, 0.0, 1.0]),
        smear_cells: source.one_of(&[2, 0, 8]),
        max_range_m: source.one_of(&[30.0, 2.0]),
        sector_width_deg: source.one_of(&[5.0, 18.0, 0.5]),
        ..MapSettings::default()
    }
}

/// Makes one or two settings any others: many values are refused, and what is taken must be good for pictures.
pub(crate) fn change(source: &mut Source<'_>, settings: &mut Settings) {
    let Settings { matching, validate, surfaces, ground, obstacles, map, health, .. } = settings;
    let (cost_map, deviation) = (&mut settings.cost_map, &mut settings.ground_deviation);
    let (segments, normals) = (&mut settings.disparity_segments, &mut settings.pixel_normals);
    let confidence = &mut settings.confidence;
    let which = source.byte();
    match source.byte() % 3 {
        0 => {
            let words = [
                &mut matching.disparities,
                &mut matching.min_disparity,
                &mut matching.window_width,
                &mut matching.window_height,
                &mut matching.wide_window_width,
                &mut matching.weak_texture,
                &mut matching.wide_uniqueness_percent,
                &mut matching.texture,
                &mut matching.uniqueness_percent,
                &mut matching.weak_uniqueness_percent,
                &mut matching.back_check_px,
                &mut matching.saturated_percent,
                &mut validate.min_surface_px,
                &mut validate.step_sixteenths,
                &mut surfaces.step_sixteenths,
                &mut surfaces.min_pixels,
                &mut ground.hold_frames,
                &mut obstacles.min_pixels,
                &mut map.obstacle_min_pixels,
                &mut map.free_min_pixels,
                &mut map.geometry.cell_size_mm,
                &mut map.geometry.x_count,
                &mut map.geometry.y_count,
                &mut cost_map.min_points,
                &mut cost_map.min_columns,
                &mut cost_map.obstacle_cost,
                &mut deviation.hypotheses,
                &mut deviation.samples,
                &mut normals.window,
            ];
            let any = source.word();
            *pick(which, words) = source.one_of(&[0, 1, 2, 3, 13, 64, 100, 101, 255, 1025, 4096, u16::MAX, any]);
        }
        1 => {
            let numbers = [
                &mut surfaces.horizontal_deg,
                &mut surfaces.vertical_deg,
                &mut ground.max_tilt_deg,
                &mut ground.height_tolerance_m,
                &mut ground.fit_tolerance_m,
                &mut ground.fit_noise_max_px,
                &mut ground.fit_noise_factor,
                &mut ground.fit_roughness,
                &mut ground.surface_tolerance_m,
                &mut ground.surface_tolerance_per_m,
                &mut ground.max_range_m,
                &mut ground.corridor_m,
                &mut ground.terrain_patch_m,
                &mut ground.terrain_max_slope_deg,
                &mut ground.terrain_noise_px,
                &mut ground.terrain_share,
                &mut ground.min_support_permille,
                &mut ground.other_height_support_permille,
                &mut obstacles.min_height_m,
                &mut obstacles.platform_height_m,
                &mut obstacles.clearance_m,
                &mut obstacles.min_area_m2,
                &mut obstacles.min_size_m,
                &mut obstacles.max_range_m,
                &mut map.obstacle_cover,
                &mut map.free_cover,
                &mut map.free_max_height_m,
                &mut map.height_noise_px,
                &mut map.unclear_share,
                &mut map.smear_share,
                &mut map.max_range_m,
                &mut map.sector_width_deg,
                &mut cost_map.max_deviation_m,
                &mut cost_map.max_level_m,
                &mut cost_map.min_height_m,
                &mut cost_map.max_height_m,
                &mut deviation.deviation_px,
                &mut deviation.deviation_sigmas,
                &mut deviation.fit_tolerance_px,
                &mut segments.ground_tolerance_m,
                &mut segments.min_height_m,
                &mut normals.max_rms_px,
            ];
            let (within, bits) = (source.within(0.0, 2.0), source.double_word());
            let any = f32::from_bits(bits);
            *pick(which, numbers) = source.one_of(&[within, 0.0, -1.0, 1.0, 45.0, 90.0, 1000.0, 1.0e9, any]);
        }
        _ => {
            let health_numbers = [
                &mut health.dark_percent,
                &mut health.dark_blind_percent,
                &mut health.bright_percent,
                &mut health.bright_blind_percent,
                &mut health.exposure_ratio,
                &mut health.low_coverage_percent,
                &mut health.blind_coverage_percent,
                &mut health.near_zone_percent,
                &mut health.exchange_test_percent,
                &mut health.structure_grey,
                &mut health.covered_percent,
                &mut health.covered_blind_percent,
                &mut health.flat_percent,
                &mut health.flat_excess_percent,
                &mut health.pairing_sigmas,
                &mut health.pairing_likeness,
                &mut health.row_error_px,
                &mut health.row_error_blind_px,
            ];
            let (within, bits) = (source.within(0.0, 100.0), source.double_word());
            let any = f32::from_bits(bits);
            *pick(which, health_numbers) = source.one_of(&[within, 0.0, -1.0, 1.0, 100.0, 101.0, any]);
            let bytes = [
                &mut health.trigger_frames,
                &mut health.release_frames,
                &mut map.smear_cells,
                &mut normals.min_filled_percent,
                &mut confidence.disputed_percent,
                &mut confidence.unconfirmed_percent,
            ];
            *pick(which, bytes) = source.byte();
        }
    }
}

/// One of several.
fn pick<T, const N: usize>(which: u8, all: [&mut T; N]) -> &mut T {
    all.into_iter().nth(usize::from(which) % N).expect("a place among them")
}
