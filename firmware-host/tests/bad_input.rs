//! Everything that can be wrong with the input: a clear error or a clear warning each, no panic, and what was written stays
//! readable.

mod common;

use std::{fs, path::Path};

use common::{fencepost, recording, replay};

/// Replaces a picture by another of the size and kind given.
fn write_picture(path: &Path, (width, height): (u32, u32), colour: png::ColorType, depth: png::BitDepth) {
    let samples = colour.samples() * if depth == png::BitDepth::Sixteen { 2 } else { 1 };
    let file = fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let data: Vec<u8> = (0..width * height * samples as u32).map(|k| (k * 97 % 251) as u8).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
}

#[test]
fn a_missing_picture_is_said_and_the_others_are_complete() {
    let recording = recording();
    fs::remove_file(recording.path().join("image_1/000002.png")).unwrap();
    let run = replay(recording.path(), &[]);
    run.assert(
        1,
        &[
            "error: frame 2: the picture is missing",
            "where: ",
            "image_1/000002.png",
            "mend:  copy it again",
            "1 of 4 frames",
        ],
    );
    run.assert_frames(&[0, 1, 3]);
    let summary = run.summary();
    assert_eq!(summary["frames"]["failed"], 1);
    assert_eq!(summary["failures"][0]["frame"], 2);
    assert_eq!(summary["health"]["reasons"]["missing_picture"], 1);
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.contains("Frames that could not be used") && page.contains("000002.png"));
}

#[test]
fn a_missing_picture_is_said_on_the_bus() {
    let recording = recording();
    fs::remove_file(recording.path().join("image_0/000001.png")).unwrap();
    let run = replay(recording.path(), &["--write", "can"]);
    let decoded = fencepost().args(["can", "decode"]).arg(run.out.join("can.log")).output().unwrap();
    let text = String::from_utf8(decoded.stdout).unwrap();
    let said = text.lines().find(|line| line.contains("missing_picture")).unwrap();
    assert!(said.contains("Heartbeat") && said.contains("blind"), "{text}");
}

#[test]
fn a_truncated_picture() {
    let recording = recording();
    let path = recording.path().join("image_0/000001.png");
    let bytes = fs::read(&path).unwrap();
    for length in [bytes.len() / 2, 30, 8, 0] {
        fs::write(&path, &bytes[..length]).unwrap();
        let run = replay(recording.path(), &[]);
        run.assert(1, &["frame 1", "image_0/000001.png", "truncated or not a picture"]).assert_frames(&[0, 2, 3]);
    }
}

#[test]
fn not_a_picture() {
    let recording = recording();
    fs::write(recording.path().join("image_1/000000.png"), "this is a letter, not a picture").unwrap();
    let run = replay(recording.path(), &[]);
    run.assert(1, &["frame 0", "image_1/000000.png", "cannot be decoded"]).assert_frames(&[1, 2, 3]);
}

#[test]
fn nothing_but_broken_pictures() {
    let recording = recording();
    for number in 0..4 {
        fs::write(recording.path().join(format!("image_1/{number:06}.png")), "x").unwrap();
    }
    let run = replay(recording.path(), &[]);
    run.assert(1, &["4 of 4 frames"]);
    assert_eq!(run.summary()["frames"]["detected"], 0);
    assert!(fs::read_to_string(run.out.join("report.html")).unwrap().contains("No frame could be looked at"));
}

#[test]
fn sixteen_bit_and_colour_pictures_are_converted_and_said() {
    let recording = recording();
    let path = |name: &str| recording.path().join(name);
    write_picture(&path("image_0/000001.png"), (160, 120), png::ColorType::Grayscale, png::BitDepth::Sixteen);
    write_picture(&path("image_1/000002.png"), (160, 120), png::ColorType::Rgb, png::BitDepth::Eight);
    let run = replay(recording.path(), &[]);
    run.assert(0, &["warning: ", "16 bits", "colours", "turned to grey"]).assert_frames(&[0, 1, 2, 3]);
    assert!(run.summary()["warnings"].as_array().unwrap().len() >= 2);
}

#[test]
fn left_and_right_of_different_size() {
    let recording = recording();
    let path = recording.path().join("image_1/000003.png");
    write_picture(&path, (150, 120), png::ColorType::Grayscale, png::BitDepth::Eight);
    let run = replay(recording.path(), &[]);
    run.assert(1, &["frame 3", "150 x 120", "160 x 120", "same size"]).assert_frames(&[0, 1, 2]);
}

