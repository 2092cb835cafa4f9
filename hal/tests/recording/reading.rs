//! Pictures and times, and everything that can be wrong with them.

use super::*;

#[test]
fn a_bad_picture_is_an_error_of_its_frame_and_the_next_call_goes_on() {
    let other_size = ImageBuffer::<Luma<u8>, _>::from_pixel(SIZE.0 + 1, SIZE.1, Luma([7]));
    let bytes = fs::read(kitti("bytes").join("image_1/000001.png")).unwrap();
    let huge = [&bytes[..16], &[0, 1, 0, 0, 0, 1, 0, 0], &bytes[24..]].concat();
    for side in ["image_0", "image_1"] {
        let folder = kitti(&format!("bad-{side}"));
        let path = folder.join(side).join("000001.png");
        let check = |what: &str, spoil: &dyn Fn(&Path), is: fn(&RecordingError) -> bool| {
            spoil(&path);
            let (good, bad) = errors(&folder);
            assert_eq!((good, bad.len()), (vec![0, 2], 1), "{what}");
            assert!(is(&bad[0]), "{what}: {:?}", bad[0]);
            assert_eq!(bad[0].frame(), Some(1));
            let message = bad[0].to_string();
            assert!(
                message.starts_with("frame 1: ") && message.contains("000001.png") && message.contains(';'),
                "{message}"
            );
        };
        let not_decoded = |error: &RecordingError| matches!(error, RecordingError::BadPicture { .. });
        for length in [0, 4, 20, 50, bytes.len() / 2, bytes.len() - 20] {
            check("truncated", &|path| fs::write(path, &bytes[..length]).unwrap(), not_decoded);
        }
        check("not a picture", &|path| fs::write(path, b"hello, this is text").unwrap(), not_decoded);
        check("a picture that says it is huge", &|path| fs::write(path, &huge).unwrap(), not_decoded);
        check("another size", &|path| other_size.save(path).unwrap(), |error| {
            matches!(error, RecordingError::SizesDiffer { frame: 1, .. })
        });
        check("missing", &|path| fs::remove_file(path).unwrap(), |error| {
            matches!(error, RecordingError::MissingPicture { frame: 1, .. })
        });
    }
    let folder = euroc("missing-euroc");
    fs::remove_file(folder.join(&format!("mav0/cam1/data/{}.png", time_ns(1)))).unwrap();
    let (good, bad) = errors(&folder);
    assert!(good == [0, 2] && matches!(bad[..], [RecordingError::MissingPicture { frame: 1, .. }]));
}

#[test]
fn both_pictures_of_another_size_than_the_calibration_are_an_error() {
    let folder = kitti("size");
    for side in ["image_0", "image_1"] {
        let picture = ImageBuffer::<Luma<u8>, _>::from_pixel(SIZE.0, SIZE.1 + 2, Luma([7]));
        picture.save(folder.join(side).join("000002.png")).unwrap();
    }
    let (good, bad) = errors(&folder);
    let [RecordingError::SizeDiffersFromCalibration { frame: 2, picture, calibration, .. }] = bad[..] else {
        panic!("{bad:?}")
    };
    assert_eq!((good, picture, calibration), (vec![0, 1], (40, 26), (40, 24)));
    // The first picture tells of a calibration for another size at once.
    let folder = euroc("size-euroc");
    let yaml = fs::read_to_string(folder.join("mav0/cam1/sensor.yaml")).unwrap();
    folder.write("mav0/cam1/sensor.yaml", &yaml.replace("resolution: [40, 24]", "resolution: [80, 48]"));
    let Err(RecordingError::Calibration(error)) = folder.open() else { panic!("opened") };
    assert_eq!(error.problem, CalibrationProblem::SizeDiffers { file: (80, 48), pictures: (40, 24) });
}

