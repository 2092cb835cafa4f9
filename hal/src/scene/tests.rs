//! The scene against what geometry says about it.

use fencepost_core::geometry::{RawPair, StereoCalibration, VehicleFrame};
use fencepost_core::map::{Cell, CellState, MapGeometry};

use super::ground::Ground;
use super::mesh::{Material, Mesh};
use super::optics::{Eye, Pose};
use super::parallel::for_each_chunk_on;
use super::vector::{V3, v3};
use super::*;
use crate::camera::Camera;

fn small() -> SceneOptions {
    SceneOptions { width: 160, height: 120, focal_px: 131.0, ..SceneOptions::default() }
}

/// Level ground without bumps, and what `furnish` puts on it.
fn bare(options: SceneOptions, furnish: impl FnOnce(&mut Mesh, Pose)) -> Scene {
    let ground = Ground::new(&options);
    let mut mesh = Mesh::default();
    furnish(&mut mesh, Pose::new(&ground, 0.0));
    Scene::of(options, ground, mesh).unwrap()
}

fn smooth() -> SceneOptions {
    SceneOptions { roughness: 0.0, ..small() }
}

/// A box in the vehicle frame of the first frame.
fn slab(mesh: &mut Mesh, pose: Pose, low: [f32; 3], high: [f32; 3]) {
    let (low, high) = (V3::from(low), V3::from(high));
    let half = (high - low) * 0.5;
    let middle = pose.origin + pose.to_world(low + half);
    mesh.begin(V3::UP, true);
    let sides = [pose.forward * half.x, pose.left * half.y, pose.up * half.z];
    mesh.slab(middle, sides, Material::Plaster, 1.0);
}

/// FNV-1a, 64 bits.
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn the_same_bytes_everywhere() {
    let options = SceneOptions {
        width: 96,
        height: 72,
        focal_px: 79.0,
        distortion: Some(SceneOptions::USUAL_DISTORTION),
        misalignment: Some(SceneOptions::USUAL_MISALIGNMENT),
        roll_deg: 2.0,
        slope_deg: 4.0,
        ..SceneOptions::default()
    };
    let scene = Scene::new(options).unwrap();
    let (pair, truth) = (scene.render(2), scene.truth(2));
    assert_eq!(pair, Scene::new(options).unwrap().render(2), "a second scene");
    let disparity: Vec<u8> = truth.disparity.iter().flat_map(|d| d.to_le_bytes()).collect();
    let found = [&pair.left, &pair.right, &disparity].map(|bytes| fingerprint(bytes));
    // Changes with every change to the scene: then look at the pictures, and put the new values here.
    let golden = [0xd2a8_dd94_edd4_e465, 0x2206_729a_89ea_4173, 0xc677_f165_9116_9d2c];
    assert_eq!(found.map(|f| format!("{f:#x}")), golden.map(|f: u64| format!("{f:#x}")));
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let work = |index: usize, piece: &mut [u32]| {
        for (i, value) in piece.iter_mut().enumerate() {
            *value += (index * 1000 + i) as u32;
        }
    };
    let mut expected: Vec<u32> = (0..103).collect();
    for (i, piece) in expected.chunks_mut(7).enumerate() {
        work(i, piece);
    }
    for threads in [1, 2, 3, 8, 40] {
        let mut data: Vec<u32> = (0..103).collect();
        for_each_chunk_on(threads, &mut data, 7, work);
        assert_eq!(data, expected, "{threads} threads");
    }
}