#[test]
fn pictures_larger_than_the_capacity() {
    let recording = recording();
    for side in ["image_0", "image_1"] {
        for number in 0..4 {
            let path = recording.path().join(format!("{side}/{number:06}.png"));
            write_picture(&path, (2200, 40), png::ColorType::Grayscale, png::BitDepth::Eight);
        }
    }
    replay(recording.path(), &[]).assert(1, &["2200", "2048", "mend:"]);
}

/// Replaces a word of calib.txt.
fn spoil_calibration(recording: &Path, camera: &str, place: usize, value: &str) {
    let file = recording.join("calib.txt");
    let text = fs::read_to_string(&file).unwrap();
    let lines: Vec<String> = text
        .lines()
        .map(|line| match line.strip_prefix(camera) {
            Some(rest) => {
                let mut words: Vec<&str> = rest.split_whitespace().collect();
                words[place] = value;
                format!("{camera} {}", words.join(" "))
            }
            None => line.to_string(),
        })
        .collect();
    fs::write(file, lines.join("\n")).unwrap();
}

#[test]
fn calibrations_that_cannot_be_used() {
    for (camera, place, value, says) in [
        ("P0:", 0, "nan", "finite"),
        ("P0:", 0, "0", "focal length"),
        ("P0:", 0, "-130", "focal length"),
        ("P1:", 3, "0", "baseline"),
        ("P1:", 3, "15.6", "exchanged"),
        ("P1:", 3, "inf", "finite"),
        ("P1:", 3, "what", "number"),
    ] {
        let recording = recording();
        spoil_calibration(recording.path(), camera, place, value);
        let run = replay(recording.path(), &[]);
        run.assert(1, &["error: ", "calib.txt", &camera[..2], says]);
        let check = fencepost().arg("check").arg(recording.path()).assert().code(1);
        let said = String::from_utf8_lossy(&check.get_output().stderr).into_owned();
        assert!(said.contains(says), "{said}");
    }
}

#[test]
fn no_calibration_at_all() {
    let recording = recording();
    fs::remove_file(recording.path().join("calib.txt")).unwrap();
    replay(recording.path(), &[]).assert(1, &["holds no calibration", "calib.txt"]);
}

#[test]
fn left_and_right_exchanged_is_said() {
    let recording = recording();
    let path = |name: &str| recording.path().join(name);
    fs::rename(path("image_0"), path("other")).unwrap();
    fs::rename(path("image_1"), path("image_0")).unwrap();
    fs::rename(path("other"), path("image_1")).unwrap();
    let run = replay(recording.path(), &[]);
    run.assert(0, &["warning: ", "left and right seem to be exchanged"]).assert_frames(&[0, 1, 2, 3]);
    assert!(run.summary()["health"]["reasons"]["exchanged"].as_u64().unwrap() >= 3);
    assert!(run.rows("ground.csv").iter().any(|row| row["health_reasons"].contains("exchanged")));
}

#[test]
fn times_that_do_not_rise() {
    let recording = recording();
    fs::write(recording.path().join("times.txt"), "0.0\n0.3\n0.1\n0.1\n").unwrap();
    let run = replay(recording.path(), &[]);
    run.assert(0, &["warning: ", "times.txt", "frame 2", "not after the one before"]).assert_frames(&[0, 1, 2, 3]);
    let log = fs::read_to_string(run.out.join("can.log")).unwrap();
    let times: Vec<&str> = log.lines().map(|line| line.split(')').next().unwrap()).collect();
    assert!(times.is_sorted(), "the log goes back in time");
}

#[test]
fn times_with_an_absurd_gap_do_not_fill_the_disk() {
    let recording = recording();
    fs::write(recording.path().join("times.txt"), "0.0\n0.1\n1.0e9\n1.0e9\n").unwrap();
    let run = replay(recording.path(), &["--write", "can"]);
    run.assert(0, &[]);
    assert!(fs::metadata(run.out.join("can.log")).unwrap().len() < 1_000_000);
}

#[test]
fn times_that_are_no_times() {
    let recording = recording();
    fs::write(recording.path().join("times.txt"), "0.0\nsoon\n").unwrap();
    replay(recording.path(), &[]).assert(1, &["times.txt", "line 2"]);
}

