//! Recordings: what is written is read again, and everything that can be wrong with one is said.

use std::fs;
use std::path::{Path, PathBuf};

use fencepost_core::geometry::{
    CameraModel, Distortion, Mount, RawPair, Rectification, RectifiedPair, StereoCalibration,
};
use fencepost_core::picture::Picture;
use fencepost_hal::calibration::{CalibrationFormat, CalibrationProblem};
use fencepost_hal::camera::{Camera, StereoPair};
use fencepost_hal::recording::{Layout, RecordedCamera, Recording, RecordingError, RecordingWarning, RecordingWriter};
use image::{DynamicImage, ImageBuffer, Luma, LumaA, Rgb};

const SIZE: (u32, u32) = (40, 24);
const PERIOD_NS: u64 = 50_000_001;
const MOUNT: Mount = Mount { height_m: Some(0.95), pitch_down_deg: 21.7, roll_deg: -0.3 };

/// A folder of its own for a test, gone at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("fencepost-recording-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        Self(path)
    }

    fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.join(name), text).unwrap();
    }

    fn open(&self) -> Result<Recording, RecordingError> {
        Recording::open(&self.0)
    }

    fn camera(&self) -> RecordedCamera {
        self.open().unwrap().into_camera()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn rectified() -> RectifiedPair {
    RectifiedPair {
        width: SIZE.0,
        height: SIZE.1,
        focal_px: 31.7,
        cx: 19.3,
        cy: 12.1,
        baseline_m: 0.1234,
        disparity_offset_px: 0.7,
    }
}

fn raw() -> RawPair {
    let camera = |cx, k3| CameraModel {
        width: SIZE.0,
        height: SIZE.1,
        fx: 31.7,
        fy: 31.9,
        cx,
        cy: 12.1,
        distortion: Distortion([-0.3, 0.1, 0.001, -2.0e-5, k3, 0.0, 0.0, 0.0]),
    };
    let (sin, cos) = 0.02_f32.sin_cos();
    RawPair {
        left: camera(19.3, 0.0),
        right: camera(20.9, 0.01),
        rotation: [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]],
        translation_m: [-0.1234, 0.001, -0.002],
        rectification: None,
    }
}

/// Grey values that no other frame or side has.
fn pixels(frame: u64, side: u64) -> Vec<u8> {
    (0..u64::from(SIZE.0 * SIZE.1)).map(|i| (i * 7 + frame * 31 + side * 101 + i * i / 13) as u8).collect()
}

fn time_ns(frame: u64) -> u64 {
    1_700_000_000_000_000_123 + frame * PERIOD_NS
}

fn put(writer: &mut RecordingWriter, frame: u64) -> Result<u32, RecordingError> {
    let (left, right) = (pixels(frame, 0), pixels(frame, 1));
    let view = |pixels| Picture::packed(pixels, SIZE.0 as usize, SIZE.1 as usize).unwrap();
    writer.write_pair(&StereoPair {
        left: view(&left),
        right: view(&right),
        timestamp_ns: time_ns(frame),
        sequence: frame as u32,
    })
}

/// A sound recording of `frames` frames.
fn sound(name: &str, calibration: &StereoCalibration, frames: u64) -> Folder {
    let folder = Folder::new(name);
    let mut writer = RecordingWriter::create(&folder.0, calibration, &MOUNT).unwrap();
    for frame in 0..frames {
        assert_eq!(put(&mut writer, frame).unwrap(), frame as u32);
    }
    folder
}

fn kitti(name: &str) -> Folder {
    sound(name, &StereoCalibration::Rectified(rectified()), 3)
}

fn euroc(name: &str) -> Folder {
    sound(name, &StereoCalibration::Raw(raw()), 3)
}

fn grey(picture: &Picture<'_>) -> Vec<u8> {
    (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect()
}

/// Number, time and pixels of each frame, or what is wrong with it.
#[expect(clippy::type_complexity, reason = "used by tests alone, which take it apart at once")]
fn play(camera: &mut RecordedCamera) -> Vec<Result<(u32, u64, [Vec<u8>; 2]), RecordingError>> {
    let mut frames = Vec::new();
    loop {
        match camera.next_pair(|pair| (pair.sequence, pair.timestamp_ns, [grey(&pair.left), grey(&pair.right)])) {
            Ok(Some(frame)) => frames.push(Ok(frame)),
            Ok(None) => return frames,
            Err(error) => frames.push(Err(error)),
        }
        assert!(frames.len() < 100, "a recording ends");
    }
}

/// Plays the frames that are sound and the errors of the others, by frame number.
fn errors(folder: &Folder) -> (Vec<u32>, Vec<RecordingError>) {
    let (mut good, mut bad) = (Vec::new(), Vec::new());
    for frame in play(&mut folder.camera()) {
        match frame {
            Ok((number, ..)) => good.push(number),
            Err(error) => bad.push(error),
        }
    }
    (good, bad)
}

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
    assert_eq!((good, bad.len()), (vec![0, 1], 1));
    fs::remove_file(folder.join("image_1/000002.png")).unwrap();
    fs::write(folder.join("image_1/000002.part"), b"half").unwrap();
    let (good, bad) = errors(&folder);
    assert_eq!((good, bad), (vec![0, 1], vec![]));
}

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
fn mount_json_is_read_with_what_is_not_known_and_refused_with_what_is_wrong() {
    let folder = kitti("mount");
    let file = folder.join("mount.json");
    folder.write("mount.json", "{\"height_m\": null, \"pitch_down_deg\": 5, \"roll_deg\": 0, \"note\": \"by eye\"}");
    let recording = folder.open().unwrap();
    assert_eq!((recording.mount.height_m, recording.mount.pitch_down_deg), (None, 5.0));
    assert_eq!(recording.warnings, []);

    folder.write("mount.json", "{\"height_mm\": 950, \"roll_deg\": 1}");
    let recording = folder.open().unwrap();
    assert_eq!(recording.mount, Mount { height_m: None, pitch_down_deg: 0.0, roll_deg: 1.0 });
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
    let error = writer.write_pair(&StereoPair { left: small, right: small, timestamp_ns: 0, sequence: 1 }).unwrap_err();
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
