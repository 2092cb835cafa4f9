//! Cuts against known borders, eigenpairs against a dense solution.

use fencepost_core::{
    disparity::{DisparityPicture, DisparityPixel, Reason},
    map::CellState,
    picture::Picture,
    surfaces::SurfaceClass,
};
use nalgebra::{DMatrix, SymmetricEigen};

use super::{eigen::smallest, *};

const WIDTH: usize = 48;
const HEIGHT: usize = 32;

/// The whole picture is cut, pixel by pixel.
fn settings() -> NormalizedCutSettings {
    NormalizedCutSettings { width_px: 640, min_pixels: 20, ..NormalizedCutSettings::default() }
}

fn shrunk(width: usize, grey: impl Fn(usize, usize) -> f64, disparity: impl Fn(usize, usize) -> Option<f64>) -> Shrunk {
    let height = HEIGHT * width / WIDTH;
    let places = || (0..width * height).map(|i| (i % width, i / width));
    Shrunk {
        width,
        height,
        factor: 1,
        grey: places().map(|(x, y)| grey(x, y)).collect(),
        disparity_px: places().map(|(x, y)| disparity(x, y)).collect(),
    }
}

/// Noise between -1 and 1 that is always the same.
fn noise(x: usize, y: usize) -> f64 {
    let mixed = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2c1b_3c6d);
    f64::from((mixed ^ (mixed >> 13)) >> 8) / f64::from(1 << 23) - 1.0
}

/// Segments of a picture, and how many of its pixels lie in the segment that holds most of their region.
fn cut(picture: &Shrunk, settings: &NormalizedCutSettings, region: impl Fn(usize, usize) -> usize) -> (usize, usize) {
    let numbers = cut::segments(&Graph::of(picture, settings), settings);
    let count = numbers.iter().max().map_or(0, |last| usize::from(*last) + 1);
    let mut common = vec![[0; 8]; count];
    for (i, number) in numbers.iter().enumerate() {
        common[usize::from(*number)][region(i % picture.width, i / picture.width)] += 1;
    }
    (count, common.iter().map(|regions| regions.iter().max().unwrap()).sum())
}

#[test]
fn clear_regions_are_cut_at_their_borders() {
    // Three greys: the left third, and of the rest the upper and the lower half.
    let region = |x: usize, y: usize| if x < 16 { 0 } else { 1 + usize::from(y >= 14) };
    let grey = |x, y| [40.0, 120.0, 200.0][region(x, y)] + 6.0 * noise(x, y);
    let picture = shrunk(WIDTH, grey, |_, _| None);
    assert_eq!(cut(&picture, &settings(), region), (3, WIDTH * HEIGHT), "by grey values");
    // One grey, three disparities.
    let disparity = |x, y| Some([4.0, 9.0, 15.0][region(x, y)] + 0.2 * noise(x, y));
    let picture = shrunk(WIDTH, |x, y| 100.0 + 6.0 * noise(x, y), disparity);
    assert_eq!(cut(&picture, &settings(), region), (3, WIDTH * HEIGHT), "by disparities");
}

#[test]
fn a_picture_of_one_region_is_not_cut() {
    let even = shrunk(WIDTH, |_, _| 100.0, |_, _| Some(8.0));
    let small = NormalizedCutSettings { max_cut: 0.03, ..settings() };
    assert_eq!(cut(&even, &small, |_, _| 0).0, 1);
    // Nor where the limits forbid it.
    let halves = shrunk(WIDTH, |x, _| if x < 24 { 0.0 } else { 255.0 }, |_, _| None);
    assert_eq!(cut(&halves, &settings(), |x, _| usize::from(x >= 24)), (2, WIDTH * HEIGHT));
    assert_eq!(cut(&halves, &NormalizedCutSettings { max_segments: 1, ..settings() }, |_, _| 0).0, 1);
    assert_eq!(cut(&halves, &NormalizedCutSettings { min_pixels: 800, ..settings() }, |_, _| 0).0, 1);
}

#[test]
fn pieces_with_nothing_in_common_are_cut_apart() {
    // The affinity across the border is too small to be kept: the graph falls apart by itself.
    let picture = shrunk(WIDTH, |x, _| if x < 30 { 0.0 } else { 255.0 }, |_, _| None);
    let graph = Graph::of(&picture, &settings());
    assert!(graph.row(5 * WIDTH + 29).all(|(other, _)| other % WIDTH < 30), "nothing in common");
    let cut = cut::best_of(&graph, 20).unwrap();
    assert!(cut.value < 1.0e-9, "{}", cut.value);
    assert!((0..graph.len()).all(|i| cut.in_a[i] == cut.in_a[0] || i % WIDTH >= 30));
}

