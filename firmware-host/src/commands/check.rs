//! `check`: what a recording, a calibration or a configuration holds, and what can be seen with it.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use fencepost_core::{
    detector::{Capacities, memory_bytes},
    geometry::{CameraModel, Mount, RectifiedPair, StereoCalibration},
    settings::Settings,
    wire::{WireConfig, max_bits_per_scan, max_frames_per_scan, max_load_permille},
};
use fencepost_hal::{
    calibration::Calibration,
    recording::{RecordedCamera, Recording},
};

use super::{Ending, optics};
use crate::{
    cli::CheckArgs,
    config::{Config, Rig},
    console::Console,
    detector::{self, ProgramDetector},
    error::Failure,
    live::BusSettings,
    source::Source,
    summary, words,
};

/// Says what is at a path.
///
/// # Errors
/// When it cannot be used.
pub fn check(args: &CheckArgs, console: &mut Console) -> Result<Ending, Failure> {
    let is_configuration = args.path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
    if is_configuration {
        return check_configuration(args, console);
    }
    let config = Config::load(&args.detector)?;
    if args.path.is_dir() {
        check_recording(&args.path, &config, console)
    } else {
        check_calibration(args, &config, console)
    }
}

fn check_recording(folder: &Path, config: &Config, console: &mut Console) -> Result<Ending, Failure> {
    let recording = Recording::open(folder)?;
    for warning in &recording.warnings {
        console.warn(warning);
    }
    let mut text = String::new();
    let (first, last) = (recording.frames.first(), recording.frames.last());
    let number = |frame: Option<&fencepost_hal::recording::RecordedFrame>| frame.map_or(0, |f| f.number);
    line(&mut text, "recording", folder.display());
    line(&mut text, "layout", recording.layout);
    line(
        &mut text,
        "frames",
        format_args!("{}, numbered {} to {}", recording.frames.len(), number(first), number(last)),
    );
    line(&mut text, "times", times_in_words(&recording));
    let truth = [(&recording.truth.disparity, "disparity"), (&recording.truth.lidar, "lidar")];
    let truth: Vec<_> = truth.into_iter().filter(|(path, _)| path.is_some()).map(|(_, name)| name).collect();
    line(&mut text, "truth", if truth.is_empty() { "none".to_string() } else { truth.join(" and ") });
    let calibration = recording.calibration.clone();
    let mount = config.mount.unwrap_or(recording.mount);
    let broken = read_all(recording.into_camera(), console);
    line(
        &mut text,
        "pictures",
        match broken {
            0 => "all can be read".to_string(),
            count => format!("{count} frames cannot be used"),
        },
    );
    describe_calibration(&mut text, &calibration);
    let ending = if broken == 0 { Ending::Good } else { Ending::InputBad };
    describe_view(&mut text, &calibration.stereo, &mount, config)?;
    console.result(text.trim_end());
    Ok(ending)
}

fn check_calibration(args: &CheckArgs, config: &Config, console: &mut Console) -> Result<Ending, Failure> {
    let paths: Vec<&PathBuf> = [Some(&args.path), args.right.as_ref()].into_iter().flatten().collect();
    let calibration = Calibration::load(&paths, None)?;
    for warning in &calibration.warnings {
        console.warn(warning);
    }
    let mut text = String::new();
    describe_calibration(&mut text, &calibration);
    describe_view(&mut text, &calibration.stereo, &config.mount.unwrap_or_default(), config)?;
    console.result(text.trim_end());
    Ok(Ending::Good)
}

