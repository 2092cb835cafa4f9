//! Every file that `replay` writes, read back.

mod common;

use std::fs;

use common::{FRAMES, add_true_disparity, fencepost, recording, replay};

#[test]
fn replay_writes_everything() {
    let recording = recording();
    let run = replay(recording.path(), &[]);
    run.assert(0, &[]).assert_frames(&[0, 1, 2, 3]);
    for name in ["cells.csv", "obstacles.csv", "ground.csv", "can.log", "summary.json", "report.html"] {
        assert!(run.out.join(name).is_file(), "{name}");
    }
    assert!(run.stdout.contains("report.html") && run.stdout.contains("total"), "{}", run.stdout);

    let summary = run.summary();
    assert_eq!(summary["frames"]["detected"], FRAMES);
    assert_eq!(summary["frames"]["failed"], 0);
    for stage in ["rectify", "match", "validate", "surfaces", "ground", "obstacles", "map", "wire", "total"] {
        for figure in ["median_ms", "p99_ms", "max_ms"] {
            assert!(summary["stages"][stage][figure].is_f64(), "{stage} {figure}: {summary}");
        }
    }
    let pixels: u64 =
        summary["counts"]["pixels_without"].as_object().unwrap().values().map(|v| v.as_u64().unwrap()).sum();
    let with = summary["counts"]["pixels_with_disparity"].as_u64().unwrap();
    assert_eq!(pixels + with, 160 * 120 * u64::from(FRAMES));
    assert!(with > 0);
    let cells = run.rows("cells.csv");
    let of = |state: &str| cells.iter().filter(|row| row["state"] == state).count() as u64;
    assert_eq!(summary["counts"]["cells_obstacle"], of("obstacle"));
    assert_eq!(summary["counts"]["cells_free"], of("free"));
}

#[test]
fn the_tables_hold_what_the_bus_says_in_its_order() {
    let recording = recording();
    for arguments in [&[][..], &["--can-fd"], &["--node", "5"]] {
        let run = replay(recording.path(), arguments);
        run.assert(0, &[]);
        let decoded = fencepost().args(["can", "decode", "--json"]).arg(run.out.join("can.log")).output().unwrap();
        let mut on_the_bus = Vec::new();
        for line in String::from_utf8(decoded.stdout).unwrap().lines() {
            let value: serde_json::Value = serde_json::from_str(line).unwrap();
            if value["message"] == "scan" {
                for cell in value["cells"].as_array().unwrap() {
                    let number = |name: &str| cell[name].as_f64().unwrap();
                    let state = cell["state"].as_str().unwrap().to_string();
                    on_the_bus.push((value["scan"].to_string(), number("x_m"), number("y_m"), state));
                }
            }
        }
        let table: Vec<_> = run
            .rows("cells.csv")
            .iter()
            .map(|row| {
                let number = |name: &str| row[name].parse::<f64>().unwrap();
                (row["frame"].clone(), number("x_m"), number("y_m"), row["state"].clone())
            })
            .collect();
        assert!(!table.is_empty());
        assert_eq!(table, on_the_bus, "{arguments:?}");
        for (_, x, y, _) in &table {
            for centre in [x, y] {
                assert_eq!((centre / 0.5 - 0.5).fract(), 0.0, "cells have their edges at whole multiples of 0.5 m");
            }
        }
    }
}

#[test]
fn pictures_have_their_size_and_depth() {
    let recording = recording();
    let run = replay(recording.path(), &[]);
    let size = |name: &str| {
        let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(run.out.join(name)).unwrap()));
        let reader = decoder.read_info().unwrap();
        (reader.info().width, reader.info().height, reader.info().bit_depth, reader.info().color_type)
    };
    assert_eq!(size("disparity/000002.png"), (160, 120, png::BitDepth::Sixteen, png::ColorType::Grayscale));
    assert_eq!(size("classes/000002.png"), (160, 120, png::BitDepth::Eight, png::ColorType::Rgb));
    assert_eq!(size("map/000002.png").2, png::BitDepth::Eight);
}

