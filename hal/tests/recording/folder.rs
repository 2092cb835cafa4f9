//! What lies in the folder beside the pictures.

use super::*;

#[test]
fn mount_json_is_read_with_what_is_not_known_and_refused_with_what_is_wrong() {
    let folder = kitti("mount");
    let file = folder.join("mount.json");
    folder.write("mount.json", "{\"height_m\": null, \"pitch_down_deg\": 5, \"roll_deg\": 0, \"note\": \"by eye\"}");
    let recording = folder.open().unwrap();
    assert_eq!((recording.mount.height_m, recording.mount.pitch_down_deg), (None, 5.0));
    assert_eq!(recording.warnings, []);

    folder.write("mount.json", "{\"height_mm\": 950, \"roll_deg\": 1}");
    let recording = folder.open().unwrap();
    assert_eq!(recording.mount, Mount { roll_deg: 1.0, ..Mount::default() });
    assert_eq!(
        recording.warnings,
        [
            RecordingWarning::TiltUnknown { file: file.clone(), field: "pitch_down_deg" },
            RecordingWarning::MountKeyIgnored { file: file.clone(), key: "height_mm".to_owned() },
        ]
    );
    for (text, name) in [
        ("", ""),
        ("{", ""),
        ("[1]", ""),
        ("null", ""),
        ("{\"height_m\": NaN}", ""),
        ("\u{1}", ""),
        ("{\"height_m\": \"1.28\"}", "height_m"),
        ("{\"height_m\": -1}", "height_m"),
        ("{\"height_m\": 1280}", "height_m"),
        ("{\"height_m\": 1e300}", "height_m"),
        ("{\"pitch_down_deg\": 95}", "pitch_down_deg"),
        ("{\"roll_deg\": true}", "roll_deg"),
        ("{\"roll_deg\": -1e9}", "roll_deg"),
        ("{\"forward_m\": 1200}", "forward_m"),
        ("{\"left_m\": [1]}", "left_m"),
        ("{\"yaw_left_deg\": 270}", "yaw_left_deg"),
    ] {
        folder.write("mount.json", text);
        let error = folder.open().unwrap_err();
        let RecordingError::Mount { file: f, field, .. } = &error else { panic!("{text}: {error}") };
        assert_eq!((f, field.as_str()), (&file, name), "{text}");
        assert!(error.to_string().contains("mount.json: ") && error.to_string().contains(';'), "{error}");
    }
    fs::remove_file(&file).unwrap();
    let recording = folder.open().unwrap();
    assert_eq!((recording.mount, recording.warnings), (Mount::default(), vec![RecordingWarning::MountMissing(file)]));
}

#[test]
fn folders_that_hold_no_recording_are_said() {
    let folder = kitti("folders");
    assert!(matches!(Recording::open(folder.join("nowhere")), Err(RecordingError::NotAFolder(_))));
    assert!(matches!(Recording::open(folder.join("calib.txt")), Err(RecordingError::NotAFolder(_))));
    assert!(matches!(Recording::open(folder.join("image_0")), Err(RecordingError::UnknownLayout(_))));
    fs::remove_file(folder.join("calib.txt")).unwrap();
    let error = folder.open().unwrap_err();
    assert!(matches!(&error, RecordingError::Calibration(e) if e.problem == CalibrationProblem::NoFile), "{error}");
    fs::remove_dir_all(folder.join("image_1")).unwrap();
    assert!(matches!(folder.open(), Err(RecordingError::Io { path, .. }) if path.ends_with("image_1")));
    fs::create_dir(folder.join("image_1")).unwrap();
    assert!(matches!(folder.open(), Err(RecordingError::NoFrames(path)) if path.ends_with("image_1")));
    let folder = euroc("folders-euroc");
    fs::remove_file(folder.join("mav0/cam1/sensor.yaml")).unwrap();
    let error = folder.open().unwrap_err();
    assert!(error.to_string().contains("cam1/sensor.yaml: cannot be read"), "{error}");
}

#[test]
fn left_and_right_exchanged_in_the_calibration_are_told_from_its_signs() {
    let folder = kitti("exchanged");
    let text = fs::read_to_string(folder.join("calib.txt")).unwrap();
    folder.write("calib.txt", &text.replace(" -", " "));
    let error = folder.open().unwrap_err();
    assert!(error.to_string().contains("left and right are exchanged; exchange the two"), "{error}");
    let folder = euroc("exchanged-euroc");
    fs::rename(folder.join("mav0/cam0"), folder.join("mav0/cam2")).unwrap();
    fs::rename(folder.join("mav0/cam1"), folder.join("mav0/cam0")).unwrap();
    fs::rename(folder.join("mav0/cam2"), folder.join("mav0/cam1")).unwrap();
    let error = folder.open().unwrap_err();
    assert!(error.to_string().contains("left and right are exchanged; exchange the two"), "{error}");
}

#[test]
fn pictures_in_kitti_layout_with_an_opencv_file_are_raw() {
    let folder = kitti("opencv");
    fs::remove_file(folder.join("calib.txt")).unwrap();
    let k = "[[31.7, 0, 19.3], [0, 31.9, 12.1], [0, 0, 1]]";
    let (camera, pose) = (
        format!("M1: {k}\nD1: [0.1, 0, 0, 0, 0]\nM2: {k}\nD2: [0.1, 0, 0, 0, 0]\n"),
        "R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nT: [-0.12, 0, 0]\n",
    );
    folder.write("intrinsics.yml", &camera);
    let error = folder.open().unwrap_err();
    assert!(error.to_string().contains("extrinsics.yml: cannot be read"), "{error}");
    folder.write("extrinsics.yml", pose);
    let recording = folder.open().unwrap();
    assert_eq!(recording.calibration.format, CalibrationFormat::OpenCv);
    let StereoCalibration::Raw(pair) = recording.calibration.stereo else { panic!("not raw") };
    assert_eq!(((pair.left.width, pair.left.height), pair.translation_m), (SIZE, [-0.12, 0.0, 0.0]));
    assert_eq!(play(&mut folder.camera()).len(), 3);
}
