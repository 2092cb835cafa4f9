//! Values and single stages through their own interface: what no detector leads to, because it makes its values itself and asks
//! its stages for what they can do.

use fencepost_core::{
    disparity::{DisparityPicture, DisparityPixel},
    error::{ConfigError, ConfigProblem},
    geometry::{DepthTable, Rays, RectifiedPair, VehicleFrame},
    ground::GroundFinder,
    map::MapBuilder,
    matching::{Matcher, ValidSpan},
    methods::{CostMap, DisparitySegments, GroundDeviation, PixelNormals},
    obstacles::ObstacleFinder,
    settings::Settings,
    surfaces::{Regions, Surfaces},
    validate::SurfaceSize,
};

use crate::{
    Source,
    camera::{CELLS, Camera, draw},
    cameras, parts, settings, values,
};

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let which = source.byte();
    // Pictures take a hundred times as long as the rest.
    if which >= 192 && source.seldom(32) {
        return cameras::check(&mut source);
    }
    match which % 8 {
        0 | 1 => values::check_eigen(&mut source),
        2 => values::check_scatter(&mut source),
        3 => values::check_pixels(&mut source),
        4 => values::check_cells(&mut source),
        5 => values::check_places(&mut source),
        6 => values::check_reasons(&mut source),
        _ => check_stages(&mut source),
    }
    // What is left goes to what was written later: inputs that were found before keep their meaning.
    if !source.is_empty() {
        parts::check(&mut source);
    }
}

/// Capacity of the stages: less than most pictures need.
const WIDTH: usize = 20;
const PIXELS: usize = 24 * 18;
const DISPARITIES: usize = 10;
const SURFACES: usize = 4;

/// Any settings are refused in words that name the stage, or hold only numbers; a stage takes what its settings say that it can
/// take, and what fits it.
fn check_stages(source: &mut Source<'_>) {
    let Camera { pair, mount, settings: mut all } = Camera::read(source);
    for _ in 0..1 + source.below(3) {
        settings::change(source, &mut all);
    }
    if source.below(8) == 7 {
        (all.matching.wide_window_width, all.matching.window_height) =
            (u16::from(source.byte()) | 1, 1 + 2 * source.below(11) as u16);
    }
    check_words(&all);
    let Ok(frame) = VehicleFrame::new(&mount) else { return };
    let (width, height) = (source.below(2 * WIDTH), source.below(40));
    let pixels = width * height;
    let fits = width <= WIDTH;
    let Settings { matching, validate, surfaces, ground, obstacles, map, .. } = &all;

    let mut size = SurfaceSize::<WIDTH>::new();
    assert_fits(size.configure(validate, width), validate.check(), fits);
    let mut normals = PixelNormals::<WIDTH>::new();
    assert_fits(normals.configure(&all.pixel_normals, surfaces, width), all.pixel_normals.check(), fits);
    let mut matcher = Matcher::<WIDTH, DISPARITIES>::new();
    let room = fits && usize::from(matching.disparities) <= DISPARITIES;
    let configured = matcher.configure(matching, width, height);
    assert_fits(configured, matching.check(), room);
    if configured.is_ok() {
        check_matcher(&mut matcher, (width, height), source.double_word());
    }
    let mut finder = Surfaces::<PIXELS, SURFACES>::new();
    let found = finder.configure(surfaces, width, height);
    assert_fits(found, surfaces.check(), pixels <= PIXELS);
    let mut on_ground = GroundFinder::new();
    assert_fits(on_ground.configure(ground, &frame, true, pixels), ground.check(), true);
    assert_fits(ObstacleFinder::new().configure(obstacles, pair.focal_px), obstacles.check(), true);
    assert_fits(CostMap::new().configure(&all.cost_map, ground, pixels), all.cost_map.check(), true);
    let mut segments = DisparitySegments::new();
    let configured = segments.configure(&all.disparity_segments, ground, pixels);
    assert_fits(configured, all.disparity_segments.check(), true);
    let mut deviation = GroundDeviation::new();
    let of_pair = RectifiedPair { width: width as u32, height: height as u32, ..pair };
    let configured = deviation.configure(&all.ground_deviation, ground, &of_pair, &frame, source.flag());
    assert_fits(configured, all.ground_deviation.check(), true);
    assert_fits(MapBuilder::<CELLS>::new().configure(map, (0.1, 1.0)), map.check(CELLS), true);

    // A picture of the size that was configured where there is room for it, and one of any other.
    let mut picture = Vec::new();
    if pixels > 0 {
        draw(source, &Camera { pair: of_pair, mount, settings: all }, &mut picture);
    }
    let before = picture.clone();
    size.run(&mut picture);
    for (before, after) in before.iter().zip(&picture) {
        assert!(before == after || (before.has_value() && !after.has_value()), "{before:?} became {after:?}");
    }
    let mut depth = DepthTable::<DISPARITIES>::new();
    depth.configure(&pair, matching.min_disparity, matching.disparities);
    let same = DisparityPicture::new(&picture, width);
    let other = DisparityPicture::new(&picture[picture.len().min(source.below(4))..], source.below(2 * WIDTH));
    let rays = Rays::new(&pair, &frame);
    let is_same = |seen: DisparityPicture<'_>| (seen.width(), seen.height()) == (width, height);
    let mut regions = Regions::<SURFACES>::new();
    for seen in [other, same] {
        let report = finder.run(seen, &depth, &rays);
        if !is_same(seen) || found.is_err() {
            assert_eq!((report.found, finder.table().len()), (0, 0), "surfaces in a picture of another size");
        }
        assert_eq!(report.found.saturating_sub(report.dropped) as usize, finder.table().len());
        let level = segments.run(&mut finder, &mut regions, seen, &frame);
        assert!(level.is_none_or(|level| level.support as usize <= pixels), "{level:?}");
    }
    let mut unset = GroundFinder::new();
    assert_eq!(unset.run(&mut finder, &mut regions, same, (&depth, &rays)), None, "ground of what is not configured");
    // The surfaces of one picture, and another picture.
    for seen in [same, other] {
        finder.run(same, &depth, &rays);
        if let Some(plane) = on_ground.run(&mut finder, &mut regions, seen, (&depth, &rays)) {
            assert!(ground.check().is_ok() && plane.camera_height_m > 0.0, "{plane:?}");
            let lift_m = on_ground.terrain().lift_m(2.0, 0.5);
            assert!(is_same(seen) || lift_m == 0.0, "terrain of another picture: {lift_m} m");
        }
    }
}