#[test]
fn level_ground_has_the_disparity_of_a_plane() {
    for (pitch_down_deg, roll_deg) in [(10.0, 0.0), (18.0, 0.0), (12.0, 7.0)] {
        let options = SceneOptions { pitch_down_deg, roll_deg, ..smooth() };
        let scene = bare(options, |_, _| {});
        let truth = scene.truth(0);
        let pair = options.ideal_pair();
        // The unit vector up, seen by a camera that is pitched and then rolled, in double precision.
        let (pitch, roll) = (f64::from(pitch_down_deg).to_radians(), f64::from(roll_deg).to_radians());
        let up = [-pitch.cos() * roll.sin(), -pitch.cos() * roll.cos(), -pitch.sin()];
        let mut compared = 0;
        for (index, disparity) in truth.disparity.iter().enumerate() {
            let (x, y) = (index % options.width as usize, index / options.width as usize);
            let f = f64::from(pair.focal_px);
            let (a, b) = ((x as f64 - f64::from(pair.cx)) / f, (y as f64 - f64::from(pair.cy)) / f);
            let falling = -(up[0] * a + up[1] * b + up[2]);
            let depth_m = f64::from(options.mount_height_m) / falling;
            // The ridges stand beyond the ground's end.
            if falling <= 0.0 || depth_m > 100.0 {
                continue;
            }
            let expected = f * f64::from(pair.baseline_m) / depth_m;
            let found = f64::from(*disparity) / 256.0;
            assert!((found - expected).abs() < 0.004 + 0.001 * expected, "({x}, {y}): {found} for {expected}");
            assert!(!truth.occluded[index] || x as f64 - expected < 0.01, "({x}, {y}) is in plain view");
            compared += 1;
        }
        assert!(compared > 8000, "{compared} pixels");
    }
}

#[test]
fn truth_leads_from_the_left_picture_to_the_right_one() {
    let options =
        SceneOptions { width: 320, height: 240, focal_px: 262.0, noise_sigma: 0.0, exposure_ratio: 1.0, ..small() };
    for seed in [1, 2] {
        println!("seed {seed}");
        let scene = Scene::new(SceneOptions { seed, ..options }).unwrap();
        let (pair, truth) = (scene.render(3), scene.truth(3));
        let width = options.width as usize;
        let mean_difference = |error_px: f32| {
            let (mut sum, mut count) = (0.0, 0);
            for (index, disparity) in truth.disparity.iter().enumerate() {
                let x = (index % width) as f32 - f32::from(*disparity) / 256.0 + error_px;
                if *disparity < 3 * 256 || truth.occluded[index] || x < 0.0 || x >= (width - 1) as f32 {
                    continue;
                }
                let row = &pair.right[index - index % width..][..width];
                let (i, part) = (x as usize, x - x.floor());
                let right = f32::from(row[i]) * (1.0 - part) + f32::from(row[i + 1]) * part;
                sum += (f32::from(pair.left[index]) - right).abs();
                count += 1;
            }
            assert!(count > 40_000, "{count} pixels");
            sum / count as f32
        };
        let (true_one, wrong) = (mean_difference(0.0), mean_difference(1.5));
        println!("mean difference {true_one} grey values, {wrong} at a disparity 1.5 px too small");
        assert!(true_one < 4.0 && true_one < 0.45 * wrong, "{true_one}, {wrong}");
        for error_px in [-0.3, 0.3] {
            assert!(mean_difference(error_px) > true_one, "{error_px} px fits better");
        }
    }
}

#[test]
fn a_thing_hides_what_is_behind_it_from_the_right_camera() {
    let scene = bare(smooth(), |mesh, pose| slab(mesh, pose, [4.0, -0.3, 0.0], [4.2, 0.3, 1.4]));
    let truth = scene.truth(0);
    let pair = scene.options.ideal_pair();
    let width = pair.width as usize;
    // Left of the box, the background is hidden over the difference of the disparities; right of it, it is in view.
    let row = 58;
    let line = &truth.disparity[row * width..(row + 1) * width];
    let hidden = &truth.occluded[row * width..(row + 1) * width];
    let first = line.iter().position(|d| *d > 3 * 256).unwrap();
    let last = line.iter().rposition(|d| *d > 3 * 256).unwrap();
    let jump = f32::from(line[first] - line[first - 1]) / 256.0;
    let count = hidden[first - 6..first].iter().filter(|h| **h).count();
    assert!((count as f32 - jump).abs() <= 1.0, "{count} hidden for a jump of {jump} px");
    assert!(hidden[last + 1..last + 10].iter().all(|h| !h));
    assert!(hidden[first + 1..last].iter().all(|h| !h));
}