#[test]
fn colour_and_16_bit_pictures_become_8_bit_grey_and_each_is_said_once() {
    let folder = kitti("convert");
    let (w, h) = SIZE;
    for number in 0..3 {
        let rgb = ImageBuffer::from_fn(w, h, |x, y| Rgb([x as u8 * 3, y as u8 * 5, 200]));
        rgb.save(folder.join(&format!("image_0/00000{number}.png"))).unwrap();
        let deep = ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(w, h, |x, y| Luma([(x * 1500 + y) as u16]));
        deep.save(folder.join(&format!("image_1/00000{number}.png"))).unwrap();
    }
    let alpha = ImageBuffer::<LumaA<u8>, _>::from_fn(w, h, |x, _| LumaA([x as u8, 0]));
    alpha.save(folder.join("image_1/000001.png")).unwrap();
    let mut camera = folder.camera();
    let frames: Vec<_> = play(&mut camera).into_iter().map(Result::unwrap).collect();
    assert_eq!(
        camera.take_warnings(),
        [
            RecordingWarning::Colour(folder.join("image_0/000000.png")),
            RecordingWarning::SixteenBit(folder.join("image_1/000000.png"))
        ]
    );
    assert_eq!(camera.take_warnings(), []);
    for (index, (x, y)) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).enumerate() {
        let luma = 0.299 * f64::from(x * 3) + 0.587 * f64::from(y * 5) + 0.114 * 200.0;
        assert!((f64::from(frames[0].2[0][index]) - luma).abs() <= 0.5001);
        assert_eq!(u32::from(frames[0].2[1][index]), (x * 1500 + y) / 256);
        assert_eq!(u32::from(frames[1].2[1][index]), x, "what is transparent is still seen");
    }
}

#[test]
fn portable_grey_maps_are_read_as_well() {
    let folder = kitti("pgm");
    for (side, name) in ["image_0", "image_1"].iter().enumerate() {
        fs::remove_file(folder.join(name).join("000001.png")).unwrap();
        let header = format!("P5\n{} {}\n255\n", SIZE.0, SIZE.1);
        fs::write(folder.join(name).join("000001.pgm"), [header.as_bytes(), &pixels(1, side as u64)].concat()).unwrap();
    }
    let frames = play(&mut folder.camera());
    assert_eq!(frames[1], Ok((1, time_ns(1), [pixels(1, 0), pixels(1, 1)])));
}

#[test]
fn frames_have_the_numbers_of_their_files_and_strangers_are_left_out() {
    let folder = kitti("numbers");
    for side in ["image_0", "image_1"] {
        fs::rename(folder.join(side).join("000002.png"), folder.join(side).join("000117.png")).unwrap();
    }
    folder.write("image_0/notes.txt", "x");
    let recording = folder.open().unwrap();
    let frames: Vec<(u32, u64)> = recording.frames.iter().map(|frame| (frame.number, frame.timestamp_ns)).collect();
    assert_eq!(frames, [(0, time_ns(0)), (1, time_ns(1)), (117, time_ns(2))]);
    assert_eq!(
        recording.warnings,
        [RecordingWarning::NotNumbered { path: folder.join("image_0/notes.txt"), count: 1 }]
    );
}

#[test]
fn times_that_are_missing_too_few_or_do_not_rise_are_said() {
    let folder = kitti("times");
    let file = folder.join("times.txt");
    let times =
        |folder: &Folder| -> Vec<u64> { folder.open().unwrap().frames.iter().map(|f| f.timestamp_ns).collect() };
    folder.write("times.txt", "0\n1.5e-1\r\n0.100000000001\n0.7\n\n");
    assert_eq!(times(&folder), [0, 150_000_000, 100_000_000]);
    let warning = RecordingWarning::TimeDoesNotRise { file: file.clone(), frame: 2, count: 1 };
    assert_eq!(folder.open().unwrap().warnings, [warning]);
    let (good, bad) = errors(&folder);
    assert_eq!((good, bad), (vec![0, 1, 2], vec![]), "frames out of order are delivered nevertheless");
    folder.write("times.txt", "0\n1\n");
    assert_eq!(times(&folder), [0, 100_000_000, 200_000_000]);
    let warning = RecordingWarning::TimesTooFew { file: file.clone(), times: 2, frames: 3 };
    assert_eq!(folder.open().unwrap().warnings, [warning]);
    for wrong in ["-1", "NaN", "inf", "1e300", "one", "1,5", "99999999999999999999.0"] {
        folder.write("times.txt", &format!("0\n{wrong}\n1\n"));
        let error = folder.open().unwrap_err();
        assert!(matches!(&error, RecordingError::Line { file: f, line: 2, .. } if *f == file), "{wrong}: {error}");
    }
    fs::remove_file(&file).unwrap();
    assert_eq!(times(&folder), [0, 100_000_000, 200_000_000]);
    assert_eq!(folder.open().unwrap().warnings, [RecordingWarning::TimesMissing(file)]);
}

