//! Calibration files as OpenCV writes them, against the numbers that went into them; and files that are wrong.

use std::path::{Path, PathBuf};

use fencepost_core::geometry::{RawPair, RectifiedPair, StereoCalibration};
use fencepost_hal::calibration::{
    Calibration, CalibrationError, CalibrationFormat, CalibrationProblem, CalibrationWarning,
};
use serde_json::Value;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/calibration").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(file(name)).unwrap()
}

fn load(names: &[&str], pictures: Option<(u32, u32)>) -> Result<Calibration, CalibrationError> {
    let files: Vec<PathBuf> = names.iter().map(|name| file(name)).collect();
    Calibration::load(&files, pictures)
}

fn raw(calibration: &Calibration) -> &RawPair {
    match &calibration.stereo {
        StereoCalibration::Raw(pair) => pair,
        StereoCalibration::Rectified(_) => panic!("{calibration:?} is not raw"),
    }
}

fn rectified(calibration: &Calibration) -> &RectifiedPair {
    match &calibration.stereo {
        StereoCalibration::Rectified(pair) => pair,
        StereoCalibration::Raw(_) => panic!("{calibration:?} is not rectified"),
    }
}

/// Parses texts under made-up file names.
fn parse(sources: &[(&str, &str)]) -> Result<Calibration, CalibrationError> {
    let sources: Vec<(&Path, &str)> = sources.iter().map(|(file, text)| (Path::new(*file), *text)).collect();
    Calibration::parse(&sources, Some((640, 400)))
}