#[test]
fn cells_of_boxes_at_known_places() {
    let options = SceneOptions { width: 320, height: 240, focal_px: 262.0, ..smooth() };
    let scene = bare(options, |mesh, pose| {
        // An obstacle, one on its side, a step low enough to drive over, one too low to be an obstacle and too high to be
        // free, and a beam high enough to drive under.
        slab(mesh, pose, [5.1, -0.45, 0.0], [5.4, 0.45, 1.0]);
        slab(mesh, pose, [3.1, 1.1, 0.0], [3.3, 1.4, 0.36]);
        slab(mesh, pose, [3.1, -0.4, 0.0], [3.4, 0.4, 0.15]);
        slab(mesh, pose, [3.1, -1.4, 0.0], [3.3, -1.1, 0.26]);
        slab(mesh, pose, [6.1, 1.1, 2.4], [6.4, 2.9, 2.6]);
    });
    let cells = scene.truth(0).cells;
    let obstacles: Vec<_> = (0..cells.geometry.len())
        .filter(|index| cells.cells[*index] == TruthCell::Obstacle)
        .map(|index| cells.geometry.cell_at(index))
        .collect();
    assert_eq!(obstacles, [(6, 2), (10, -1), (10, 0)]);
    for (i, j) in [(6, 0), (6, -1), (5, 0), (9, 0), (12, 3), (11, 2)] {
        assert_eq!(cells.get(i, j), TruthCell::Free, "({i}, {j})");
    }
    // Neither the low block's cell, nor one behind the box, nor one beside the picture, nor one too near or too far.
    for (i, j) in [(6, -3), (11, 0), (4, 8), (2, 0), (13, 0), (400, 0)] {
        assert_eq!(cells.get(i, j), TruthCell::NotJudged, "({i}, {j})");
    }
}

#[test]
fn things_that_the_vehicle_has_driven_towards_come_nearer() {
    let options = SceneOptions { width: 320, height: 240, focal_px: 262.0, speed_m_s: 5.0, ..smooth() };
    let scene = bare(options, |mesh, pose| slab(mesh, pose, [5.1, -0.45, 0.0], [5.4, 0.45, 1.0]));
    let nearest = |frame| {
        let cells = scene.truth(frame).cells;
        let index = cells.cells.iter().position(|cell| *cell == TruthCell::Obstacle).unwrap();
        cells.geometry.cell_at(index).0
    };
    assert_eq!((nearest(0), nearest(1), nearest(4)), (10, 9, 6));
}

#[test]
fn the_slope_has_its_ten_degrees() {
    let options = SceneOptions {
        slope_deg: 10.0,
        content: Content::OpenGround,
        width: 320,
        height: 240,
        focal_px: 262.0,
        ..small()
    };
    let scene = Scene::new(options).unwrap();
    let truth = scene.truth(0);
    let (pair, frame) = (options.ideal_pair(), VehicleFrame::new(&options.mount()).unwrap());
    let mut sums = [0.0f64; 5];
    for (index, disparity) in truth.disparity.iter().enumerate().filter(|(_, d)| **d > 0) {
        let z = pair.distance_m(f32::from(*disparity) / 256.0);
        let x = (index as u32 % pair.width) as f32 - pair.cx;
        let y = (index as u32 / pair.width) as f32 - pair.cy;
        let p = frame.point([x * z / pair.focal_px, y * z / pair.focal_px, z]);
        if (4.0..9.0).contains(&p[0]) && p[1].abs() < 2.0 {
            let (x, z) = (f64::from(p[0]), f64::from(p[2]));
            for (sum, term) in sums.iter_mut().zip([1.0, x, z, x * x, x * z]) {
                *sum += term;
            }
        }
    }
    let [n, x, z, xx, xz] = sums;
    let slope_deg = ((n * xz - x * z) / (n * xx - x * x)).atan().to_degrees();
    assert!((slope_deg - 10.0).abs() < 0.7, "{slope_deg} degrees over {n} pixels");
    let obstacles = truth.cells.cells.iter().filter(|cell| **cell == TruthCell::Obstacle).count();
    let free = truth.cells.cells.iter().filter(|cell| **cell == TruthCell::Free).count();
    assert!(obstacles == 0 && free > 60, "{obstacles} obstacles, {free} free");
}

