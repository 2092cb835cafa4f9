//! V4L2: test patterns of the kernel's virtual cameras, and written pictures that come back.

use std::collections::BTreeSet;

use fencepost_guest_tests::{
    device::{Reader, Writer},
    loopback::{self, Loopback},
    machine::run,
    vivid,
};

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;

#[test]
fn two_virtual_cameras_deliver_pictures_of_the_size_that_was_asked_for() {
    let _cameras = vivid::Cameras::load();
    for path in [vivid::LEFT, vivid::RIGHT] {
        let mut reader = Reader::open(path, *b"GREY", WIDTH, HEIGHT);
        let picture = reader.read();
        assert_eq!(picture.len(), (WIDTH * HEIGHT) as usize);
        let greys: BTreeSet<u8> = picture.iter().copied().collect();
        assert!(greys.len() >= 8, "bars of eight colours have eight greys: {greys:?}");
    }
}

#[test]
fn faults_of_a_virtual_camera_can_be_ordered() {
    let _cameras = vivid::Cameras::load();
    let controls = vivid::Controls::of(vivid::LEFT);
    controls.set("percentage_of_dropped_buffers", 37);
    let said = run("v4l2-ctl -d /dev/video0 --get-ctrl percentage_of_dropped_buffers");
    assert_eq!(said.trim(), "percentage_of_dropped_buffers: 37");
    // A button: it can be pressed, but does not say that it was.
    controls.set("inject_v4l2_buf_flag_error", 1);
}

/// What is written at one end comes out at the other as it was.
#[test]
fn written_pictures_come_back_bit_by_bit() {
    let _loopback = Loopback::load();
    let mut ends = [loopback::LEFT, loopback::RIGHT].map(|path| {
        let mut writer = Writer::open(path, *b"GREY", WIDTH, HEIGHT);
        writer.write(&vec![0; writer.size()]);
        (writer, Reader::open(path, *b"GREY", WIDTH, HEIGHT))
    });
    // No two pictures are alike, and none is a shift of itself.
    let pixel = |at: u32, number: u32| ((at.wrapping_mul(2_654_435_761) >> 13) + number) as u8;
    for number in 0..20 {
        for (camera, (writer, reader)) in ends.iter_mut().enumerate() {
            let picture: Vec<u8> = (0..WIDTH * HEIGHT).map(|at| pixel(at, 7 * number + camera as u32)).collect();
            if number == 0 {
                assert!(reader.read().iter().all(|pixel| *pixel == 0));
            }
            writer.write(&picture);
            assert!(reader.read() == picture, "picture {number} of camera {camera}");
        }
    }
}