fn expected() -> Value {
    serde_json::from_str(&text("expected.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// Equal up to the rounding to f32, and `more`.
fn close(found: impl IntoIterator<Item = f32>, expected: &[f64], more: f64) {
    let found: Vec<f32> = found.into_iter().collect();
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((f64::from(*a) - b).abs() <= 1.0e-7 * b.abs() + more, "{found:?} is not {expected:?}");
    }
}

/// Compares a pair with what went into the files.
fn check(pair: &RawPair, coefficients: [&str; 2], rectification: Option<&str>, pose_error: f64) {
    let expected = expected();
    for (camera, k, d) in [(&pair.left, "K1", coefficients[0]), (&pair.right, "K2", coefficients[1])] {
        assert_eq!((camera.width, camera.height), (640, 400));
        let k = numbers(&expected[k]);
        close([camera.fx, camera.cx, camera.fy, camera.cy], &[k[0], k[2], k[4], k[5]], 0.0);
        let mut d = numbers(&expected[d]);
        d.resize(8, 0.0);
        close(camera.distortion.0, &d, 0.0);
    }
    close(pair.rotation.into_iter().flatten(), &numbers(&expected["R"]), 1.0e-12 + pose_error);
    close(pair.translation_m, &numbers(&expected["T"]), 1.0e-12 + pose_error);
    let Some(set) = rectification else { return assert!(pair.rectification.is_none()) };
    let (expected, found) = (&expected[set], pair.rectification.unwrap());
    close(found.left_rotation.into_iter().flatten(), &numbers(&expected["R1"]), 1.0e-12);
    close(found.right_rotation.into_iter().flatten(), &numbers(&expected["R2"]), 1.0e-12);
    let (p1, p2) = (numbers(&expected["P1"]), numbers(&expected["P2"]));
    let pair = found.pair;
    pair.check().unwrap();
    assert_eq!((pair.width, pair.height), (640, 400));
    let found = [pair.focal_px, pair.cx, pair.cy, pair.baseline_m, pair.disparity_offset_px];
    close(found, &[p1[0], p1[2], p1[6], -p2[3] / p2[0], p2[2] - p1[2]], 0.0);
}

#[test]
fn one_file_of_opencv_in_yaml_and_in_xml() {
    for name in ["whole.yml", "whole.xml"] {
        let calibration = load(&[name], None).unwrap();
        assert_eq!((calibration.format, calibration.warnings.len()), (CalibrationFormat::OpenCv, 0));
        check(raw(&calibration), ["D1", "D2"], Some("five"), 0.0);
    }
    // OpenCV before version 5 begins with a line that YAML itself does not allow; Windows ends lines its own way.
    let old = with(&text("whole.yml"), "%YAML 1.2", "%YAML:1.0").replace('\n', "\r\n");
    check(raw(&parse(&[("calib.yml", &old)]).unwrap()), ["D1", "D2"], Some("five"), 0.0);
}

#[test]
fn a_file_of_opencv_without_rectification() {
    let calibration = load(&["pose_only.yml"], Some((640, 400))).unwrap();
    check(raw(&calibration), ["D1_8", "D2_8"], None, 0.0);
    assert_eq!(calibration.warnings, vec![]);
}

#[test]
fn intrinsics_and_extrinsics_of_opencv_in_either_order_take_the_size_from_the_pictures() {
    for names in [["intrinsics.yml", "extrinsics.yml"], ["extrinsics.yml", "intrinsics.yml"]] {
        check(raw(&load(&names, Some((640, 400))).unwrap()), ["D1_8", "D2_8"], Some("eight"), 0.0);
        let error = load(&names, None).unwrap_err();
        assert_eq!((error.field.as_str(), error.problem), ("image_size", CalibrationProblem::SizeUnknown));
    }
}

#[test]
fn a_pair_of_ros_files_gives_the_pose_that_was_rectified() {
    // OpenCV's rotation and translation come back out of R1, R2 and P2 alone.
    let calibration = load(&["left.yaml", "right.yaml"], None).unwrap();
    assert_eq!((calibration.format, calibration.warnings.len()), (CalibrationFormat::Ros, 0));
    check(raw(&calibration), ["D1", "D2"], Some("five"), 1.0e-9);
    let calibration = load(&["left_rational.yaml", "right_rational.yaml"], Some((640, 400))).unwrap();
    check(raw(&calibration), ["D1_8", "D2_8"], Some("eight"), 1.0e-9);
}

#[test]
fn euroc_poses_go_through_the_body() {
    // The body is turned and moved against both cameras; the right one lies 0.2 m to the right of the left one.
    let yaml = |t: &str| {
        format!(
            "%YAML:1.0\n# made up\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [{t}, 0, 0, 0, 1]\n\
             resolution: [640, 400]\ncamera_model: pinhole\nintrinsics: [400, 401, 320, 200] # fu, fv\n\
             distortion_model: radial-tangential\ndistortion_coefficients: [-0.3, 0.1, 0.001, -0.002]\n"
        )
    };
    // Camera x is body -y, camera y is body -z, camera z is body x.
    let left = yaml("0, 0, 1, 0.5,  -1, 0, 0, 0.1,  0, -1, 0, 0.3");
    let right = yaml("0, 0, 1, 0.5,  -1, 0, 0, -0.1,  0, -1, 0, 0.3");
    let calibration = parse(&[("cam0.yaml", &left), ("cam1.yaml", &right)]).unwrap();
    assert_eq!(calibration.format, CalibrationFormat::Euroc);
    let pair = raw(&calibration);
    close(pair.rotation.into_iter().flatten(), &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 0.0);
    close(pair.translation_m, &[-0.2, 0.0, 0.0], 1.0e-9);
    close(pair.left.distortion.0, &[-0.3, 0.1, 0.001, -0.002, 0.0, 0.0, 0.0, 0.0], 0.0);
    let error = parse(&[("cam1.yaml", &right), ("cam0.yaml", &left)]).unwrap_err();
    assert!(matches!(error.problem, CalibrationProblem::Exchanged { .. }), "{error}");
    assert_eq!((error.file.as_path(), error.field.as_str()), (Path::new("cam0.yaml"), "T_BS"));
}

const KITTI: &str = "P0: 5e+02 0 3.2e+02 0 0 5e+02 2e+02 0 0 0 1 0\r\nP1: 5e+02 0 3.25e+02 -2.5e+02 0 5e+02 2e+02 0 0 0 1 0\r\n\
                     P2: 1 2 3\r\nTr: nonsense\r\n";

#[test]
fn kitti_with_different_principal_points() {
    let calibration = parse(&[("calib.txt", KITTI)]).unwrap();
    let pair = rectified(&calibration);
    assert_eq!((pair.focal_px, pair.baseline_m, pair.disparity_offset_px), (500.0, 0.5, 5.0));
    assert_eq!((pair.cx, pair.cy, pair.width, pair.height), (320.0, 200.0, 640, 400));
    // A point at (1, 0, 10) m, projected by hand: left 320 + 50 = 370, right 325 + 25 = 350; its disparity of 20 px is 10 m.
    assert!((pair.distance_m(20.0) - 10.0).abs() < 1.0e-5);
}

/// `from` with `old` replaced once; `old` must be there.
fn with(from: &str, old: &str, new: &str) -> String {
    assert!(from.contains(old), "`{old}` is not in\n{from}");
    from.replacen(old, new, 1)
}

#[test]
fn every_error_names_file_and_field_and_says_the_mend() {
    type Is = fn(&CalibrationProblem) -> bool;
    use CalibrationProblem as P;
    let whole = text("whole.yml");
    let (left, right) = (text("left.yaml"), text("right.yaml"));
    let kitti = |old: &str, new: &str| vec![("calib.txt", with(KITTI, old, new))];
    let opencv = |old: &str, new: &str| vec![("calib.yml", with(&whole, old, new))];
    let ros = |old: &str, new: &str| vec![("left.yaml", with(&left, old, new)), ("right.yaml", right.clone())];
    let t = translation(&whole);
    let swapped = whole.replace("\nR1:", "\nR:1").replace("\nR2:", "\nR1:").replace("\nR:1", "\nR2:");
    type Case<'a> = (Vec<(&'a str, String)>, &'a str, &'a str, Is);
    let cases: Vec<Case<'_>> = vec![
        (kitti("P1:", "P9:"), "calib.txt", "P1", |p| matches!(p, P::Missing)),
        (kitti("P0: 5e+02", "P0: NaN"), "calib.txt", "P0", |p| matches!(p, P::NotFinite)),
        (kitti("P0: 5e+02", "P0: 0"), "calib.txt", "P0", |p| matches!(p, P::FocalLength(_))),
        (kitti("P1: 5e+02", "P1: -5e+02"), "calib.txt", "P1", |p| matches!(p, P::FocalLength(_))),
        (kitti("P1: 5e+02", "P1: 6e+02"), "calib.txt", "P1", |p| matches!(p, P::NotRectified { .. })),
        (kitti("P1: 5e+02", "P1: five"), "calib.txt", "P1", |p| matches!(p, P::NotANumber(_))),
        (kitti("P1: 5e+02 0", "P1: 5e+02"), "calib.txt", "P1", |p| matches!(p, P::Shape { .. })),
        (kitti("-2.5e+02", "2.5e+02"), "calib.txt", "P1", |p| matches!(p, P::Exchanged { .. })),
        (kitti("-2.5e+02", "0"), "calib.txt", "P1", |p| matches!(p, P::NoBaseline { .. })),
        (kitti("-2.5e+02 0 5e+02 2e+02 0", "-1 0 5e+02 2e+02 -2.5e+02"), "calib.txt", "P1", |p| {
            matches!(p, P::NotSideBySide { .. })
        }),
        (opencv("412.25", ".Nan"), "calib.yml", "K1", |p| matches!(p, P::NotFinite)),
        (opencv("412.25", "-.Inf"), "calib.yml", "K1", |p| matches!(p, P::NotFinite)),
        (opencv("412.25", "-412.25"), "calib.yml", "K1", |p| matches!(p, P::FocalLength(_))),
        (opencv("414.5", "0."), "calib.yml", "K2", |p| matches!(p, P::FocalLength(_))),
        (opencv("K2:", "unknown:"), "calib.yml", "M2", |p| matches!(p, P::Missing)),
        (opencv("\nD1:", "\nunknown:"), "calib.yml", "D1", |p| matches!(p, P::Missing)),
        (opencv("\nT:", "\nunknown:"), "calib.yml", "T", |p| matches!(p, P::Missing)),
        (opencv("cols: 3", "cols: 4"), "calib.yml", "K1", |p| matches!(p, P::Shape { .. })),
        (opencv("0.9997", "0.8997"), "calib.yml", "R", |p| matches!(p, P::NotARotation { .. })),
        (opencv("image_width: 640", "image_width: 320"), "calib.yml", "image_size", |p| {
            matches!(p, P::SizeDiffers { .. })
        }),
        (opencv("image_width: 640", "image_width: -1"), "calib.yml", "image_width", |p| {
            matches!(p, P::OutOfRange { .. })
        }),
        (opencv(&t, "data: [0.1205, 0, 0]"), "calib.yml", "T", |p| matches!(p, P::Exchanged { .. })),
        (kitti("-2.5e+02", "-2.5e+60"), "calib.txt", "P1", |p| matches!(p, P::OutOfRange { .. })),
        (opencv(&t, "data: [-1e60, 0, 0]"), "calib.yml", "T", |p| matches!(p, P::OutOfRange { .. })),
        (opencv(&t, "data: [-1e200, 0, 0]"), "calib.yml", "T", |p| matches!(p, P::NotFinite)),
        (opencv(&t, "data: [0, 0, 0]"), "calib.yml", "T", |p| matches!(p, P::NoBaseline { .. })),
        (opencv(&t, "data: [0, -0.12, 0]"), "calib.yml", "T", |p| matches!(p, P::NotSideBySide { .. })),
        (opencv(&t, "data: [ -120.5, 1.1, -2.3 ]"), "calib.yml", "P2", |p| matches!(p, P::RectificationDiffers { .. })),
        (vec![("calib.yml", swapped.clone())], "calib.yml", "R1", |p| matches!(p, P::RectificationDiffers { .. })),
        (opencv(&t, "data: [1, 2]"), "calib.yml", "T", |p| matches!(p, P::Shape { .. })),
        (opencv("K1: !!opencv-matrix", "K1: [1, 2"), "calib.yml", "", |p| matches!(p, P::Syntax { .. })),
        (ros("plumb_bob", "equidistant"), "left.yaml", "distortion_model", |p| matches!(p, P::LensModel(_))),
        (ros("projection_matrix", "projection"), "left.yaml", "projection_matrix", |p| matches!(p, P::Missing)),
        (ros("image_width: 640", "image_width: 64"), "left.yaml", "image_width", |p| {
            matches!(p, P::SizeDiffers { .. })
        }),
        (vec![("left.yaml", left.clone())], "left.yaml", "", |p| matches!(p, P::NotAPair(_))),
        (vec![("left.yaml", right.clone()), ("right.yaml", left.clone())], "right.yaml", "projection_matrix", |p| {
            matches!(p, P::Exchanged { .. })
        }),
        (vec![("left.yaml", left.clone()), ("x.yml", whole.clone())], "left.yaml", "", |p| matches!(p, P::NotAPair(_))),
        (vec![("a.yml", "a: 1\n".to_owned())], "a.yml", "", |p| matches!(p, P::UnknownFormat)),
        (vec![("a.yml", String::new())], "a.yml", "", |p| matches!(p, P::Syntax { .. })),
        (vec![("a.yml", "a: &x [1]\nb: *x\n".to_owned())], "a.yml", "", |p| matches!(p, P::Syntax { line: 2, .. })),
        (vec![("a.yml", "[".repeat(100_000))], "a.yml", "", |p| matches!(p, P::Syntax { .. })),
        (vec![("a.yml", "- ".repeat(100_000))], "a.yml", "", |p| matches!(p, P::Syntax { .. })),
        (vec![("a.yml", "? ".repeat(100_000))], "a.yml", "", |p| matches!(p, P::Syntax { .. })),
        (vec![("a.yml", "{a: ".repeat(100_000))], "a.yml", "", |p| matches!(p, P::Syntax { .. })),
        (vec![("a.xml", "<a>".repeat(100_000))], "a.xml", "", |p| matches!(p, P::Syntax { .. })),
        (vec![("a.xml", "<a><b></a>".to_owned())], "a.xml", "", |p| matches!(p, P::Syntax { line: 1, .. })),
    ];
    for (sources, file, field, is) in cases {
        let sources: Vec<(&str, &str)> = sources.iter().map(|(file, text)| (*file, text.as_str())).collect();
        let error = parse(&sources).expect_err(file);
        assert!(is(&error.problem), "{error:?}");
        assert_eq!((error.file.to_str().unwrap(), error.field.as_str()), (file, field), "{error}");
        let message = error.to_string();
        assert!(message.starts_with(file) && message.contains(field), "{message}");
        assert!(message.contains(';') || message.contains("must lie within"), "no mend in: {message}");
    }
}