#[test]
fn on_a_hill_the_vehicle_stands_along_it() {
    let level = bare(smooth(), |_, _| {}).truth(0);
    let hill = bare(SceneOptions { slope_deg: 10.0, slope_start_m: -100.0, ..smooth() }, |_, _| {}).truth(0);
    let middle = 100 * 160 + 80;
    let (a, b) = (f32::from(level.disparity[middle]), f32::from(hill.disparity[middle]));
    assert!((a - b).abs() < 0.02 * a, "{a} on the level, {b} on the hill");
}

/// Where a raw camera sees a point of the left camera's frame: the model of OpenCV, in double precision.
fn project(raw: &RawPair, right: bool, p: [f64; 3]) -> [f64; 2] {
    let model = if right { raw.right } else { raw.left };
    let q: [f64; 3] = if right {
        core::array::from_fn(|i| {
            (0..3).map(|j| f64::from(raw.rotation[i][j]) * p[j]).sum::<f64>() + f64::from(raw.translation_m[i])
        })
    } else {
        p
    };
    let (x, y) = (q[0] / q[2], q[1] / q[2]);
    let [k1, k2, p1, p2, ..] = model.distortion.0.map(f64::from);
    let r2 = x * x + y * y;
    let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
    let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    [f64::from(model.fx) * xd + f64::from(model.cx), f64::from(model.fy) * yd + f64::from(model.cy)]
}

#[test]
fn raw_pictures_follow_their_calibration() {
    let options = SceneOptions {
        distortion: Some(SceneOptions::USUAL_DISTORTION),
        misalignment: Some(SceneOptions::USUAL_MISALIGNMENT),
        ..SceneOptions::default()
    };
    let StereoCalibration::Raw(raw) = options.calibration() else { panic!("not a raw pair") };
    let ground = Ground::new(&options);
    let frame = VehicleFrame::new(&options.mount()).unwrap();
    let pose = Pose::new(&ground, 0.3);
    let eyes = Eye::pair(&options, &frame, pose);
    let (ideal, _) = Eye::ideal_pair(&options, &frame, pose);
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|c| pose.to_world(V3::from(frame.direction(c))));
    for (side, eye) in eyes.iter().enumerate() {
        for (px, py) in
            [(0.0, 0.0), (511.0, 0.0), (0.0, 383.0), (511.0, 383.0), (255.5, 191.5), (100.25, 300.5), (400.0, 50.0)]
        {
            let q = eye.origin + eye.look(px, py) * 6.0 - ideal.origin;
            let p = axes.map(|axis| f64::from(q.dot(axis)));
            let [x, y] = project(&raw, side == 1, p);
            let off = (x - f64::from(px)).hypot(y - f64::from(py));
            assert!(off < 0.02, "camera {side}, ({px}, {py}): {off} px off");
        }
    }
    // The rectified cameras that come with it see the world as the ideal pair does.
    let rectification = raw.rectification.unwrap();
    assert_eq!(rectification.pair, options.ideal_pair());
    for i in 0..3 {
        for j in 0..3 {
            let product: f32 = (0..3).map(|k| rectification.right_rotation[i][k] * raw.rotation[k][j]).sum();
            assert!((product - f32::from(u8::from(i == j))).abs() < 1.0e-6);
        }
    }
}