/// Rows of any width: those that no window fits have no disparity, and those that it fits only such as were searched.
fn check_matcher(matcher: &mut Matcher<WIDTH, DISPARITIES>, (width, height): (usize, usize), noise: u32) {
    let settings = *matcher.settings();
    let mut noise = u64::from(noise);
    let all = ValidSpan::from(0..width);
    let mut found = [DisparityPixel::from_bits(1); WIDTH];
    let mut next = 0;
    let fits = width >= usize::from(settings.window_width) && height >= usize::from(settings.window_height);
    matcher.begin();
    for _ in 0..height {
        let mut row = [0; WIDTH];
        row.iter_mut().for_each(|grey| *grey = crate::source::next(&mut noise) as u8);
        matcher.push(&row[..width], &row[..width], all, all);
        while matcher.pull(next, &mut found[..width]) {
            next += 1;
            for pixel in found[..width].iter().filter(|pixel| pixel.has_value()) {
                let first = 16 * u32::from(settings.min_disparity);
                let searched = first..first + 16 * u32::from(settings.disparities);
                assert!(fits && searched.contains(&u32::from(pixel.steps())), "{pixel:?}: {settings:?}");
            }
        }
    }
    assert_eq!(next, height, "rows that never came: {width}, {settings:?}");
}

/// What is refused is so by its settings, or because it has no room.
fn assert_fits(configured: Result<(), ConfigError>, checked: Result<(), ConfigError>, fits: bool) {
    match configured {
        Ok(()) => assert!(checked.is_ok() && fits, "taken: {checked:?}"),
        Err(error) if checked == Err(error) => {}
        Err(error) => assert!(!fits && matches!(error.problem, ConfigProblem::OverCapacity { .. }), "{error}"),
    }
}

/// Settings that are refused are named by their stage; those that are taken are numbers.
fn check_words(settings: &Settings) {
    let Settings { matching, validate, surfaces, ground, obstacles, map, health, .. } = settings;
    fn told(stage: &'static str, settings: &impl std::fmt::Debug, checked: Result<(), ConfigError>) {
        match checked {
            Ok(()) => {
                let all = format!("{settings:?}");
                assert!(!all.contains("NaN") && !all.contains("inf"), "taken: {all}");
            }
            Err(error) => {
                let words = error.to_string();
                assert!(error.field.starts_with(stage) && error.field.as_bytes()[stage.len()] == b'.', "{words}");
                assert!(words.starts_with(error.field) && words.len() > error.field.len() + 8, "{words}");
            }
        }
    }
    told("matching", matching, matching.check());
    told("validate", validate, validate.check());
    told("surfaces", surfaces, surfaces.check());
    told("ground", ground, ground.check());
    told("obstacles", obstacles, obstacles.check());
    told("map", map, map.check(CELLS));
    told("health", health, health.check());
    told("cost_map", &settings.cost_map, settings.cost_map.check());
    told("ground_deviation", &settings.ground_deviation, settings.ground_deviation.check());
    told("disparity_segments", &settings.disparity_segments, settings.disparity_segments.check());
    told("pixel_normals", &settings.pixel_normals, settings.pixel_normals.check());
    told("confidence", &settings.confidence, settings.confidence.check());
}