/// The normalized Laplacian by its definition.
fn laplacian(graph: &Graph) -> DMatrix<f64> {
    let mut matrix = DMatrix::<f64>::identity(graph.len(), graph.len());
    for i in 0..graph.len() {
        for (j, weight) in graph.row(i) {
            let of = |node: usize| graph.row(node).map(|(_, weight)| weight).sum::<f64>();
            matrix[(i, j)] -= weight / (of(i) * of(j)).sqrt();
        }
    }
    matrix
}

#[test]
fn eigenpairs_are_those_of_a_dense_solution() {
    // Once few enough nodes for the whole matrix, once too many.
    for width in [12, 24] {
        let grey = |x: usize, y: usize| if 2 * x < width { 60.0 } else { 95.0 } + 8.0 * noise(x, y);
        let graph = Graph::of(&shrunk(width, grey, |_, _| None), &settings());
        let matrix = laplacian(&graph);
        let mut expected: Vec<f64> = SymmetricEigen::new(matrix.clone()).eigenvalues.iter().copied().collect();
        expected.sort_by(f64::total_cmp);
        let pairs = smallest(&graph, 4);
        assert_eq!(pairs.len(), 4, "{} nodes", graph.len());
        for (pair, expected) in pairs.iter().zip(expected) {
            let vector = nalgebra::DVector::from_column_slice(&pair.vector);
            assert!((vector.norm() - 1.0).abs() < 1.0e-9, "a unit vector: {}", vector.norm());
            let rest = (&matrix * &vector - &vector * pair.value).norm();
            assert!(rest < 1.0e-5, "{} nodes, value {}: {rest}", graph.len(), pair.value);
            assert!((pair.value - expected).abs() < 1.0e-8, "{} for {expected}", pair.value);
        }
    }
}

#[test]
fn a_part_of_a_graph_keeps_what_its_nodes_have_in_common() {
    let graph = Graph::of(&shrunk(WIDTH, |x, y| 100.0 + 30.0 * noise(x, y), |_, _| None), &settings());
    let nodes: Vec<usize> = (0..graph.len()).filter(|i| i % 3 != 1).collect();
    let part = graph.part(&nodes);
    assert_eq!(part.len(), nodes.len());
    for (new, old) in nodes.iter().enumerate() {
        let expected: Vec<_> = graph.row(*old).filter(|(other, _)| other % 3 != 1).map(|(_, weight)| weight).collect();
        let found: Vec<_> = part.row(new).map(|(_, weight)| weight).collect();
        assert_eq!(found, expected);
        assert!((part.degrees[new] - expected.iter().sum::<f64>()).abs() < 1.0e-12);
        assert!(part.row(new).all(|(other, _)| other < nodes.len()));
    }
}

#[test]
fn pictures_shrink_by_means_and_medians() {
    let grey: Vec<u8> = (0..10 * 5).map(|i| (i % 10 * 10) as u8).collect();
    let pixels: Vec<DisparityPixel> = (0..10 * 5)
        .map(|i| match i % 10 {
            // Two of sixteen pixels are too few, four are enough; the median leaves out what is far off.
            0..=3 if i / 10 > 0 || i % 10 > 1 => DisparityPixel::none(Reason::LowTexture),
            4..=6 => DisparityPixel::from_steps(80),
            7 => DisparityPixel::from_steps(800),
            8..=9 if i / 10 == 0 => DisparityPixel::from_steps(32),
            8..=9 => DisparityPixel::none(Reason::NotUnique),
            _ => DisparityPixel::from_steps(16),
        })
        .collect();
    let shrunk = Shrunk::new(&Picture::packed(&grey, 10, 5).unwrap(), DisparityPicture::new(&pixels, 10), 3);
    assert_eq!((shrunk.width, shrunk.height, shrunk.factor), (3, 2, 4));
    assert_eq!(shrunk.grey, [15.0, 55.0, 85.0, 15.0, 55.0, 85.0]);
    assert_eq!(shrunk.disparity_px, [None, Some(5.0), Some(2.0), None, Some(5.0), None]);
    assert_eq!((shrunk.place_of(9, 3), shrunk.place_of(4, 4)), (2, 4));
}