#[test]
fn a_positive_turn_goes_the_way_its_name_says() {
    let turned = |about_x_deg, about_y_deg, about_z_deg| {
        let misalignment = Some(Misalignment { about_x_deg, about_y_deg, about_z_deg });
        let StereoCalibration::Raw(raw) = SceneOptions { misalignment, ..small() }.calibration() else { panic!() };
        let far = 1.0e6;
        project(&raw, true, [0.1 * far, 0.0, far])
    };
    let [x, y] = turned(0.0, 0.0, 0.0);
    assert!(turned(1.0, 0.0, 0.0)[1] > y + 1.0, "looks up: what it sees moves down");
    assert!(turned(0.0, 1.0, 0.0)[0] < x - 1.0, "looks right: what it sees moves left");
    assert!(turned(0.0, 0.0, 3.0)[1] < y - 0.5, "leans clockwise: what is on the right moves up");
}

#[test]
fn the_demonstration_is_a_picture_worth_looking_at() {
    for seed in 1..=3 {
        println!("seed {seed}");
        let options = SceneOptions { seed, ..SceneOptions::default() };
        let scene = Scene::new(options).unwrap();
        let pair = scene.render(0);
        let mean = |pixels: &[u8]| pixels.iter().map(|p| f32::from(*p)).sum::<f32>() / pixels.len() as f32;
        let (left, right) = (mean(&pair.left), mean(&pair.right));
        assert!((90.0..150.0).contains(&left), "mean {left}");
        assert!(right > left + 2.0, "the right camera is exposed longer: {left}, {right}");
        let burnt = pair.left.iter().filter(|p| **p > 252).count();
        assert!(burnt * 100 < pair.left.len(), "{burnt} white pixels");
        let cells = scene.truth(0).cells;
        let count = |kind| cells.cells.iter().filter(|cell| **cell == kind).count();
        let (obstacles, free) = (count(TruthCell::Obstacle), count(TruthCell::Free));
        assert!(obstacles >= 35 && free >= 100, "{obstacles} obstacles, {free} free");
    }
}

#[test]
fn noise_is_as_strong_as_asked_for() {
    let clean = bare(SceneOptions { noise_sigma: 0.0, ..smooth() }, |_, _| {}).render(0);
    let noisy = bare(SceneOptions { noise_sigma: 5.0, ..smooth() }, |_, _| {}).render(0);
    let square: f32 = clean.left.iter().zip(&noisy.left).map(|(a, b)| (f32::from(*a) - f32::from(*b)).powi(2)).sum();
    let sigma = (square / clean.left.len() as f32).sqrt();
    assert!((sigma - 5.0).abs() < 0.3, "{sigma}");
}

#[test]
fn the_camera_delivers_every_frame_once() {
    let options =
        SceneOptions { width: 64, height: 48, focal_px: 52.0, frames: 3, rate_hz: 20.0, ..SceneOptions::default() };
    let mut camera = Scene::new(options).unwrap().into_camera();
    let mut seen = Vec::new();
    while let Some(entry) = camera
        .next_pair(|pair| {
            assert_eq!((pair.left.width(), pair.left.height()), (64, 48));
            assert_eq!((pair.right.width(), pair.right.height()), (64, 48));
            (pair.sequence, pair.timestamp_ns, pair.left.row(20).to_vec())
        })
        .unwrap()
    {
        seen.push(entry);
    }
    assert_eq!(seen.iter().map(|s| s.0).collect::<Vec<_>>(), [0, 1, 2]);
    assert_eq!(seen.iter().map(|s| s.1).collect::<Vec<_>>(), [0, 50_000_000, 100_000_000]);
    assert_ne!(seen[0].2, seen[1].2);
    assert!(camera.next_pair(|_| ()).unwrap().is_none());
    assert_eq!(camera.into_inner().render(0).left[20 * 64..21 * 64], seen[0].2[..]);
}

