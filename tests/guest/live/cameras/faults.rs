//! Faults of cameras: each is told for what it is, and pictures come again when its cause is gone, without help.

use std::time::{Duration, Instant};

use fencepost_guest_tests::{
    device::Writer,
    loopback::{self, Loopback},
    resources::Resources,
    say,
    vivid::{self, Cameras, Controls},
};
use fencepost_hal::camera::{
    CameraError, CameraErrorKind, CameraSettings,
    v4l2::{V4l2Camera, V4l2Error},
};

use super::{Kept, next, virtual_pair};

/// Longest time until pictures come again after a fault: devices that are gone are tried twice a second, and opening them takes
/// its time under emulation.
const RECOVERY: Duration = Duration::from_secs(5);

/// Sets both cameras' controls. Opened and closed again, since an open device cannot be registered anew.
fn set_both(name: &str, value: i32) {
    for path in [vivid::LEFT, vivid::RIGHT] {
        Controls::of(path).set(name, value);
    }
}

/// A camera that has delivered a few pairs.
fn running(settings: &CameraSettings) -> V4l2Camera {
    let mut camera = V4l2Camera::open(settings).unwrap();
    for _ in 0..3 {
        next(&mut camera).unwrap();
    }
    camera
}

/// The first error within a number of pairs, or as many good ones.
fn first_error(camera: &mut V4l2Camera, pairs: usize) -> Option<V4l2Error> {
    (0..pairs).find_map(|_| next(camera).err())
}

/// Asks for pairs until one is good.
fn recover(camera: &mut V4l2Camera) -> Kept {
    let start = Instant::now();
    loop {
        match next(camera) {
            Ok(pair) => return pair,
            Err(error) => assert!(start.elapsed() < RECOVERY, "not good again: {error}"),
        }
    }
}

#[test]
fn a_picture_that_the_driver_marks_as_damaged_is_no_picture() {
    let _cameras = Cameras::load();
    let mut camera = running(&virtual_pair());
    set_both("inject_v4l2_buf_flag_error", 1);
    let error = first_error(&mut camera, 10).expect("the damage is noticed");
    assert_eq!(error.kind(), CameraErrorKind::Damaged, "{error}");
    let pair = recover(&mut camera);
    assert!(camera.counts().lost > 0, "{:?} after {pair:?}", camera.counts());
}

#[test]
fn dropped_pictures_are_counted_and_a_stall_is_told() {
    let _cameras = Cameras::load();
    let mut camera = running(&CameraSettings { newest_only: false, ..virtual_pair() });
    set_both("percentage_of_dropped_buffers", 50);
    let mut missed = 0;
    for _ in 0..20 {
        // With half of the pictures gone a wait may be in vain, but only for lack of pictures.
        match next(&mut camera) {
            Ok(pair) => missed += pair.missed,
            Err(error) => assert_eq!(error.kind(), CameraErrorKind::NoPicture, "{error}"),
        }
    }
    assert!(missed > 5, "{missed} missed of about 40 pictures");

    set_both("percentage_of_dropped_buffers", 100);
    let start = Instant::now();
    let error = first_error(&mut camera, 10).expect("the stall is told");
    assert_eq!(error.kind(), CameraErrorKind::NoPicture, "{error}");
    say!("stall told after {} ms, with a time-out of 500 ms", start.elapsed().as_millis());
    set_both("percentage_of_dropped_buffers", 0);
    let before = camera.counts();
    let pair = recover(&mut camera);
    assert!(pair.missed > 0, "what was lost meanwhile is counted: {before:?}");
}

#[test]
fn numbers_and_times_that_wrap_do_no_harm() {
    let _cameras = Cameras::load();
    let mut camera = running(&virtual_pair());
    for control in ["wrap_sequence_number", "wrap_timestamp"] {
        set_both(control, 1);
        let mut last = None;
        for _ in 0..10 {
            let pair = recover(&mut camera);
            assert!(last.is_none_or(|last| last < pair.sequence), "numbers of pairs rise");
            last = Some(pair.sequence);
        }
    }
}