fn check_configuration(args: &CheckArgs, console: &mut Console) -> Result<Ending, Failure> {
    let (config, mistakes) = Config::read_all(&args.path, true)?;
    let file = args.path.display();
    for mistake in &mistakes {
        let field = if mistake.field.is_empty() { String::new() } else { format!("{} ", mistake.field) };
        let place = mistake.line.map_or_else(|| file.to_string(), |line| format!("{file}, line {line}"));
        console.error(Failure::usage(format!("{field}{}", mistake.problem)).at(place).mend(&mistake.mend));
    }
    match mistakes.len() {
        0 => {}
        1 => return Err(Failure::usage(format!("there is a mistake in {file}"))),
        count => return Err(Failure::usage(format!("there are {count} mistakes in {file}"))),
    }
    let mut text = String::new();
    line(&mut text, "configuration", &file);
    if config.rig.pairs.is_empty() {
        check_settings(&mut text, &config)?;
    } else {
        check_rig(&mut text, &config, console)?;
    }
    let all = toml::to_string(&config.settings_for(640)).map_err(|error| Failure::work(error.to_string()))?;
    let _ = write!(text, "\nAll settings of the detector, with those that were not set:\n\n{all}");
    console.result(text.trim_end());
    Ok(Ending::Good)
}

/// A configuration without cameras.
fn check_settings(text: &mut String, config: &Config) -> Result<(), Failure> {
    // A camera as it is often used; the settings do not depend on it.
    let pair = RectifiedPair {
        width: 640,
        height: 480,
        focal_px: 500.0,
        cx: 319.5,
        cy: 239.5,
        baseline_m: 0.12,
        disparity_offset_px: 0.0,
    };
    let settings = config.settings_for(pair.width);
    let mount = config.mount.unwrap_or_default();
    detector::lock()
        .configure(&settings, &StereoCalibration::Rectified(pair), &mount)
        .map_err(|error| Failure::config(error, config.file.as_deref()))?;
    line(
        text,
        "disparities",
        match config.has_disparities() {
            true => settings.matching.disparities.to_string(),
            false => "an eighth of the picture’s width, in steps of 16, within 16 to 128".to_string(),
        },
    );
    line(
        text,
        "mount",
        match config.mount {
            Some(mount) => summary::mount_words(&mount),
            None => "as the recording says".to_string(),
        },
    );
    describe_bus(text, config)?;
    line(text, "memory", format_args!("{} in this program", words::bytes(size_of::<ProgramDetector>())));
    Ok(())
}

/// A configuration with cameras: what each pair will see, and how busy the bus will be at most.
fn check_rig(text: &mut String, config: &Config, console: &mut Console) -> Result<(), Failure> {
    let Rig { bus, run, pairs } = &config.rig;
    for pair in pairs {
        pair.warnings.iter().for_each(|warning| console.warn(format_args!("pair {}: {warning}", pair.name)));
        let _ = writeln!(text, "\npair {}", pair.name);
        line(text, "pictures", pair.source.describe());
        let files: Vec<_> = pair.calibration_files.iter().map(|file| file.display().to_string()).collect();
        if !files.is_empty() {
            line(text, "calibration", files.join(", "));
        }
        describe_view(text, &pair.calibration, &pair.mount, config)?;
    }
    let _ = writeln!(text, "\nloop");
    line(text, "deadline", format_args!("{} ms from exposure to the last CAN frame", run.deadline_ms));
    line(text, "stale", format_args!("after {} ms", run.stale_ms));
    line(
        text,
        "real time",
        match run.priority {
            0 => "not asked for".to_string(),
            priority => format!(
                "SCHED_FIFO, priority {priority}; memory {}",
                if run.lock_memory { "locked" } else { "not locked" }
            ),
        },
    );
    let wire = WireConfig::new(config.wire).map_err(|error| Failure::config(error, config.file.as_deref()))?;
    // Pairs that are not triggered together make a scan each.
    let rate_hz = pairs.iter().map(|pair| pair.source.rate_hz()).sum::<f32>().ceil() as u16;
    let permille = max_load_permille(&wire, bus.bitrate, rate_hz);
    line(
        text,
        "bus",
        format_args!(
            "{}, at most {:.1} % of {} kbit/s at {rate_hz} scans a second",
            if bus.interface == BusSettings::NONE { "none: nothing is sent" } else { &bus.interface },
            f64::from(permille) / 10.0,
            bus.bitrate / 1000,
        ),
    );
    for pair in pairs {
        let period_ms = 1000.0 / pair.source.rate_hz();
        if (run.stale_ms as f32) < 2.0 * period_ms {
            console.warn(format_args!(
                "pair {}: a picture comes every {period_ms:.0} ms, and is stale after {} ms; set run.stale_ms to twice that",
                pair.name, run.stale_ms
            ));
        }
    }
    if permille > 1000 {
        console.warn(
            "the largest scans do not fit on the bus at this rate: some will be abandoned; lower wire.max_cell_frames, or \
             raise the bit rate",
        );
    }
    Ok(())
}