#[test]
fn options_that_cannot_be_used_are_named() {
    let field = |options: SceneOptions| Scene::new(options).unwrap_err().field;
    assert_eq!(field(SceneOptions { focal_px: f32::NAN, ..small() }), "calibration.focal_px");
    assert_eq!(field(SceneOptions { width: 0, ..small() }), "calibration.width");
    assert_eq!(field(SceneOptions { baseline_m: -0.1, ..small() }), "calibration.baseline_m");
    assert_eq!(field(SceneOptions { mount_height_m: 90.0, ..small() }), "mount.height_m");
    assert_eq!(field(SceneOptions { rate_hz: 0.0, ..small() }), "scene.rate_hz");
    assert_eq!(field(SceneOptions { distortion: Some([9.0, 0.0, 0.0, 0.0]), ..small() }), "scene.distortion");
    let map = MapGeometry { cell_size_mm: 0, ..MapGeometry::default() };
    assert_eq!(field(SceneOptions { map, ..small() }), "scene.map.cell_size_mm");
}

/// A truth of free cells with an obstacle at (10, 0), and a report of the same with its obstacle at `said`.
fn report(said: Option<(i16, i16)>) -> Score {
    let geometry = MapGeometry::default();
    let mut cells = vec![TruthCell::Free; geometry.len()];
    cells[geometry.index(10, 0).unwrap()] = TruthCell::Obstacle;
    let truth = TruthCells { geometry, cells, nearest_m: 1.5, farthest_m: 12.0, aside_m: 10.0 };
    let free = Cell { state: CellState::Free, ..Cell::default() };
    let mut reported = vec![free; geometry.len()];
    if let Some((i, j)) = said {
        reported[geometry.index(i, j).unwrap()].state = CellState::Obstacle;
    }
    score(&truth, &geometry, &reported)
}

#[test]
fn the_score_allows_one_cell_of_slack() {
    let all = MapGeometry::default().len() as u32;
    let exact = report(Some((10, 0)));
    assert_eq!((exact.recall(), exact.precision(), exact.f1()), (1.0, 1.0, 1.0));
    assert_eq!((exact.obstacles, exact.free, exact.clear, exact.free_found), (1, all - 1, all - 9, all - 1));
    let beside = report(Some((11, -1)));
    assert_eq!((beside.f1(), beside.false_alarm(), beside.missed_free()), (1.0, 0.0, 0.0));
    let off = report(Some((12, 0)));
    assert_eq!((off.recall(), off.precision(), off.f1()), (0.0, 0.0, 0.0));
    assert_eq!((off.clear_called_obstacle, off.obstacles_called_free), (1, 1));
    let beyond = report(Some((40, 0)));
    assert_eq!(beyond.reported, 0, "beyond the range that is judged");
    let none = report(None);
    assert_eq!((none.recall(), none.missed_free(), none.free_found_share()), (0.0, 1.0, 1.0));
    let mut sum = exact;
    sum += none;
    assert_eq!((sum.obstacles, sum.recall(), sum.precision(), sum.f1()), (2, 0.5, 1.0, 2.0 / 3.0));
    let unknown = score(
        &TruthCells {
            geometry: MapGeometry::default(),
            cells: Vec::new(),
            nearest_m: 0.0,
            farthest_m: 9.0,
            aside_m: 9.0,
        },
        &MapGeometry::default(),
        &[],
    );
    assert_eq!(unknown, Score::default());
}