/// The data of `T` as OpenCV wrote them.
fn translation(whole: &str) -> String {
    let t = &whole[whole.find("\nT:").unwrap()..];
    let start = t.find("data:").unwrap();
    t[start..=t.find(']').unwrap()].to_owned()
}

#[test]
fn cameras_with_pictures_of_different_size_are_no_pair() {
    let right = with(&text("right.yaml"), "image_width: 640", "image_width: 320");
    let sources = [(Path::new("left.yaml"), text("left.yaml")), (Path::new("right.yaml"), right)];
    let error = Calibration::parse(&sources.each_ref().map(|(file, text)| (*file, text.as_str())), None).unwrap_err();
    assert_eq!(error.problem, CalibrationProblem::SizesDiffer { left: (640, 400), right: (320, 400) });
    assert_eq!(error.file, Path::new("right.yaml"));
}

#[test]
fn files_that_are_not_there_or_not_text_are_said() {
    let error = Calibration::load(&["/nowhere/calib.yaml"], None).unwrap_err();
    assert!(matches!(error.problem, CalibrationProblem::Unreadable(_)), "{error}");
    let folder = std::env::temp_dir().join(format!("fencepost-calibration-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    assert!(matches!(Calibration::load_from_folder(&folder, None).unwrap_err().problem, CalibrationProblem::NoFile));
    std::fs::write(folder.join("calib.yaml"), [0xff, 0xfe, 0x00]).unwrap();
    let error = Calibration::load_from_folder(&folder, None).unwrap_err();
    assert_eq!((error.file, error.problem), (folder.join("calib.yaml"), CalibrationProblem::NotText));
    std::fs::remove_dir_all(folder).unwrap();
    let none: [&str; 0] = [];
    assert!(Calibration::load(&none, None).is_err());
}

/// A rig's file or a link in a recording can name anything.
#[test]
#[cfg(unix)]
fn a_calibration_without_an_end_is_refused() {
    let error = Calibration::load(&["/dev/zero"], None).unwrap_err();
    assert_eq!(error.problem, CalibrationProblem::NotText);
    let long = std::env::temp_dir().join(format!("fencepost-long-{}.yaml", std::process::id()));
    std::fs::write(&long, vec![b' '; (1 << 20) + 1]).unwrap();
    let error = Calibration::load(&[&long], None).unwrap_err();
    std::fs::remove_file(long).unwrap();
    assert_eq!(error.problem, CalibrationProblem::NotText);
}

#[test]
fn more_than_eight_coefficients_pass_only_as_zeros() {
    let intrinsics = text("intrinsics.yml");
    let extrinsics = text("extrinsics.yml");
    let start = intrinsics.find("D1:").unwrap();
    let (head, tail) = intrinsics.split_at(start);
    let tilted = format!("{head}{}", with(tail, "0. ]", "0.01 ]"));
    let error = parse(&[("intrinsics.yml", &tilted), ("extrinsics.yml", &extrinsics)]).unwrap_err();
    assert_eq!((error.field.as_str(), error.problem), ("D1", CalibrationProblem::ExtraCoefficients { count: 14 }));
}

#[test]
fn doubtful_values_are_warned_of() {
    let whole = text("whole.yml");
    let pose = text("pose_only.yml");
    let millimetres = with(&pose, &translation(&pose), "data: [ -120.5, 1.1, -2.3 ]");
    let calibration = parse(&[("calib.yml", &millimetres)]).unwrap();
    assert!(
        matches!(&calibration.warnings[..], [CalibrationWarning::LongBaseline { baseline_m, .. }] if *baseline_m > 120.0),
        "{:?}",
        calibration.warnings
    );
    assert!(calibration.warnings[0].to_string().contains("divide the translation and"));
    let incomplete = parse(&[("calib.yml", &with(&whole, "P2:", "P9:"))]).unwrap();
    assert!(
        matches!(&incomplete.warnings[..], [CalibrationWarning::RectificationIncomplete { missing, .. }] if missing == "P2")
    );
    assert!(raw(&incomplete).rectification.is_none());
    let oblong = parse(&[("calib.txt", &with(KITTI, "0 5e+02 2e+02", "0 5.1e+02 2e+02"))]).unwrap();
    assert!(matches!(&oblong.warnings[..], [CalibrationWarning::NotSquare { .. }]), "{:?}", oblong.warnings);
    assert_eq!(rectified(&oblong).focal_px, 505.0);
}

#[test]
fn a_rotation_rounded_in_the_file_is_made_orthonormal() {
    let yaml = "M1: [[400, 0, 320], [0, 400, 200], [0, 0, 1]]\nD1: []\nM2: [[400, 0, 320], [0, 400, 200], [0, 0, 1]]\nD2: [0, 0, 0, 0]\n\
                R: [[0.9998, 0.0, 0.02], [0.0, 1.0, 0.0], [-0.02, 0.0, 0.9998]]\nT: [-0.1, 0, 0]\n";
    let calibration = parse(&[("calib.yaml", yaml)]).unwrap();
    let r = raw(&calibration).rotation.map(|row| row.map(f64::from));
    for i in 0..3 {
        for j in 0..3 {
            let dot: f64 = (0..3).map(|k| r[i][k] * r[j][k]).sum();
            assert!((dot - f64::from(u8::from(i == j))).abs() < 2.0e-7, "rows {i} and {j}: {dot}");
        }
    }
}

/// Nothing that happens to the bytes of a file may bring the reader down.
#[test]
fn changed_bytes_never_panic() {
    let sets: [&[&str]; 5] = [
        &["whole.yml"],
        &["whole.xml"],
        &["pose_only.yml"],
        &["intrinsics.yml", "extrinsics.yml"],
        &["left.yaml", "right.yaml"],
    ];
    let mut sets: Vec<Vec<(PathBuf, String)>> =
        sets.iter().map(|names| names.iter().map(|name| (file(name), text(name))).collect()).collect();
    sets.push(vec![(PathBuf::from("calib.txt"), KITTI.to_owned())]);
    let seed = 20_240_601_u64;
    println!("seed {seed}");
    let mut state = seed;
    let mut draw = |below: usize| {
        // xorshift64*
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % below.max(1)
    };
    let words: [&[u8]; 12] =
        [b"[", b"]", b"{", b"<", b">", b"&", b"*", b": ", b"\n", b"1e999", b"!!opencv-matrix", b"\xc3\xa9"];
    let (mut accepted, mut refused) = (0, 0);
    for round in 0..12_000 {
        let set = &sets[round % sets.len()];
        let mut texts: Vec<Vec<u8>> = set.iter().map(|(_, text)| text.clone().into_bytes()).collect();
        let index = draw(texts.len());
        let bytes = &mut texts[index];
        for _ in 0..=draw(4) {
            let at = draw(bytes.len());
            match draw(5) {
                0 => bytes.truncate(at),
                1 => drop(bytes.drain(at..(at + draw(40)).min(bytes.len()))),
                2 => drop(bytes.splice(at..at, words[draw(words.len())].iter().copied())),
                3 => bytes.get_mut(at).into_iter().for_each(|byte| *byte = b"0123456789.-eE\n\t :,[]"[draw(21)]),
                _ => bytes.get_mut(at).into_iter().for_each(|byte| *byte = draw(256) as u8),
            }
        }
        let texts: Vec<String> = texts.iter().map(|bytes| String::from_utf8_lossy(bytes).into_owned()).collect();
        let sources: Vec<(&Path, &str)> =
            set.iter().zip(&texts).map(|((file, _), text)| (file.as_path(), text.as_str())).collect();
        match Calibration::parse(&sources, Some((640, 400))) {
            Ok(calibration) => {
                accepted += 1;
                if let StereoCalibration::Raw(pair) = calibration.stereo {
                    let numbers = pair.rotation.into_iter().flatten().chain(pair.translation_m);
                    assert!(numbers.chain(pair.left.distortion.0).all(f32::is_finite));
                    assert!(pair.left.fx > 0.0 && pair.right.fy > 0.0);
                }
            }
            Err(error) => {
                refused += 1;
                assert!(!error.to_string().is_empty());
            }
        }
    }
    println!("{accepted} accepted, {refused} refused");
    assert!(accepted > 500 && refused > 500);
}
