//! Values by themselves, against the same in f64 or in words.

use fencepost_core::{
    disparity::{DisparityPicture, DisparityPixel, Reason},
    geometry::{DepthTable, Mount, Place, RectifiedPair, VehicleFrame},
    ground::GroundPlane,
    health::{Debounce, Findings, Health, HealthLevel, HealthReason},
    map::MapGeometry,
    planes::{MIN_RELATIVE_GAP, Scatter, SymmetricMatrix3},
};

use crate::Source;

/// A number of any size, or one of a few, so that entries are alike.
fn number(source: &mut Source<'_>) -> f32 {
    let any = source.any_number(-4.0, 4.0);
    source.one_of(&[any, any, 0.0, 1.0, -1.0, 1.0e-3, 2.5])
}

/// Any matrix has the eigenvalues that its trace and its norm ask for, and vectors that it only stretches, or is no matrix of numbers.
pub(crate) fn check_eigen(source: &mut Source<'_>) {
    let scale = source.one_of(&[1.0, 1.0, 1.0e-30, 1.0e30, 1.0e-42, f32::MAX]);
    let [a, b, c, d, e, f] = [0; 6].map(|_| number(source));
    // Any, all but a multiple of one, that of a plane or a line, and nothing.
    let small = source.one_of(&[0.0, 1.0e-7, 1.0e-4, 3.0e-3]);
    let [xx, xy, xz, yy, yz, zz] = match source.below(6) {
        0 => [a, small * b, small * c, a + small * d, small * e, a + small * f],
        1 => [a * a + small, a * b, a * c, b * b + small, b * c, c * c + small],
        2 => [0.0; 6],
        _ => [a, b, c, d, e, f],
    }
    .map(|entry| entry * scale);
    let matrix = SymmetricMatrix3 { xx, xy, xz, yy, yz, zz };
    let entries = [xx, xy, xz, yy, yz, zz].map(f64::from);
    let Some(eigen) = matrix.eigen() else {
        assert!(entries.iter().any(|entry| !entry.is_finite()), "finite, but not solved: {matrix:?}");
        return;
    };
    assert!(entries.iter().all(|entry| entry.is_finite()), "solved: {matrix:?}");
    let values = eigen.values.map(f64::from);
    assert!(values[0] <= values[1] && values[1] <= values[2], "{eigen:?}");
    let [a, b, c, d, e, f] = entries;
    let rows = [[a, b, c], [b, d, e], [c, e, f]];
    let squares: f64 = rows.iter().flatten().map(|entry| entry * entry).sum();
    let largest = squares.sqrt();
    // At both ends of the numbers they are cut off, or lose their digits.
    let is_usual = largest < 1.0e38 && largest > 1.0e-30;
    if is_usual {
        let trace = a + d + f;
        assert!((values.iter().sum::<f64>() - trace).abs() <= 4.0e-5 * largest, "{eigen:?}, trace {trace}");
        let of_values: f64 = values.iter().map(|value| value * value).sum();
        assert!((of_values - squares).abs() <= 8.0e-5 * squares, "{eigen:?}, squares {squares}");
        // How far they lie apart, which the squares of large ones would hide.
        let mean = trace / 3.0;
        let apart = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>().sqrt();
        let diagonal = [a, d, f].iter().map(|entry| (entry - mean).powi(2)).sum::<f64>();
        let expected = (diagonal + 2.0 * (b * b + c * c + e * e)).sqrt();
        assert!((apart - expected).abs() <= 1.0e-4 * largest, "{eigen:?}, {apart} apart, not {expected}");
    }
    let vectors = [(eigen.smallest, values[0], eigen.lower_gap()), (eigen.largest, values[2], eigen.upper_gap())];
    for (vector, value, gap) in vectors {
        if is_usual {
            let (least, most) = (MIN_RELATIVE_GAP - 3.0e-5, MIN_RELATIVE_GAP + 3.0e-5);
            assert!(vector.is_some() || gap < most, "no vector at a gap of {gap}: {matrix:?}");
            assert!(vector.is_none() || gap > least, "a vector at a gap of {gap}: {matrix:?}");
        }
        let Some(vector) = vector.map(|vector| vector.map(f64::from)) else { continue };
        let length = dot(vector, vector).sqrt();
        assert!((length - 1.0).abs() < 1.0e-5, "a vector of length {length}: {matrix:?}");
        for (row, part) in rows.iter().zip(vector) {
            let off = (dot(*row, vector) - value * part).abs();
            assert!(off <= 5.0e-4 * largest || !is_usual, "off by {off}: {matrix:?}, {eigen:?}");
        }
    }
    if let (Some(smallest), Some(largest)) = (eigen.smallest, eigen.largest) {
        let along = dot(smallest.map(f64::from), largest.map(f64::from));
        assert!(along.abs() < 4.0e-4, "not across each other: {eigen:?}");
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// Two sets of points joined have the moments of all of them; a plane has an upright unit normal.
pub(crate) fn check_scatter(source: &mut Source<'_>) {
    let sets = [0; 2].map(|_| {
        let count = source.below(6);
        let points: Vec<[f64; 3]> = (0..count).map(|_| [0; 3].map(|_| f64::from(source.within(-8.0, 8.0)))).collect();
        points
    });
    let [a, b] = sets.each_ref().map(|points| moments(points));
    let joined = a.joined(&b);
    let all = moments(&sets.concat());
    assert_eq!(joined.weight, all.weight);
    if all.weight == 0.0 {
        assert_eq!(joined, a, "nothing and nothing");
        return;
    }
    let near = |a: f32, b: f32| (a - b).abs() < 1.0e-3;
    assert!((0..3).all(|i| near(joined.mean_m[i], all.mean_m[i])), "{joined:?}, not {all:?}");
    let entries = |s: &Scatter| {
        let c = &s.covariance;
        [c.xx, c.xy, c.xz, c.yy, c.yz, c.zz]
    };
    assert!(entries(&joined).iter().zip(entries(&all)).all(|(a, b)| near(*a, b)), "{joined:?}, not {all:?}");
    if let Some((normal, variance)) = joined.plane() {
        let length = dot(normal.map(f64::from), normal.map(f64::from)).sqrt();
        assert!((length - 1.0).abs() < 1.0e-5 && normal[2] >= 0.0 && variance >= 0.0, "{normal:?}, {variance}");
        assert!((joined.variance_along(normal) - variance).abs() < 1.0e-2, "{joined:?}: {variance}");
    }
}

fn moments(points: &[[f64; 3]]) -> Scatter {
    let n = points.len().max(1) as f64;
    let mean = [0, 1, 2].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / n);
    let of = |i: usize, j: usize| (points.iter().map(|p| (p[i] - mean[i]) * (p[j] - mean[j])).sum::<f64>() / n) as f32;
    let [xx, xy, xz, yy, yz, zz] = [of(0, 0), of(0, 1), of(0, 2), of(1, 1), of(1, 2), of(2, 2)];
    let covariance = SymmetricMatrix3 { xx, xy, xz, yy, yz, zz };
    Scatter { weight: points.len() as f32, mean_m: mean.map(|m| m as f32), covariance }
}

/// Sixteen bits are a disparity or a reason; rows are those that are whole; distances are those of the rays.
pub(crate) fn check_pixels(source: &mut Source<'_>) {
    let word = source.word();
    let made = DisparityPixel::from_steps(word);
    let is_disparity = (1..0x8000).contains(&word);
    assert_eq!((made.has_value(), made.steps()), (is_disparity, if is_disparity { word } else { 0 }));
    assert!(is_disparity || made == DisparityPixel::none(Reason::OutOfRange), "{made:?}");
    let pixel = DisparityPixel::from_bits(word);
    let expected = match word {
        0 => Err(Reason::OutOfRange),
        1..0x8000 => Ok(f64::from(word) / 16.0),
        _ => Err(Reason::ALL.get(usize::from(word - 0x8000)).copied().unwrap_or(Reason::OutsideValidArea)),
    };
    assert_eq!(pixel.get().map(f64::from), expected);
    assert_eq!((pixel.bits(), pixel.has_value()), (word, expected.is_ok()));
    for (code, reason) in Reason::ALL.iter().enumerate() {
        let pixel = DisparityPixel::none(*reason);
        assert_eq!((pixel.get(), pixel.bits()), (Err(*reason), 0x8000 + code as u16), "{}", reason.name());
    }

    let pixels = vec![pixel; source.below(60)];
    let width = source.one_of(&[0, 1, 7, 16, 59, 61, usize::MAX]);
    let picture = DisparityPicture::new(&pixels, width);
    let height = pixels.len().checked_div(width).unwrap_or(0);
    assert_eq!(
        (picture.width(), picture.height(), picture.pixels().len()),
        (width, height, width.saturating_mul(height))
    );
    for y in [0, height.saturating_sub(1), height, usize::MAX] {
        let expected = if y < height { width } else { 0 };
        assert_eq!(picture.row(y).len(), expected, "row {y} of {height}");
    }

    let pair = RectifiedPair {
        width: 64,
        height: 48,
        focal_px: source.any_number(1.0, 100.0),
        cx: source.any_number(-10.0, 100.0),
        cy: source.any_number(-10.0, 100.0),
        baseline_m: source.any_number(0.01, 2.0),
        disparity_offset_px: source.any_number(-20.0, 20.0),
    };
    if let Err(error) = pair.check() {
        assert!(error.field.starts_with("calibration."), "{error}");
        return;
    }
    let mut table = DepthTable::<8>::new();
    let (first, count) = (source.one_of(&[0, 1, 5, 100, 2046, 4000]), source.below(12) as u16);
    assert_eq!((table.covered(), table.distance_m(word)), (0..0, 0.0), "a table that is not filled");
    table.configure(&pair, first, count);
    let steps = source.one_of(&[word, word % 256, 0, 1, 16, 15]);
    let disparity = f64::from(steps) / 16.0;
    let sum = disparity + f64::from(pair.disparity_offset_px);
    let distance = f64::from(pair.focal_px) * f64::from(pair.baseline_m) / sum;
    let end = 16 * (u32::from(first) + u32::from(count.min(8)));
    let in_table = steps > 0 && (16 * u32::from(first)..end).contains(&u32::from(steps));
    let told = f64::from(table.distance_m(steps));
    let covered = table.covered();
    assert!(steps >= 0x8000 || covered.contains(&steps) == (told > 0.0), "{steps} of {covered:?}");
    assert!(told == 0.0 || (in_table && sum > 0.0), "{told} m at {disparity}");
    assert!(told == 0.0 || (told - distance).abs() <= 2.0e-3 * distance, "{told} m at {disparity}, not {distance}");
    // Where rays all but meet nowhere, the distance may be beyond the numbers.
    let of_pair = pair.distance_m(disparity as f32);
    let meet = disparity as f32 + pair.disparity_offset_px > 0.0;
    assert!(of_pair > 0.0 && (of_pair.is_finite() == meet || distance.abs() > 1.0e38), "{of_pair} m at {sum} px");
}

/// Cells have one place in the table, and places one cell.
pub(crate) fn check_cells(source: &mut Source<'_>) {
    let geometry = MapGeometry {
        cell_size_mm: source.word(),
        x_first: source.word() as i16,
        x_count: source.one_of(&[0, 1, 7, 64, 300, u16::MAX]),
        y_first: source.word() as i16,
        y_count: source.one_of(&[0, 1, 7, 64, 300, u16::MAX]),
    };
    assert_eq!(geometry.is_empty(), geometry.x_count == 0 || geometry.y_count == 0);
    let (i, j) = (source.word() as i16, source.word() as i16);
    let within = |at: i16, first: i16, count: u16| (0..i32::from(count)).contains(&(i32::from(at) - i32::from(first)));
    let inside = within(i, geometry.x_first, geometry.x_count) && within(j, geometry.y_first, geometry.y_count);
    match geometry.index(i, j) {
        Some(index) => {
            assert!(inside && index < geometry.len(), "{index} in {geometry:?}");
            // Cells beyond the numbers of cells have none of their own.
            let last = |first: i16, count: u16| i32::from(first) + i32::from(count) - 1 <= i32::from(i16::MAX);
            let all = last(geometry.x_first, geometry.x_count) && last(geometry.y_first, geometry.y_count);
            assert!(!all || geometry.cell_at(index) == (i, j), "{index} in {geometry:?}");
        }
        None => assert!(!inside, "{i}, {j} in {geometry:?}"),
    }
    let any = source.double_word() as usize;
    let (i, j) = geometry.cell_at(any);
    let (x, y) = geometry.centre_m(i, j);
    assert!(x.is_finite() && y.is_finite());
}

/// What is turned and moved comes back, and a plane is as high as before.
pub(crate) fn check_places(source: &mut Source<'_>) {
    let mount = Mount {
        height_m: source.flag().then_some(source.any_number(0.02, 20.0)),
        pitch_down_deg: source.any_number(-60.0, 89.0),
        roll_deg: source.any_number(-60.0, 60.0),
        forward_m: source.any_number(-50.0, 50.0),
        left_m: source.any_number(-50.0, 50.0),
        yaw_left_deg: source.any_number(-180.0, 180.0),
    };
    let frame = match VehicleFrame::new(&mount) {
        Ok(frame) => frame,
        Err(error) => {
            assert!(error.field.starts_with("mount.") && mount.check() == Err(error), "{error}");
            return;
        }
    };
    let rows = frame.rows().map(|row| row.map(f64::from));
    for i in 0..3 {
        for j in 0..3 {
            let expected = f64::from(u8::from(i == j));
            assert!((dot(rows[i], rows[j]) - expected).abs() < 1.0e-5, "no rotation: {mount:?}");
        }
    }
    let v = [0; 3].map(|_| source.within(-9.0, 9.0));
    let back = frame.to_camera(frame.direction(v));
    assert!((0..3).all(|i| (back[i] - v[i]).abs() < 1.0e-4), "{v:?} became {back:?}: {mount:?}");
    let place = Place::new(&mount);
    let [x, y] = place.to_pair(place.to_vehicle([v[0], v[1]]));
    assert!((x - v[0]).abs() < 1.0e-3 && (y - v[1]).abs() < 1.0e-3, "{v:?} became {x}, {y}: {mount:?}");
    let turned = f64::from(place.yaw_left_rad()).to_degrees() - f64::from(mount.yaw_left_deg);
    assert!(turned.abs() < 1.0e-3 || (turned.abs() - 360.0).abs() < 1.0e-3, "{turned}");
    // The level that the mount promises, and the same tilted.
    let own = VehicleFrame::new(&mount.without_place()).expect("the same angles");
    let level = GroundPlane::of_mount(&own);
    let tilted = GroundPlane { normal: [0.6, 0.0, 0.8], offset_m: v[2], ..level };
    for plane in [level, tilted] {
        let moved = plane.moved(&place);
        let [x, y] = place.to_vehicle([v[0], v[1]]);
        let (before, after) = (plane.height_m(v), moved.height_m([x, y, v[2]]));
        assert!((before - after).abs() < 1.0e-3, "{before} m became {after} m: {mount:?}");
    }
}

/// A reason is told only if it was found, at once if it is plain or told already, and not for longer than it is held.
pub(crate) fn check_reasons(source: &mut Source<'_>) {
    const LEVELS: [HealthLevel; 4] = [HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind, HealthLevel::Fault];
    let (trigger, release) = (source.below(4) as u8, source.below(4) as u8);
    let mut debounce = Debounce::new(trigger, release);
    // For each reason: for how long it was found in a row, and for how long not.
    let (mut found_for, mut gone_for) = ([0; HealthReason::ALL.len()], [0; HealthReason::ALL.len()]);
    let mut before = Health::OK;
    while !source.is_empty() {
        let mut findings = Findings::NONE;
        let mut expected = Health::OK;
        for _ in 0..source.below(4) {
            let (reason, level) = (source.one_of(&HealthReason::ALL), source.one_of(&LEVELS));
            findings.raise(reason, level);
            assert!(findings.level(reason) >= level);
            if level > HealthLevel::Ok {
                expected = expected.and(Health { level, reasons: 1 << reason as u8 });
            }
        }
        assert_eq!(findings.health(), expected);
        if source.below(8) == 7 {
            debounce.interrupt();
            found_for = [0; HealthReason::ALL.len()];
            gone_for = found_for;
            assert_eq!(debounce.told(), before, "what is told goes on");
        }
        let told = debounce.update(&findings);
        assert_eq!(debounce.told(), told);
        for (i, reason) in HealthReason::ALL.into_iter().enumerate() {
            let found = findings.level(reason) > HealthLevel::Ok;
            (found_for[i], gone_for[i]) = if found { (found_for[i] + 1, 0) } else { (0, gone_for[i] + 1) };
            let (was, is) = (before.has(reason), told.has(reason));
            let enough = was || reason.is_plain() || found_for[i] >= u32::from(trigger.max(1));
            assert!(!found || is == enough, "{reason:?} found for {} of {trigger}: {is}", found_for[i]);
            assert!(found || !is || was, "{reason:?} was never found");
            // Counted is from when something milder than what is told was found.
            assert!(found || !is || gone_for[i] < u32::from(release.max(1)), "{reason:?}, gone for {}", gone_for[i]);
            assert!(!(found && is) || told.level >= findings.level(reason), "{reason:?} is told too mildly");
            assert!(!reason.name().is_empty() && !reason.describe().is_empty());
        }
        before = told;
    }
}