#[test]
fn the_same_recording_gives_the_same_bytes() {
    let recording = recording();
    let [first, second] = [replay(recording.path(), &[]), replay(recording.path(), &[])];
    for name in [
        "cells.csv",
        "obstacles.csv",
        "ground.csv",
        "can.log",
        "disparity/000003.png",
        "classes/000003.png",
        "map/000003.png",
    ] {
        assert_eq!(fs::read(first.out.join(name)).unwrap(), fs::read(second.out.join(name)).unwrap(), "{name}");
    }
}

#[test]
fn outputs_and_frames_can_be_picked() {
    let recording = recording();
    let run = replay(recording.path(), &["--write", "cells,map", "--frames", "1..3"]);
    run.assert(0, &[]);
    assert_eq!(run.frames_in("ground.csv"), [1, 2]);
    let mut names: Vec<_> =
        fs::read_dir(&run.out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["cells.csv", "ground.csv", "map", "obstacles.csv", "summary.json"]);
    replay(recording.path(), &["--frames", "7..9"])
        .assert(2, &["no frame with such a number", "--frames 7..9", "0 to 3"]);
}

#[test]
fn the_report_is_one_file_that_loads_nothing() {
    let recording = recording();
    let run = replay(recording.path(), &["--write", "report"]);
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    for letter in ["(a)", "(b)", "(c)", "(d)", "(e)", "(f)", "(g)", "(h)"] {
        assert!(page.contains(&format!("<span class=\"letter\">{letter}</span>")), "figure {letter}");
    }
    assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 9 * FRAMES as usize);
    // Names of namespaces are no requests.
    let page = page.replace("http://www.w3.org/2000/svg", "");
    for word in ["http://", "https://", "<script", "<link", "@import", "src=\"/", "url("] {
        assert!(!page.contains(word), "{word}");
    }
    assert!(page.contains("camera") && page.contains("<svg"));
}

#[test]
fn a_recording_with_truth_is_scored() {
    let recording = recording();
    assert_eq!(replay(recording.path(), &["--write", "can"]).summary()["score"], serde_json::Value::Null);
    add_true_disparity(recording.path());
    let run = replay(recording.path(), &["--write", "can,report"]);
    run.assert(0, &[]);
    let score = &run.summary()["score"];
    assert_eq!(score["cells"], serde_json::Value::Null);
    let figure = |name: &str| score["disparity"][name].as_f64().unwrap();
    assert!(figure("pixels") > 30_000.0 && figure("density") > 0.3 && figure("bad3") < 0.2, "{score}");
    assert!(run.stdout.contains("truth       disparity: density"), "{}", run.stdout);
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.contains("Against the truth") && page.contains("Disparity against truth"));
}

#[test]
fn truth_that_cannot_be_used_is_said_and_left_out() {
    let recording = recording();
    add_true_disparity(recording.path());
    let path = |name: &str| recording.path().join(name);
    let whole = replay(recording.path(), &["--write", "can"]).summary()["score"]["disparity"]["pixels"].clone();
    fs::write(path("disp_occ_0/000000.png"), b"a letter").unwrap();
    fs::copy(path("image_0/000001.png"), path("disp_occ_0/000001.png")).unwrap();
    let small = fencepost::paint::grey16_png(4, 4, &[256; 16]);
    fs::write(path("disp_occ_0/000002.png"), small).unwrap();
    let run = replay(recording.path(), &["--write", "can"]);
    run.assert(0, &["frame 0", "000000.png", "cannot be decoded", "frame 1", "grey with 16 bits", "frame 2", "4 x 4"]);
    let pixels = run.summary()["score"]["disparity"]["pixels"].clone();
    assert!(pixels.as_u64().unwrap() > 0 && pixels.as_u64() < whole.as_u64(), "{pixels} of {whole}");

    // Sweeps, and nothing that says how the lidar sits; then something that cannot be.
    fs::create_dir(path("velodyne")).unwrap();
    replay(recording.path(), &["--write", "can"]).assert(0, &["velodyne", "`Tr:`", "calib.txt"]);
    let calibration = fs::read_to_string(path("calib.txt")).unwrap();
    fs::write(path("calib.txt"), format!("{}\nTr: 1 0 0\n", calibration.trim_end())).unwrap();
    replay(recording.path(), &["--write", "can"]).assert(0, &["Tr", "3x4", "not used"]);
}