#[test]
fn euroc_pictures_are_paired_by_time_and_the_others_are_said() {
    let folder = euroc("pairing");
    let (t0, t1, t2) = (time_ns(0), time_ns(1), time_ns(2));
    // The right camera is 2 us late in frame 0, 20 ms in frame 1; the list is out of order.
    folder.write(
        "mav0/cam1/data.csv",
        &format!("#timestamp\r\n{t2},{t2}.png\r\n{},{t0}.png\n{},{t1}.png\n", t0 + 2000, t1 + 20_000_000),
    );
    let recording = folder.open().unwrap();
    let frames: Vec<(u32, u64)> = recording.frames.iter().map(|frame| (frame.number, frame.timestamp_ns)).collect();
    assert_eq!(frames, [(0, t0), (1, t2)]);
    assert_eq!(
        recording.warnings,
        [
            RecordingWarning::PairedByNearest { folder: folder.0.clone(), count: 1, largest_ns: 2000 },
            RecordingWarning::Unpaired { folder: folder.join("mav0/cam0"), count: 1, first_ns: t1 },
            RecordingWarning::Unpaired { folder: folder.join("mav0/cam1"), count: 1, first_ns: t1 + 20_000_000 },
        ]
    );
    let frames = play(&mut recording.into_camera());
    assert_eq!(frames[1], Ok((1, t2, [pixels(2, 0), pixels(2, 1)])));

    folder.write("mav0/cam1/data.csv", "1,1.png\n2,2.png\n");
    assert!(matches!(folder.open(), Err(RecordingError::NoFrames(_))));
    for wrong in ["5", "x,1.png", "-5,1.png", "5,../1.png", "5,/etc/passwd", "5,"] {
        folder.write("mav0/cam1/data.csv", &format!("#\n{wrong}\n"));
        let error = folder.open().unwrap_err();
        assert!(matches!(&error, RecordingError::Line { line: 2, .. }), "{wrong}: {error}");
    }
    fs::remove_file(folder.join("mav0/cam1/data.csv")).unwrap();
    let recording = folder.open().unwrap();
    assert_eq!(recording.frames.len(), 3);
    assert_eq!(recording.warnings, [RecordingWarning::ListMissing(folder.join("mav0/cam1/data.csv"))]);
}

#[test]
fn euroc_times_that_do_not_rise_are_said_and_the_frames_delivered() {
    let folder = euroc("euroc-order");
    let [t0, t1, t2] = [0, 1, 2].map(time_ns);
    folder.write("mav0/cam0/data.csv", &format!("{t0},{t0}.png\n{t2},{t2}.png\n{t1},{t1}.png\n"));
    let recording = folder.open().unwrap();
    let file = folder.join("mav0/cam0/data.csv");
    assert_eq!(recording.warnings, [RecordingWarning::TimeDoesNotRise { file, frame: 2, count: 1 }]);
    let times: Vec<u64> = play(&mut recording.into_camera()).into_iter().map(|frame| frame.unwrap().1).collect();
    assert_eq!(times, [t0, t2, t1]);
}

#[test]
fn the_camera_can_be_set_to_any_frame() {
    let folder = kitti("seek");
    let mut camera = folder.camera();
    camera.seek(2);
    assert_eq!(camera.upcoming().map(|frame| frame.number), Some(2));
    assert_eq!(play(&mut camera).len(), 1);
    camera.seek(usize::MAX);
    assert!(camera.next_pair(|_| ()).unwrap().is_none());
    camera.seek(0);
    assert_eq!(play(&mut camera).len(), 3);
    assert_eq!(camera.into_inner().frames.len(), 3);
}
