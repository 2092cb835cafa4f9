//! What is written is read again.

use super::*;

#[test]
fn what_is_written_is_read_again_in_both_layouts() {
    for (folder, layout) in [(kitti("round-trip-kitti"), Layout::Kitti), (euroc("round-trip-euroc"), Layout::Euroc)] {
        let recording = folder.open().unwrap();
        assert_eq!((recording.layout, recording.mount, &recording.warnings[..]), (layout, MOUNT, &[][..]));
        match &recording.calibration.stereo {
            StereoCalibration::Rectified(pair) => assert_eq!(*pair, rectified()),
            StereoCalibration::Raw(pair) => {
                let expected = raw();
                assert_eq!((pair.left, pair.right, pair.rectification), (expected.left, expected.right, None));
                let found = pair.rotation.iter().flatten().chain(&pair.translation_m);
                for (a, b) in found.zip(expected.rotation.iter().flatten().chain(&expected.translation_m)) {
                    assert!((a - b).abs() < 2.0e-7, "{pair:?}");
                }
            }
        }
        let frames = play(&mut recording.into_camera());
        let expected: Vec<_> = (0..3).map(|i| Ok((i as u32, time_ns(i), [pixels(i, 0), pixels(i, 1)]))).collect();
        assert_eq!(frames, expected);
    }
}

#[test]
fn a_mount_that_is_not_known_stays_so() {
    let folder = Folder::new("mount-unknown");
    let mount = Mount { height_m: None, ..MOUNT };
    let mut writer = RecordingWriter::create(&folder.0, &StereoCalibration::Rectified(rectified()), &mount).unwrap();
    put(&mut writer, 0).unwrap();
    assert_eq!(folder.open().unwrap().mount, mount);
    assert!(
        !fs::read_to_string(folder.join("mount.json")).unwrap().contains("yaw"),
        "the place is said only if there is one"
    );
}

#[test]
fn a_mount_elsewhere_on_the_vehicle_is_read_again() {
    let folder = Folder::new("mount-elsewhere");
    let mount = Mount { forward_m: 1.5, left_m: -0.25, yaw_left_deg: -135.0, ..MOUNT };
    let mut writer = RecordingWriter::create(&folder.0, &StereoCalibration::Rectified(rectified()), &mount).unwrap();
    put(&mut writer, 0).unwrap();
    let recording = folder.open().unwrap();
    assert_eq!((recording.mount, recording.warnings), (mount, vec![]));
}

#[test]
fn true_disparity_is_a_16_bit_picture_beside_the_others() {
    let folder = kitti("disparity");
    assert_eq!(folder.open().unwrap().truth.disparity, None);
    let again = Folder::new("disparity-2");
    let mut writer = RecordingWriter::create(&again.0, &StereoCalibration::Rectified(rectified()), &MOUNT).unwrap();
    put(&mut writer, 0).unwrap();
    let values: Vec<u16> = (0..SIZE.0 * SIZE.1).map(|i| (i * 67) as u16).collect();
    writer.write_disparity(0, &values).unwrap();
    assert!(matches!(writer.write_disparity(0, &values[1..]), Err(RecordingError::Unwritable { .. })));
    assert_eq!(again.open().unwrap().truth.disparity, Some(again.join("disp_occ_0")));
    let DynamicImage::ImageLuma16(picture) = image::open(again.join("disp_occ_0/000000.png")).unwrap() else {
        panic!("not 16-bit grey")
    };
    assert_eq!((picture.dimensions(), picture.into_raw()), (SIZE, values));
}

#[test]
fn a_recording_can_be_read_after_every_frame_and_when_the_writer_dies_within_one() {
    for calibration in [StereoCalibration::Rectified(rectified()), StereoCalibration::Raw(raw())] {
        let folder = Folder::new("any-time");
        let mut writer = RecordingWriter::create(&folder.0, &calibration, &MOUNT).unwrap();
        assert!(matches!(folder.open(), Err(RecordingError::NoFrames(_))));
        for frame in 0..4 {
            put(&mut writer, frame).unwrap();
            assert_eq!(folder.open().unwrap().warnings, vec![]);
            let frames = play(&mut folder.camera());
            assert!(frames.len() as u64 == frame + 1 && frames.iter().all(Result::is_ok));
        }
    }
    // Died between time and pictures, and between the right and the left picture.
    let folder = kitti("dies");
    fs::remove_file(folder.join("image_0/000002.png")).unwrap();
    let (good, bad) = errors(&folder);
    assert_eq!((good, bad), (vec![0, 1], vec![]));
    let warnings = folder.open().unwrap().warnings;
    assert!(matches!(warnings[..], [RecordingWarning::Unfinished { frame: 2, .. }]), "{warnings:?}");
    fs::remove_file(folder.join("image_1/000002.png")).unwrap();
    fs::write(folder.join("image_1/000002.part"), b"half").unwrap();
    let (good, bad) = errors(&folder);
    assert_eq!((good, bad), (vec![0, 1], vec![]));
}