/// Reads every pair, and says what is wrong with those that cannot be used; gives their number.
fn read_all(mut camera: RecordedCamera, console: &mut Console) -> usize {
    use fencepost_hal::camera::Camera;
    let mut broken = 0;
    console.start_progress(camera.recording().frames.len(), "check");
    loop {
        let result = camera.next_pair(|_| ());
        for warning in Source::take_warnings(&mut camera) {
            console.warn(warning);
        }
        match result {
            Ok(None) => break,
            Ok(Some(())) => {}
            Err(error) => {
                broken += 1;
                console.error(Failure::from(error));
            }
        }
        console.progress();
    }
    console.end_progress();
    broken
}

fn times_in_words(recording: &Recording) -> String {
    let times: Vec<u64> = recording.frames.iter().map(|frame| frame.timestamp_ns).collect();
    let mut steps: Vec<u64> = times.windows(2).map(|w| w[1].saturating_sub(w[0])).filter(|step| *step > 0).collect();
    steps.sort_unstable();
    match (times.first(), times.last(), steps.get(steps.len() / 2)) {
        (Some(first), Some(last), Some(step)) => {
            let span = last.saturating_sub(*first) as f64 * 1.0e-9;
            format!("{span:.2} s, {:.1} frames a second (median)", 1.0e9 / *step as f64)
        }
        _ => "a single moment".to_string(),
    }
}

fn describe_calibration(text: &mut String, calibration: &Calibration) {
    let files: Vec<_> = calibration.files.iter().map(|file| file.display().to_string()).collect();
    line(text, "calibration", format_args!("{}: {}", calibration.format, files.join(", ")));
    match &calibration.stereo {
        StereoCalibration::Rectified(pair) => {
            line(text, "pictures", format_args!("{} x {} px, arrive rectified", pair.width, pair.height));
        }
        StereoCalibration::Raw(raw) => {
            line(text, "pictures", format_args!("{} x {} px, raw", raw.left.width, raw.left.height));
            for (name, CameraModel { fx, fy, cx, cy, distortion, .. }) in [("left", raw.left), ("right", raw.right)] {
                let used = distortion.0.iter().rposition(|k| *k != 0.0).map_or(0, |last| last + 1);
                let lens: Vec<_> = distortion.0.iter().take(used.max(4)).map(|k| format!("{k:.4}")).collect();
                line(
                    text,
                    name,
                    format_args!("focal ({fx:.1}, {fy:.1}) px, centre ({cx:.1}, {cy:.1}) px, lens {}", lens.join(" ")),
                );
            }
        }
    }
}

fn describe_view(
    text: &mut String,
    calibration: &StereoCalibration,
    mount: &Mount,
    config: &Config,
) -> Result<(), Failure> {
    let width = match calibration {
        StereoCalibration::Rectified(pair) => pair.width,
        StereoCalibration::Raw(raw) => raw.left.width,
    };
    let settings = config.settings_for(width);
    let mut detector = detector::lock();
    detector
        .configure(&settings, calibration, mount)
        .map_err(|error| Failure::config(error, config.file.as_deref()))?;
    let pair = *detector.pair().ok_or_else(|| Failure::work("the detector has no rectified pair"))?;
    drop(detector);

    line(
        text,
        "rectified",
        format_args!(
            "{} x {} px, focal length {:.2} px, centre ({:.1}, {:.1}) px, baseline {:.4} m",
            pair.width, pair.height, pair.focal_px, pair.cx, pair.cy, pair.baseline_m
        ),
    );
    line(text, "view", format_args!("{:.1} degrees wide", optics::view_deg(&pair)));
    line(text, "mount", summary::mount_words(mount));
    describe_blind_zone(text, &pair, mount, &settings);
    describe_bus(text, config)?;
    let fitting =
        Capacities::for_pictures(pair.width as usize, pair.height as usize, usize::from(settings.matching.disparities));
    line(
        text,
        "memory",
        format_args!(
            "{} for a detector of just this size; this program holds {}, built for {}",
            words::bytes(memory_bytes(&fitting)),
            words::bytes(size_of::<ProgramDetector>()),
            detector::capacity_in_words()
        ),
    );
    describe_resolution(text, &pair, &settings);
    Ok(())
}

