//! Every pixel format, and one device that delivers both pictures.

use fencepost_guest_tests::{
    device::{Reader, Writer},
    loopback::{self, Loopback},
    vivid,
};
use fencepost_hal::camera::{
    CameraError, CameraErrorKind, CameraSettings, PackedLayout, PixelFormat, v4l2::V4l2Camera,
};
use jpeg_encoder::{ColorType, Encoder};

use super::{HEIGHT, WIDTH, next, virtual_pair};

/// Grey values from dark to bright, from left to right.
const GRAY_RAMP: i32 = 20;

/// A ramp without the driver's own text in it, so that every picture is the same.
fn show_ramp() {
    for path in [vivid::LEFT, vivid::RIGHT] {
        let controls = vivid::Controls::of(path);
        controls.set("test_pattern", GRAY_RAMP);
        controls.set("osd_text_mode", 2);
    }
}

/// The driver draws the same ramp in each format; read as GREY and by another way than the camera's it is the truth. Formats
/// with colour have it in the narrow range of video (ITU-R BT.709: black is 16, white 235).
#[test]
fn every_format_that_virtual_cameras_have_gives_the_same_grey() {
    use PixelFormat::{Grey, Nv12, Uyvy, Y10, Y12, Y16, Yuyv};
    let _cameras = vivid::Cameras::load();
    show_ramp();
    let truth = Reader::open(vivid::LEFT, *b"GREY", WIDTH, HEIGHT).read();
    assert!(truth.iter().max().unwrap() - truth.iter().min().unwrap() > 200, "a ramp");
    let narrow: Vec<u8> = truth.iter().map(|grey| (16 + (u32::from(*grey) * 219 + 127) / 255) as u8).collect();
    for format in [Grey, Y10, Y12, Y16, Yuyv, Uyvy, Nv12] {
        let settings = CameraSettings { format: Some(format), ..virtual_pair() };
        let mut camera = V4l2Camera::open(&settings).unwrap_or_else(|error| panic!("{format}: {error}"));
        assert_eq!(camera.formats(), Some((format, format)));
        let (expected, tolerance) = if matches!(format, Yuyv | Uyvy | Nv12) { (&narrow, 1) } else { (&truth, 0) };
        for _ in 0..5 {
            let pair = next(&mut camera).unwrap_or_else(|error| panic!("{format}: {error}"));
            assert!(pair.skew_ns.abs() <= 9_000_000, "{format}: {} ns apart", pair.skew_ns);
            for picture in [&pair.left, &pair.right] {
                assert_eq!(picture.len(), truth.len(), "{format}");
                let largest = picture.iter().zip(expected).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                assert!(largest <= tolerance, "{format} is off by {largest}");
            }
        }
    }
}

/// Left and right, or above and below, are told apart by what they show.
#[test]
fn one_device_delivers_both_pictures() {
    let _cameras = vivid::Cameras::load();
    show_ramp();
    for layout in [PackedLayout::SideBySide, PackedLayout::TopBottom] {
        let settings =
            CameraSettings { timeout_ms: Some(500), ..CameraSettings::one(vivid::LEFT, layout, WIDTH, HEIGHT) };
        let (width, height) = settings.device_size();
        let whole = Reader::open(vivid::LEFT, *b"GREY", width, height).read();
        let mut camera = V4l2Camera::open(&CameraSettings { format: Some(PixelFormat::Grey), ..settings }).unwrap();
        let pair = next(&mut camera).unwrap();
        assert_eq!(pair.skew_ns, 0, "both were exposed together");
        let pixel = |x: u32, y: u32| whole[(y * width + x) as usize];
        let (right_x, right_y) = if layout == PackedLayout::SideBySide { (WIDTH, 0) } else { (0, HEIGHT) };
        for (at, (left, right)) in pair.left.iter().zip(&pair.right).enumerate() {
            let (x, y) = (at as u32 % WIDTH, at as u32 / WIDTH);
            assert_eq!((*left, *right), (pixel(x, y), pixel(right_x + x, right_y + y)), "{layout:?} at {x}, {y}");
        }
    }
}

/// Written as a camera would deliver them: a JPEG picture at a time, each of its own length.
#[test]
fn jpeg_pictures_become_grey() {
    let _loopback = Loopback::load();
    let scene: Vec<u8> = (0..WIDTH * HEIGHT).map(|at| ((at % WIDTH) / 4 + (at / WIDTH) / 4) as u8).collect();
    let mut jpeg = Vec::new();
    Encoder::new(&mut jpeg, 95).encode(&scene, WIDTH as u16, HEIGHT as u16, ColorType::Luma).unwrap();
    let mut writers = [loopback::LEFT, loopback::RIGHT].map(|path| Writer::open(path, *b"MJPG", WIDTH, HEIGHT));
    writers.iter_mut().for_each(|writer| writer.write(&jpeg));
    let settings = CameraSettings {
        format: Some(PixelFormat::Mjpg),
        timeout_ms: Some(1000),
        pairing_tolerance_ms: 50.0,
        // There is one pair, and it waits already.
        newest_only: false,
        ..CameraSettings::two(loopback::LEFT, loopback::RIGHT, WIDTH, HEIGHT)
    };
    let mut camera = V4l2Camera::open(&settings).unwrap();
    writers.iter_mut().for_each(|writer| writer.write(&jpeg));
    let pair = next(&mut camera).unwrap();
    for picture in [&pair.left, &pair.right] {
        let largest = picture.iter().zip(&scene).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(largest <= 8, "{largest} from what was compressed");
    }
}

/// The messages name the device, what was asked for and what there is to choose from.
#[test]
fn a_format_or_size_that_the_device_has_not_is_said_with_those_that_it_has() {
    let _cameras = vivid::Cameras::load();
    let no_jpeg = CameraSettings { format: Some(PixelFormat::Mjpg), ..virtual_pair() };
    assert_says(&no_jpeg, &["/dev/video0: ", "MJPG of 512 x 384 px", "YUYV 16 x 16 to "]);

    // A loopback has the format and the size of its writer and no others.
    let _loopback = Loopback::load();
    let _writers = [loopback::LEFT, loopback::RIGHT].map(|path| {
        let mut writer = Writer::open(path, *b"GREY", 64, 48);
        writer.write(&[0; 64 * 48]);
        writer
    });
    let too_large = CameraSettings::two(loopback::LEFT, loopback::RIGHT, WIDTH, HEIGHT);
    assert_says(&too_large, &["/dev/video10: ", "512 x 384 px", "GREY 64 x 48"]);
    let no_colour = CameraSettings {
        format: Some(PixelFormat::Yuyv),
        ..CameraSettings::two(loopback::LEFT, loopback::RIGHT, 64, 48)
    };
    assert_says(&no_colour, &["/dev/video10: ", "YUYV of 64 x 48 px", "GREY 64 x 48"]);
}

fn assert_says(settings: &CameraSettings, words: &[&str]) {
    let Err(error) = V4l2Camera::open(settings) else { panic!("{settings:?} was taken") };
    let said = error.to_string();
    assert_eq!(error.kind(), CameraErrorKind::Unusable, "{said}");
    assert!(words.iter().all(|word| said.contains(word)), "{said}");
}
