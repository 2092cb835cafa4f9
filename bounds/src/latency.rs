//! Latency: from the beginning of an exposure to the last CAN frame of what was seen, for a platform that a file describes.

use std::{collections::BTreeMap, fmt, path::Path};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::{bus, instructions::Bound, work::Shape};

/// What a platform takes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Platform {
    camera: Camera,
    processor: Processor,
    /// By stage, for a frame.
    instructions: BTreeMap<String, u64>,
    bus: Bus,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Camera {
    period_us: u64,
    exposure_us: u64,
    transfer_us: u64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Processor {
    clock_hz: u64,
    instructions_per_cycle: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Bus {
    format: String,
    bit_rate: u32,
    #[serde(default)]
    other_bits: u64,
}

/// The parts of the latency, in the order in which they come.
#[derive(Debug)]
pub(crate) struct Latency {
    /// What it is, how it is known, microseconds.
    parts: Vec<(String, &'static str, u64)>,
    period_us: u64,
    processing_us: u64,
    scan_us: u64,
}

impl Platform {
    /// # Errors
    /// The file cannot be read, or says what no platform can be.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read the platform {}", path.display()))?;
        Self::parse(&text).with_context(|| format!("the platform {} cannot be used", path.display()))
    }

    fn parse(text: &str) -> Result<Self> {
        let platform: Self = toml::from_str(text)?;
        let Processor { clock_hz, instructions_per_cycle } = platform.processor;
        if clock_hz == 0 || !(0.01..=16.0).contains(&instructions_per_cycle) {
            bail!("processor: the clock must tick, with 0.01 to 16 instructions in a cycle");
        }
        if platform.bus.bit_rate == 0 || platform.camera.period_us == 0 {
            bail!("bus.bit_rate and camera.period_us must not be 0");
        }
        // A stage that is forgotten would make the sum too small.
        let stages: Vec<_> = Shape::of(128, 96, 16).stages().into_iter().map(|stage| stage.stage).collect();
        if let Some(missing) = stages.iter().find(|stage| !platform.instructions.contains_key(**stage)) {
            bail!("instructions.{missing} is missing");
        }
        if let Some(unknown) = platform.instructions.keys().find(|name| !stages.contains(&name.as_str())) {
            bail!("instructions.{unknown} is no stage; there are {}", stages.join(", "));
        }
        Ok(platform)
    }

    /// The worst case: a picture that comes just after the detector has begun with the one before, if that can be. Stages that have a
    /// bound take that instead of what was measured.
    ///
    /// # Errors
    /// A format that does not exist.
    pub(crate) fn latency(&self, bounds: &[Bound]) -> Result<Latency> {
        let Camera { period_us, exposure_us, transfer_us } = self.camera;
        let Some((_, wire)) = bus::formats().into_iter().find(|(name, _)| *name == self.bus.format) else {
            bail!("bus.format is {:?}, neither classic nor fd", self.bus.format);
        };
        let rate = self.processor.clock_hz as f64 * self.processor.instructions_per_cycle;
        let us = |instructions: u64| (instructions as f64 * 1.0e6 / rate).ceil() as u64;
        let stages: Vec<_> = Shape::of(128, 96, 16).stages().into_iter().map(|stage| stage.stage).collect();
        let of_stage = |stage: &str| match bounds.iter().find(|bound| bound.stage == stage) {
            Some(bound) => ("bounded", us(bound.instructions)),
            None => ("measured", us(self.instructions.get(stage).copied().unwrap_or_default())),
        };
        let processing_us: u64 = stages.iter().map(|stage| of_stage(stage).1).sum();
        let scan_us = bus::scan_us(&wire, self.bus.bit_rate)
            + (self.bus.other_bits * 1_000_000).div_ceil(u64::from(self.bus.bit_rate));
        // While a frame is worked on no other is; the newest that came meanwhile is next.
        let waiting_us = if processing_us > period_us { processing_us } else { 0 };
        // The scan before may still be on its way.
        let queued_us = scan_us.saturating_sub(period_us.max(processing_us));
        let mut parts = vec![
            ("exposure".to_owned(), "given", exposure_us),
            ("transfer".to_owned(), "given", transfer_us),
            ("waiting for the frame before".to_owned(), "derived", waiting_us),
        ];
        parts.extend(stages.iter().map(|stage| {
            let (known, us) = of_stage(stage);
            ((*stage).to_owned(), known, us)
        }));
        parts.push(("waiting for the scan before".to_owned(), "derived", queued_us));
        parts.push((format!("scan on the bus, {} at {} bit/s", self.bus.format, self.bus.bit_rate), "proven", scan_us));
        Ok(Latency { parts, period_us, processing_us, scan_us })
    }
}

impl Latency {
    fn whole_us(&self) -> u64 {
        self.parts.iter().map(|(.., us)| us).sum()
    }

    /// Whether pictures and scans keep up with the camera: where they do not, some are left out, or wait without end.
    pub(crate) fn keeps_up(&self) -> bool {
        self.processing_us <= self.period_us && self.scan_us <= self.period_us
    }
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "LATENCY, milliseconds from the beginning of the exposure to the last frame on the bus, at most")?;
        for (name, known, us) in &self.parts {
            writeln!(f, "{:>10.3}  {known:<9} {name}", *us as f64 * 1.0e-3)?;
        }
        writeln!(f, "{:>10.3}            the sum", self.whole_us() as f64 * 1.0e-3)?;
        let slowest_us = self.processing_us.max(self.scan_us).max(1);
        writeln!(f, "{:>10.2}  frames a second at most", 1.0e6 / slowest_us as f64)?;
        if !self.keeps_up() {
            let period_ms = self.period_us as f64 * 1.0e-3;
            writeln!(f, "DOES NOT KEEP UP: a picture comes every {period_ms:.1} ms")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = include_str!("../platforms/cortex-m7.toml");

    /// The line of the example that says what a stage takes.
    fn line_of(stage: &str) -> &'static str {
        let begins_so = |line: &&str| line.strip_prefix(stage).is_some_and(|rest| rest.starts_with(" = "));
        EXAMPLE.lines().find(begins_so).unwrap()
    }

    /// What that is at 480 instructions in a microsecond, rounded up.
    fn written_us(stage: &str) -> u64 {
        let figure = line_of(stage).split(" = ").nth(1).unwrap();
        figure.replace('_', "").parse::<u64>().unwrap().div_ceil(480)
    }

    #[test]
    fn the_example_adds_up() {
        let latency = Platform::parse(EXAMPLE).unwrap().latency(&[]).unwrap();
        let stages = ["rectify", "match", "validate", "surfaces", "ground", "obstacles", "map", "health", "wire"];
        assert_eq!(latency.processing_us, stages.map(written_us).iter().sum::<u64>());
        assert_eq!(latency.whole_us(), 10_000 + 33_000 + latency.processing_us + 56_430);
        assert!(latency.keeps_up());
    }

    #[test]
    fn a_bound_is_taken_instead_of_what_was_measured() {
        let bound = Bound { stage: "map", instructions: 48_000_000, loops: 1, blocks: Vec::new() };
        let platform = Platform::parse(EXAMPLE).unwrap();
        let whole_us = platform.latency(&[]).unwrap().processing_us;
        let latency = platform.latency(&[bound]).unwrap();
        assert_eq!(latency.processing_us, whole_us - written_us("map") + 100_000);
        assert!(latency.to_string().contains("100.000  bounded   map"), "{latency}");
    }

    #[test]
    fn what_is_too_slow_waits_and_is_told() {
        let fast = EXAMPLE.replace("period_us = 1_000_000", "period_us = 50_000");
        let latency = Platform::parse(&fast).unwrap().latency(&[]).unwrap();
        assert_eq!(latency.whole_us(), 10_000 + 33_000 + 2 * latency.processing_us + 56_430);
        assert!(!latency.keeps_up());
        assert!(latency.to_string().contains("DOES NOT KEEP UP"));
    }

    #[test]
    fn what_is_missing_or_unknown_is_named() {
        let told = |text: &str| format!("{:#}", Platform::parse(text).unwrap_err());
        assert!(told(&EXAMPLE.replace(line_of("health"), "")).contains("instructions.health is missing"));
        assert!(told(&EXAMPLE.replace("health =", "healht = 1\nhealth =")).contains("instructions.healht is no stage"));
        assert!(told(&EXAMPLE.replace("= 1.0", "= 0.0")).contains("processor"));
        let format = Platform::parse(&EXAMPLE.replace("\"classic\"", "\"lin\"")).unwrap().latency(&[]).unwrap_err();
        assert!(format.to_string().contains("\"lin\""));
    }
}