#[test]
fn names_are_escaped_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let odd = folder.path().join("a<b>&'c");
    fs::rename(recording().keep(), &odd).unwrap();
    let run = replay(&odd, &["--write", "report", "--frames", "0"]);
    run.assert(0, &[]);
    let page = fs::read_to_string(run.out.join("report.html")).unwrap();
    assert!(page.contains("a&lt;b&gt;&amp;") && !page.contains("a<b>"));
}

#[test]
fn heartbeats_come_ten_times_a_second_and_the_last_says_so() {
    let recording = recording();
    fs::write(recording.path().join("times.txt"), "0.0\n0.35\n0.4\n1.0\n").unwrap();
    let run = replay(recording.path(), &["--write", "can"]);
    run.assert(0, &[]);
    let log = fs::read_to_string(run.out.join("can.log")).unwrap();
    let beats: Vec<f64> = log
        .lines()
        .filter(|line| line.contains(" 400#"))
        .map(|line| line[1..line.find(')').unwrap()].parse().unwrap())
        .collect();
    // One more tells that the node runs, and the last one that it stops.
    let mut expected: Vec<f64> = (0..=10).map(|k| f64::from(k) / 10.0).collect();
    expected.insert(1, 0.0);
    expected.push(1.0);
    assert_eq!(beats, expected);
    let decoded = fencepost().args(["can", "decode"]).arg(run.out.join("can.log")).assert().success();
    let text = String::from_utf8(decoded.get_output().stdout.clone()).unwrap();
    let beats: Vec<_> = text.lines().filter(|line| line.contains("Heartbeat")).collect();
    assert!(beats.first().unwrap().contains("starting") && beats.last().unwrap().contains("stopping"), "{text}");
    let times: Vec<&str> = log.lines().map(|line| line.split(')').next().unwrap()).collect();
    assert!(times.is_sorted(), "the log goes back in time");
}

#[test]
fn pictures_that_stay_away_are_said_to_be_stale() {
    let recording = recording();
    fs::write(recording.path().join("times.txt"), "0.0\n0.1\n1.5\n1.6\n").unwrap();
    let run = replay(recording.path(), &["--write", "can"]);
    let decoded = fencepost().args(["can", "decode"]).arg(run.out.join("can.log")).output().unwrap();
    let text = String::from_utf8(decoded.stdout).unwrap();
    let stale: Vec<_> = text.lines().filter(|line| line.contains("stale_picture")).collect();
    assert!(stale.len() >= 7 && stale.iter().all(|line| line.contains("blind")), "{text}");
}

#[test]
fn settings_come_from_a_file_and_the_command_line() {
    let recording = recording();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    fs::write(&file, "[matching]\ndisparities = 24\nwindow_width = 11\n[mount]\nheight_m = 1.2\npitch_down_deg = 9.0\nroll_deg = 0.0\n[wire]\nnode = 4\n").unwrap();
    let file = file.to_str().unwrap();
    let run = replay(recording.path(), &["--config", file, "--write", "can"]);
    run.assert(0, &[]);
    let summary = run.summary();
    assert_eq!(summary["settings"]["matching"]["disparities"], 24);
    assert_eq!(summary["settings"]["matching"]["window_width"], 11);
    assert_eq!(summary["wire"]["node"], 4);
    assert!((summary["mount"]["height_m"].as_f64().unwrap() - 1.2).abs() < 1e-6);
    assert!(fs::read_to_string(run.out.join("can.log")).unwrap().contains(" 441#"));
    let run = replay(recording.path(), &["--config", file, "--disparities", "40", "--node", "7", "--write", "can"]);
    assert_eq!(run.summary()["settings"]["matching"]["disparities"], 40);
    assert_eq!(run.summary()["wire"]["node"], 7);
    assert_eq!(replay(recording.path(), &["--write", "can"]).summary()["settings"]["matching"]["disparities"], 32);
}