#[test]
fn rays_meet_what_a_plain_search_finds() {
    let ground = Ground::new(&smooth());
    let mut mesh = Mesh::default();
    let mut rng = noise::Rng::new(7);
    mesh.begin(V3::UP, true);
    mesh.stone(v3(3.0, 0.0, 0.5), v3(0.6, 0.5, 0.5), 8, &mut rng);
    mesh.foliage(v3(4.0, 1.0, 0.8), v3(0.6, 0.6, 0.6), 12, 10, 0.1, &mut rng);
    mesh.limb(v3(5.0, -1.0, 0.0), v3(5.0, -1.0, 3.0), (0.2, 0.1), 0.1, Material::Bark, &mut rng);
    let shapes = mesh.shapes.clone();
    let tree = bvh::Bvh::new(mesh.shapes);
    assert!(ground.height(0.0, 0.0).abs() < 1.0e-6);
    let mut met = 0;
    println!("seed 7");
    for _ in 0..3000 {
        let origin = v3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(0.2, 2.0));
        let aim = v3(rng.range(2.5, 5.5), rng.range(-1.5, 1.8), rng.range(0.0, 1.4));
        let direction = (aim - origin) * 0.3;
        // The tree of a single shape is that shape.
        let plain = shapes
            .iter()
            .filter_map(|shape| bvh::Bvh::new(vec![*shape]).nearest(origin, direction, 0.05, 50.0))
            .map(|hit| hit.t)
            .fold(f32::INFINITY, f32::min);
        let found = tree.nearest(origin, direction, 0.05, 50.0).map_or(f32::INFINITY, |hit| hit.t);
        assert_eq!(found, plain);
        assert_eq!(tree.blocks(origin, direction, 0.05, 50.0), plain.is_finite());
        met += u32::from(plain.is_finite());
    }
    assert!(met > 500, "{met} rays met something");
}

#[test]
fn slopes_lie_where_the_options_say() {
    let height = |options: &SceneOptions, x, y| Ground::new(options).height(x, y);
    let flat = |slope_deg, slope_aside_deg, slope_start_m| SceneOptions {
        slope_deg,
        slope_aside_deg,
        slope_start_m,
        ..smooth()
    };
    let tan = |deg: f32| deg.to_radians().tan();
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 2.0e-3, "{found} for {expected}");
    // The whole ground: a plane through the origin, tilted both ways, or to the side alone.
    near(height(&flat(15.0, -5.0, -100.0), 8.0, 3.0), 8.0 * tan(15.0) - 3.0 * tan(5.0));
    near(height(&flat(0.0, 5.0, 2.5), 8.0, 3.0), 3.0 * tan(5.0));
    // A slope ahead: level before an oblique line, a plane behind it (0.4 m later, for the bend).
    let ahead = flat(-10.0, 5.0, 4.0);
    near(height(&ahead, 3.0, 0.0), 0.0);
    near(height(&ahead, 9.0, 0.0), -4.6 * tan(10.0));
    near(height(&ahead, 9.0, 2.0), -4.6 * tan(10.0) + 2.0 * tan(5.0));
    // A crest: 4 m up, then down.
    let crest = SceneOptions { slope_length_m: 4.0, slope_after_deg: -10.0, ..flat(10.0, 0.0, 2.0) };
    near(height(&crest, 6.0, 1.0), 3.6 * tan(10.0));
    near(height(&crest, 12.0, 1.0), 4.0 * tan(10.0) - 5.6 * tan(10.0));
}

#[test]
fn a_vehicle_on_a_slope_sees_a_plane_below_it() {
    // Whatever the ground's tilt, the vehicle stands on it: the disparity is that of level ground.
    let disparity = |slope_deg, slope_aside_deg| {
        let options = SceneOptions { slope_deg, slope_aside_deg, slope_start_m: -100.0, ..smooth() };
        bare(options, |_, _| {}).truth(0).disparity
    };
    let level = disparity(0.0, 0.0);
    for (slope_deg, slope_aside_deg) in [(15.0, 0.0), (0.0, 5.0), (15.0, -5.0), (-15.0, 5.0)] {
        let tilted = disparity(slope_deg, slope_aside_deg);
        // A sixteenth of a pixel, within the nearest 8 m.
        let differs = level.iter().zip(&tilted).filter(|(a, b)| **a > 512 && a.abs_diff(**b) > 16).count();
        assert_eq!(differs, 0, "{slope_deg}° and {slope_aside_deg}°: pixels that differ");
    }
}
