//! `bench`: how long the detector takes.

use fencepost_core::wire::WireConfig;

use super::Ending;
use crate::{
    bench::{BenchPictures, Job, Report, measure},
    cli::BenchArgs,
    config::Config,
    console::Console,
    detector,
    error::Failure,
};

/// Size of the rendered pictures unless another one is asked for: that of the LAGR robot.
const RENDERED_SIZE: (u32, u32) = (512, 384);

/// Measures how long the detector takes from a raw pair to CAN payloads.
///
/// # Errors
/// When the recording, the size or the configuration cannot be used.
pub fn bench(args: &BenchArgs, console: &mut Console) -> Result<Ending, Failure> {
    let config = Config::load(&args.detector)?;
    let wire = WireConfig::new(config.wire).map_err(|error| Failure::config(error, config.file.as_deref()))?;
    let wanted = args.size.map(|size| (size.width, size.height));
    let mut pictures = match &args.recording {
        Some(folder) => BenchPictures::recorded(folder, wanted, console)?,
        None => BenchPictures::rendered(wanted.unwrap_or(RENDERED_SIZE))?,
    };
    if let Some(mount) = config.mount {
        pictures.mount = mount;
    }
    let size = pictures.size();
    let settings = config.settings_for(size.0);
    console.note(format_args!("{}: {} pairs in memory", pictures.name, pictures.pairs.len()));
    let (threads, bands, frames) = (usize::from(args.threads), usize::from(args.bands), args.frames as usize);
    let backend = args.backend;
    let job = Job { settings: &settings, wire, backend, file: config.file.as_deref(), threads, bands, frames };
    let measurement = measure(&pictures, &job)?;
    let report = Report {
        pictures: pictures.name,
        size,
        disparities: settings.matching.disparities,
        // Not the one that was asked for: where its vectors have no room or no gain, a slower one serves.
        backend: detector::lock_one(0).backend(),
        measurement,
    };
    match args.json {
        true => console.result(format_args!("{:#}", report.json())),
        false => console.result(report.table()),
    }
    Ok(Ending::Good)
}