/// Level ground below a camera 1 m up, and a box on it, 2 m ahead and 0.6 m high.
fn ground_and_box() -> (NormalizedCuts, Vec<u8>, Vec<DisparityPixel>) {
    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;
    let pair = RectifiedPair {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        focal_px: 130.0,
        cx: 79.5,
        cy: 20.0,
        baseline_m: 0.12,
        disparity_offset_px: 0.0,
    };
    let mount = Mount { height_m: Some(1.0), ..Mount::default() };
    let core = Settings::default();
    let cuts = NormalizedCuts::new(&NormalizedCutSettings::default(), &core, &pair, &mount, None).unwrap();
    let is_box = |x: usize, y: usize| (60..100).contains(&x) && (46..=85).contains(&y);
    let pixel = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        // f b / z, with z = f h / (y - cy) on the ground.
        let disparity_px = if is_box(x, y) { 130.0 * 0.12 / 2.0 } else { 0.12 * (y as f64 - 20.0) };
        let seen = is_box(x, y) || y > 32;
        if seen {
            DisparityPixel::from_steps((16.0 * disparity_px) as u16)
        } else {
            DisparityPixel::none(Reason::LowTexture)
        }
    };
    let grey = |i: usize| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        let mean = if is_box(x, y) {
            60.0
        } else if y > 20 {
            130.0
        } else {
            220.0
        };
        (mean + 5.0 * noise(x, y)) as u8
    };
    (cuts, (0..WIDTH * HEIGHT).map(grey).collect(), (0..WIDTH * HEIGHT).map(pixel).collect())
}

#[test]
fn a_box_on_the_ground_is_an_obstacle_and_the_ground_is_free() {
    let (cuts, grey, pixels) = ground_and_box();
    let left = Picture::packed(&grey, 160, 120).unwrap();
    let found = cuts.run(&left, DisparityPicture::new(&pixels, 160));
    let class = |x, y| found.surface_at(x, y).map(|surface| surface.class);
    assert_eq!(class(80, 60), Some(SurfaceClass::Obstacle));
    assert_eq!(class(20, 100), Some(SurfaceClass::Ground));
    assert_eq!(class(80, 5), None, "the sky");
    let segment = &found.segments[usize::from(found.label_at(80, 60).unwrap())];
    assert!((1500..1700).contains(&segment.pixels), "the box has 1600 pixels: {segment:?}");
    assert_eq!(segment.surface.class, SurfaceClass::Vertical);
    let ground = found.detection.ground.unwrap();
    assert!((ground.camera_height_m - 1.0).abs() < 0.03, "{ground:?}");
    let map = &found.detection.map;
    let at = |i, j| map.cells[map.geometry.index(i, j).unwrap()].state;
    assert_eq!([at(4, 0), at(4, -1)].map(|state| state == CellState::Obstacle), [true; 2], "2 m ahead");
    assert!(map.cells.iter().filter(|cell| cell.state == CellState::Free).count() > 20);
    assert!(found.detection.obstacles.iter().any(|o| (o.mean_m[0] - 2.0).abs() < 0.1 && o.max_m[2] > 0.6));

    // The same again.
    let again = cuts.run(&left, DisparityPicture::new(&pixels, 160));
    assert_eq!(found.labels, again.labels);
    assert_eq!(found.segments, again.segments);
    assert_eq!(found.detection.map.cells, again.detection.map.cells);
}

#[test]
fn settings_that_cannot_be_used_are_named() {
    let good = NormalizedCutSettings::default();
    assert_eq!(good.check(), Ok(()));
    let name = |bad: NormalizedCutSettings| bad.check().unwrap_err().field;
    assert_eq!(name(NormalizedCutSettings { width_px: 8, ..good }), "normalized_cuts.width_px");
    assert_eq!(name(NormalizedCutSettings { radius_px: 0, ..good }), "normalized_cuts.radius_px");
    assert_eq!(name(NormalizedCutSettings { grey_scale: 0.0, ..good }), "normalized_cuts.grey_scale");
    assert_eq!(name(NormalizedCutSettings { max_cut: 3.0, ..good }), "normalized_cuts.max_cut");
    assert_eq!(name(NormalizedCutSettings { max_segments: 0, ..good }), "normalized_cuts.max_segments");
}