#[test]
fn a_camera_that_fails_while_it_streams_is_lost_and_opened_again() {
    let _cameras = Cameras::load();
    let mut camera = running(&virtual_pair());
    set_both("inject_fatal_streaming_error", 1);
    let error = first_error(&mut camera, 10).expect("the failure is told");
    assert_eq!(error.kind(), CameraErrorKind::Lost, "{error}");
    recover(&mut camera);
}

#[test]
fn a_camera_that_cannot_be_opened_again_at_once_is_tried_again() {
    let _cameras = Cameras::load();
    let mut camera = running(&virtual_pair());
    for control in ["inject_vidioc_reqbufs_error", "inject_vidioc_qbuf_error", "inject_vidioc_streamon_error"] {
        set_both(control, 1);
        set_both("inject_fatal_streaming_error", 1);
        let error = first_error(&mut camera, 10).unwrap_or_else(|| panic!("{control}: the failure is told"));
        assert_eq!(error.kind(), CameraErrorKind::Lost, "{control}: {error}");
        recover(&mut camera);
    }
}

#[test]
fn a_camera_that_disconnects_is_lost_and_found_again() {
    let _cameras = Cameras::load();
    let mut camera = running(&virtual_pair());
    Controls::of(vivid::LEFT).set("disconnect", 1);
    let error = first_error(&mut camera, 10).expect("the loss is told");
    assert_eq!(error.kind(), CameraErrorKind::Lost, "{error}");
    recover(&mut camera);
}

/// Over and over: neither memory nor descriptors are left behind.
#[test]
fn cameras_that_are_pulled_out_and_put_in_again_50_times_leave_nothing_behind() {
    let cameras = Cameras::load();
    let mut camera = running(&virtual_pair());
    let mut held = Vec::new();
    for round in 0..50 {
        cameras.unplug();
        let error = first_error(&mut camera, 10).expect("the loss is told");
        assert_eq!(error.kind(), CameraErrorKind::Lost, "round {round}: {error}");
        let error = next(&mut camera).expect_err("there is no camera");
        assert_eq!(error.kind(), CameraErrorKind::Lost, "round {round}: {error}");
        cameras.plug_in();
        let start = Instant::now();
        while let Err(error) = next(&mut camera) {
            assert!(start.elapsed() < RECOVERY, "round {round}: {error}");
        }
        held.push(Resources::of(std::process::id()));
    }
    let [first, .., last] = held.as_slice() else { unreachable!("50 rounds") };
    say!("{first:?}, 49 rounds later {last:?}");
    assert_eq!(first.descriptors, last.descriptors);
    assert!(last.resident_kib <= held[10].resident_kib + 256, "memory grew: {:?}", held[10]);
}

#[test]
fn a_camera_whose_pictures_cease_is_waited_for_no_longer_than_asked() {
    let _loopback = Loopback::load();
    let open = || [loopback::LEFT, loopback::RIGHT].map(|path| Writer::open(path, *b"GREY", 64, 48));
    let show = |writers: &mut [Writer; 2]| writers.iter_mut().for_each(|writer| writer.write(&[100; 64 * 48]));
    let mut writers = open();
    show(&mut writers);
    let settings = CameraSettings {
        timeout_ms: Some(300),
        pairing_tolerance_ms: 100.0,
        // Every pair counts here, also the one that waits when the first is asked for.
        newest_only: false,
        ..CameraSettings::two(loopback::LEFT, loopback::RIGHT, 64, 48)
    };
    let mut camera = V4l2Camera::open(&settings).unwrap();
    show(&mut writers);
    next(&mut camera).unwrap();
    drop(writers);
    let start = Instant::now();
    let error = first_error(&mut camera, 10).expect("somebody killed the producer");
    assert_eq!(error.kind(), CameraErrorKind::NoPicture, "{error}");
    say!("silence told after {} ms, with a time-out of 300 ms", start.elapsed().as_millis());
    let mut writers = open();
    let start = Instant::now();
    loop {
        show(&mut writers);
        match next(&mut camera) {
            Ok(_) => break,
            Err(error) => assert!(start.elapsed() < RECOVERY, "not good again: {error}"),
        }
    }
}
