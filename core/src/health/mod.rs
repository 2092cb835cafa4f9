//! What the detector says about itself: a level, and reasons for it.

mod exposure;
mod reasons;
mod settings;

pub use exposure::Exposure;
pub use reasons::{Health, HealthLevel, HealthReason};
pub use settings::HealthSettings;

use crate::{
    detector::Statistics,
    disparity::{DisparityPicture, Reason},
    ground::GroundPlane,
};

/// What one frame gives to judge by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signs<'a> {
    pub(crate) left: Exposure,
    pub(crate) right: Exposure,
    pub(crate) picture: DisparityPicture<'a>,
    pub(crate) statistics: &'a Statistics,
    pub(crate) ground: Option<&'a GroundPlane>,
    pub(crate) exchanged: bool,
}

/// Judges a frame.
///
/// # Bound
/// One pass over the lower half of the disparity picture.
pub(crate) fn judge(signs: &Signs<'_>, settings: &HealthSettings) -> Health {
    let mut health = Health::OK;
    for exposure in [signs.left, signs.right] {
        if exposure.dark_percent >= settings.dark_percent {
            health.raise(HealthReason::Underexposed, HealthLevel::Degraded);
        }
        if exposure.bright_percent >= settings.bright_percent {
            health.raise(HealthReason::Overexposed, HealthLevel::Degraded);
        }
    }
    let (low, high) = (signs.left.mean.min(signs.right.mean), signs.left.mean.max(signs.right.mean));
    if high > settings.exposure_ratio * low.max(1.0) {
        health.raise(HealthReason::ExposureMismatch, HealthLevel::Degraded);
    }
    let coverage = 100.0 * signs.statistics.coverage();
    if coverage < settings.blind_coverage_percent {
        health.raise(HealthReason::LowCoverage, HealthLevel::Blind);
    } else if coverage < settings.low_coverage_percent {
        health.raise(HealthReason::LowCoverage, HealthLevel::Degraded);
    }
    match signs.ground {
        None => health.raise(HealthReason::NoGround, HealthLevel::Degraded),
        Some(ground) if ground.age_frames > 0 => health.raise(HealthReason::GroundHeld, HealthLevel::Degraded),
        Some(_) => {}
    }
    if signs.statistics.surfaces_dropped > 0 || signs.statistics.obstacles_dropped > 0 {
        health.raise(HealthReason::TableFull, HealthLevel::Degraded);
    }
    if 100.0 * out_of_range_below(signs.picture) >= settings.near_zone_percent {
        health.raise(HealthReason::NearZoneBlocked, HealthLevel::Degraded);
    }
    if signs.exchanged {
        health.raise(HealthReason::Exchanged, HealthLevel::Fault);
    }
    health
}

/// Share of the lower half of the picture whose best match lies at the end of the disparity range. The far end lies above the
/// horizon, so down there it is the near one.
fn out_of_range_below(picture: DisparityPicture<'_>) -> f32 {
    let pixels = picture.pixels();
    let lower = &pixels[pixels.len() / 2..];
    let out_of_range = lower.iter().filter(|pixel| pixel.get() == Err(Reason::OutOfRange)).count();
    out_of_range as f32 / lower.len().max(1) as f32
}

#[cfg(test)]
mod tests;
