//! V4L2: test patterns of the kernel's virtual cameras, and written pictures that come back.

use std::time::{Duration, Instant};

use fencepost_guest_tests::{
    loopback::{self, Loopback, Producer},
    say, vivid,
};
use v4l::{Device, Format, FourCC, buffer::Type, io::traits::CaptureStream, prelude::MmapStream, video::Capture};

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;

#[test]
fn two_virtual_cameras_deliver_pictures_of_the_size_that_was_asked_for() {
    let _cameras = vivid::Cameras::load();
    let [left, right] = [vivid::LEFT, vivid::RIGHT].map(|path| Device::with_path(path).unwrap());
    for device in [&left, &right] {
        let set = Capture::set_format(device, &Format::new(WIDTH, HEIGHT, FourCC::new(b"GREY"))).unwrap();
        assert_eq!((set.width, set.height, &set.fourcc.repr), (WIDTH, HEIGHT, b"GREY"));
    }
    let mut streams = [&left, &right].map(|device| MmapStream::with_buffers(device, Type::VideoCapture, 4).unwrap());
    let start = Instant::now();
    let mut last = [None; 2];
    const FRAMES: u32 = 10;
    for _ in 0..FRAMES {
        for (stream, last) in streams.iter_mut().zip(&mut last) {
            let (picture, meta) = stream.next().unwrap();
            assert_eq!(picture.len(), (WIDTH * HEIGHT) as usize);
            let stamp = Duration::from(meta.timestamp);
            assert!(last.is_none_or(|last| last < stamp), "time goes on");
            *last = Some(stamp);
        }
    }
    say!("vivid: {FRAMES} pairs in {} ms", start.elapsed().as_millis());
}

#[test]
fn faults_of_a_virtual_camera_can_be_ordered() {
    let _cameras = vivid::Cameras::load();
    let device = Device::with_path(vivid::LEFT).unwrap();
    let controls = vivid::Controls::of(vivid::LEFT);
    Capture::set_format(&device, &Format::new(WIDTH, HEIGHT, FourCC::new(b"GREY"))).unwrap();
    let mut stream = MmapStream::with_buffers(&device, Type::VideoCapture, 4).unwrap();
    stream.set_timeout(Duration::from_secs(2));

    let mut damaged = || (0..8).any(|_| stream.next().unwrap().1.flags.contains(v4l::buffer::Flags::ERROR));
    assert!(!damaged());
    controls.set("inject_v4l2_buf_flag_error", 1);
    assert!(damaged(), "the picture is marked");

    controls.set("percentage_of_dropped_buffers", 100);
    stream.set_timeout(Duration::from_millis(200));
    let starved = (0..8).find_map(|_| stream.next().err()).expect("no picture comes");
    assert_eq!(starved.kind(), std::io::ErrorKind::TimedOut);
    controls.set("percentage_of_dropped_buffers", 0);
}

/// What is written at one end comes out at the other as it was, with a time stamp of its own and in order.
#[test]
fn written_pictures_come_back_bit_by_bit() {
    let _loopback = Loopback::load();
    let mut producers = [loopback::LEFT, loopback::RIGHT].map(|path| Producer::open(path, b"GREY", WIDTH, HEIGHT));
    // A picture that no other one equals, and no shift of itself.
    let picture = |number: u32, camera: u32| {
        (0..WIDTH * HEIGHT)
            .map(|at| ((at.wrapping_mul(2_654_435_761) >> 13) + number * 7 + camera) as u8)
            .collect::<Vec<u8>>()
    };
    for (producer, camera) in producers.iter_mut().zip(0..) {
        producer.write(&picture(0, camera));
    }
    let devices = [loopback::LEFT, loopback::RIGHT].map(|path| Device::with_path(path).unwrap());
    let mut streams = devices.each_ref().map(|device| {
        let mut stream = MmapStream::with_buffers(device, Type::VideoCapture, 4).unwrap();
        stream.set_timeout(Duration::from_secs(2));
        stream
    });
    for number in 0..10 {
        for camera in 0..2 {
            if number > 0 {
                producers[camera].write(&picture(number, camera as u32));
            }
            let (captured, meta) = streams[camera].next().unwrap();
            assert!(captured == picture(number, camera as u32), "picture {number} of camera {camera}");
            assert_eq!(meta.sequence, number);
        }
    }
}