#[test]
fn malformed_mounts() {
    for (text, says) in [
        ("{\"height_m\": ", "not JSON"),
        ("[1, 2]", "not an object"),
        ("{\"height_m\": \"high\"}", "height_m"),
        ("{\"height_m\": -1.0, \"pitch_down_deg\": 0.0, \"roll_deg\": 0.0}", "height_m"),
        ("{\"height_m\": 1.0, \"pitch_down_deg\": 500.0, \"roll_deg\": 0.0}", "pitch_down_deg"),
    ] {
        let recording = recording();
        fs::write(recording.path().join("mount.json"), text).unwrap();
        replay(recording.path(), &[]).assert(1, &["error: ", "mount.json", says, "mend: "]);
    }
}

#[test]
fn a_mount_that_is_not_known_is_said() {
    let recording = recording();
    fs::remove_file(recording.path().join("mount.json")).unwrap();
    replay(recording.path(), &["--write", "cells"]).assert(0, &["warning: ", "mount.json", "is missing"]);
}

#[test]
fn malformed_yaml() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("calib.yaml");
    for text in ["%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n  cols: 3\n", "a: [1, 2\n", "\u{0}\u{1}", "", "{}"] {
        fs::write(&file, text).unwrap();
        let check = fencepost().arg("check").arg(&file).assert().code(1);
        let said = String::from_utf8_lossy(&check.get_output().stderr).into_owned();
        assert!(said.starts_with("error: ") && said.contains("calib.yaml"), "{text:?}: {said}");
        assert!(!said.contains("panicked"), "{said}");
    }
}

#[test]
fn folders_that_cannot_be_written() {
    let recording = recording();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "mine").unwrap();
    for out in [&file, &file.join("below"), Path::new("/proc/fencepost")] {
        let assert = fencepost().arg("replay").arg(recording.path()).arg("--out").arg(out).assert().code(1);
        let said = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(said.contains("error: cannot write") && said.contains("--out DIR"), "{said}");
    }
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
}

#[test]
fn not_a_recording() {
    let empty = tempfile::tempdir().unwrap();
    replay(empty.path(), &[]).assert(1, &["is not a recording", "image_0"]);
    replay(&empty.path().join("nowhere"), &[]).assert(1, &["is not a folder"]);
}

#[test]
fn wrong_usage_and_configuration_end_with_2() {
    let recording = recording();
    for arguments in
        [&["replay"][..], &["fly"], &["replay", "r", "--out", "o", "--write", "everything"], &["--quiet", "--verbose"]]
    {
        fencepost().args(arguments).assert().code(2);
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    for (text, says) in [
        ("[matching]\nwindow_width = 8\n", "matching.window_width"),
        ("[matching]\nwindow_height = 99\n", "matching.window_height"),
        ("[matching]\nwide_window_width = 7\n", "matching.wide_window_width"),
        ("[matching]\nwindov_width = 7\n", "windov_width"),
        ("[matching\n", "line 1"),
        ("[wire]\nnode = 16\n", "wire.node"),
    ] {
        fs::write(&file, text).unwrap();
        let run = replay(recording.path(), &["--config", file.to_str().unwrap()]);
        run.assert(2, &["error: ", "robot.toml", says, "mend: "]);
        fencepost().arg("check").arg(&file).assert().code(2);
    }
    replay(recording.path(), &["--config", "/nowhere.toml"]).assert(2, &["/nowhere.toml", "cannot be read"]);
    replay(recording.path(), &["--disparities", "9999"]).assert(2, &["matching.disparities"]);
    replay(recording.path(), &["--node", "77"]).assert(2, &["wire.node"]);
}

#[test]
fn damaged_can_logs() {
    let recording = recording();
    let run = replay(recording.path(), &["--write", "can"]);
    let log = run.out.join("can.log");
    let text = fs::read_to_string(&log).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    fencepost().args(["can", "decode"]).arg(&log).assert().success();

    let without: Vec<&str> = lines.iter().enumerate().filter(|(k, _)| *k != lines.len() / 2).map(|(_, l)| *l).collect();
    for damaged in [without.join("\n"), text.replacen(" 401#", " 402#", 1), format!("{text}rubbish\n"), String::new()] {
        fs::write(&log, damaged).unwrap();
        fencepost().args(["can", "decode"]).arg(&log).assert().code(1);
    }
    fencepost().args(["can", "decode", "/nowhere.log"]).assert().code(1);
}