#[test]
fn what_cannot_be_written_is_said_and_what_was_written_stays() {
    let calibration = StereoCalibration::Rectified(rectified());
    let folder = kitti("unwritable");
    let again = RecordingWriter::create(&folder.0, &calibration, &MOUNT).unwrap_err();
    assert!(again.to_string().contains("holds a recording already"), "{again}");
    assert_eq!(play(&mut folder.camera()).len(), 3);
    let below_a_file = RecordingWriter::create(folder.join("calib.txt/x"), &calibration, &MOUNT).unwrap_err();
    assert!(matches!(below_a_file, RecordingError::Io { .. }), "{below_a_file}");

    let other = Folder::new("unwritable-2");
    let mut writer = RecordingWriter::create(&other.0, &calibration, &MOUNT).unwrap();
    put(&mut writer, 0).unwrap();
    let pixels = vec![0; 100];
    let small = Picture::packed(&pixels, 10, 10).unwrap();
    let error = writer
        .write_pair(&StereoPair { left: small, right: small, timestamp_ns: 0, skew_ns: 0, sequence: 1, missed: 0 })
        .unwrap_err();
    assert!(error.to_string().contains("10 x 10"), "{error}");
    // The place of the next picture is taken by a folder.
    fs::create_dir(other.join("image_1/000001.png")).unwrap();
    assert!(matches!(put(&mut writer, 1), Err(RecordingError::Io { .. })));
    assert_eq!(play(&mut other.camera()).into_iter().filter(Result::is_ok).count(), 1);

    let third = Folder::new("unwritable-3");
    let mut writer = RecordingWriter::create(&third.0, &StereoCalibration::Raw(raw()), &MOUNT).unwrap();
    put(&mut writer, 1).unwrap();
    assert!(put(&mut writer, 1).unwrap_err().to_string().contains("not after the one before"));
    assert!(put(&mut writer, 0).is_err());
    put(&mut writer, 2).unwrap();
    assert_eq!(play(&mut third.camera()).len(), 2);
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let chosen = Rectification { left_rotation: identity, right_rotation: identity, pair: rectified() };
    let chosen = StereoCalibration::Raw(RawPair { rectification: Some(chosen), ..raw() });
    let error = RecordingWriter::create(Folder::new("unwritable-4").0.clone(), &chosen, &MOUNT).unwrap_err();
    assert!(matches!(error, RecordingError::Unwritable { .. }), "{error}");
}

#[test]
fn a_list_that_is_torn_off_anywhere_in_its_last_line_is_read_up_to_there() {
    for (name, make) in
        [("times.txt", kitti as fn(&str) -> Folder), ("mav0/cam0/data.csv", euroc), ("mav0/cam1/data.csv", euroc)]
    {
        let folder = make("torn");
        let whole = fs::read_to_string(folder.join(name)).unwrap();
        let last = whole.trim_end().rfind('\n').unwrap() + 1;
        let all = play(&mut folder.camera());
        for length in last..whole.len() {
            folder.write(name, &whole[..length]);
            let recording = folder.open().unwrap_or_else(|error| panic!("{name}, {length} bytes: {error}"));
            let warnings = recording.warnings.clone();
            let frames = play(&mut recording.into_camera());
            assert!(frames.iter().all(Result::is_ok), "{name}, {length} bytes: {frames:?}");
            if name != "times.txt" {
                // The last two frames share nothing with a line that is torn.
                assert!(frames[..2] == all[..2] && (frames.len() == 2 || length + 1 == whole.len()), "{length} bytes");
            }
            let torn = warnings.iter().any(
                |warning| matches!(warning, RecordingWarning::TornLine { line, .. } if *line == whole.lines().count()),
            );
            let unpaired = warnings.iter().any(|warning| {
                matches!(
                    warning,
                    RecordingWarning::Unpaired { .. }
                        | RecordingWarning::TimesTooFew { .. }
                        | RecordingWarning::TimeDoesNotRise { .. }
                )
            });
            assert!(
                torn || unpaired || length + 1 == whole.len() || name == "times.txt",
                "{name}, {length} bytes: {warnings:?}"
            );
        }
    }
    // A line that is wrong elsewhere is no torn one.
    let folder = euroc("torn-inside");
    let whole = fs::read_to_string(folder.join("mav0/cam0/data.csv")).unwrap();
    folder.write("mav0/cam0/data.csv", &whole.replacen(",", ";", 2));
    assert!(matches!(folder.open(), Err(RecordingError::Line { .. })));
}

#[test]
fn a_calibration_is_recorded_as_the_files_that_it_was_read_from() {
    let calibrations = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/calibration");
    for (name, files) in [("whole.yml", vec!["whole.yml"]), ("whole.xml", vec!["whole.xml"])] {
        let files: Vec<_> = files.iter().map(|file| calibrations.join(file)).collect();
        let calibration = Calibration::load(&files, None).unwrap();
        let StereoCalibration::Raw(pair) = calibration.stereo else { panic!("{name} is raw") };
        assert!(pair.rectification.is_some(), "{name} brings a rectification");
        let folder = Folder::new("with-files");
        let writer = RecordingWriter::create_with_files(&folder.0, &calibration.stereo, &MOUNT, &files);
        let mut writer = writer.unwrap();
        let (width, height) = (pair.left.width as usize, pair.left.height as usize);
        let pixels = vec![100; width * height];
        let grey = Picture::packed(&pixels, width, height).unwrap();
        let lent = StereoPair { left: grey, right: grey, timestamp_ns: 5, skew_ns: 0, sequence: 0, missed: 0 };
        writer.write_pair(&lent).unwrap();
        let again = folder.open().unwrap();
        assert_eq!((again.layout, again.calibration.stereo), (Layout::Euroc, calibration.stereo), "to the last bit");
        let without = RecordingWriter::create(folder.join("again"), &calibration.stereo, &MOUNT).unwrap_err();
        assert!(without.to_string().contains("give the files"), "{without}");
    }
    let folder = Folder::new("with-missing-files");
    let gone = [folder.join("gone.yaml")];
    let error = RecordingWriter::create_with_files(folder.join("r"), &StereoCalibration::Raw(raw()), &MOUNT, &gone);
    assert!(matches!(error, Err(RecordingError::Io { .. })));
}