fn describe_blind_zone(text: &mut String, pair: &RectifiedPair, mount: &Mount, settings: &Settings) {
    let (nearest_m, _) = optics::range_m(pair, &settings.matching);
    line(
        text,
        "blind zone",
        format_args!(
            "nearer than {nearest_m:.2} m along the optical axis ({} disparities)",
            settings.matching.disparities
        ),
    );
    let assumed = if mount.height_m.is_some() { "" } else { ", if the assumed height is right" };
    let words = match (optics::ground_begins_m(pair, mount), optics::ground_in_range_m(mount, nearest_m)) {
        (None, _) => "never: the cameras look over it; pitch them down".to_string(),
        (Some(view), Some(range)) if range > view => {
            format!("{range:.2} m ahead (in the picture from {view:.2} m, but too near for the disparities){assumed}")
        }
        (Some(view), _) => format!("{view:.2} m ahead{assumed}"),
    };
    line(text, "ground from", words);
}

fn describe_bus(text: &mut String, config: &Config) -> Result<(), Failure> {
    const BITRATE: u32 = 500_000;
    const RATE_HZ: u16 = 10;
    let wire = WireConfig::new(config.wire).map_err(|error| Failure::config(error, config.file.as_deref()))?;
    line(
        text,
        "CAN",
        format_args!(
            "node {}, ids from 0x{:03X}, {}; a scan has at most {} frames and {} bits, {:.1} % of 500 kbit/s at {RATE_HZ} Hz",
            config.wire.node,
            config.wire.base_id,
            match wire.format() {
                fencepost_core::wire::FrameFormat::Classic => "classic frames",
                fencepost_core::wire::FrameFormat::Fd => "CAN FD frames for cells",
            },
            max_frames_per_scan(&wire),
            max_bits_per_scan(&wire),
            f64::from(max_load_permille(&wire, BITRATE, RATE_HZ)) / 10.0,
        ),
    );
    Ok(())
}

fn describe_resolution(text: &mut String, pair: &RectifiedPair, settings: &Settings) {
    let cell_size_m = settings.map.geometry.cell_size_m();
    let _ = writeln!(
        text,
        "\n{:>10} {:>12} {:>16} {:>16} {:>16}",
        "distance",
        "disparity",
        "step of 1/16 px",
        "step of 1/2 px",
        format!("{cell_size_m} m cell")
    );
    for row in optics::resolutions(pair, &settings.matching, cell_size_m) {
        let coarse = if row.half_pixel_m > cell_size_m { "  more than a cell" } else { "" };
        let _ = writeln!(
            text,
            "{:>8.1} m {:>9.1} px {:>14} {:>16} {:>13.1} px{coarse}",
            row.distance_m,
            row.disparity_px,
            length(row.step_m),
            length(row.half_pixel_m),
            row.cell_px
        );
    }
}

fn length(metres: f32) -> String {
    match metres {
        m if !m.is_finite() => "no end".to_string(),
        m if m < 0.01 => format!("{:.1} mm", 1000.0 * m),
        m if m < 0.1 => format!("{:.1} cm", 100.0 * m),
        m => format!("{m:.2} m"),
    }
}

fn line(text: &mut String, name: &str, value: impl std::fmt::Display) {
    let _ = writeln!(text, "{name:<13} {value}");
}
