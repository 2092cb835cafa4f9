//! What the detector says about itself: a level, and reasons for it.

mod content;
mod debounce;
mod exposure;
mod pairing;
mod profile;
mod reasons;
mod row_error;
mod settings;
mod tiles;

pub use content::ContentSigns;
pub(crate) use content::{Content, RowLooks, rows_around, unit_of_bands};
pub use debounce::{Debounce, Findings};
pub use exposure::Exposure;
pub(crate) use exposure::RecentPictures;
pub use pairing::PairingSign;
pub use reasons::{Health, HealthLevel, HealthReason};
pub use row_error::RowSign;
pub(crate) use row_error::{Ordinals, SearchRange};
pub use settings::HealthSettings;
pub use tiles::Covering;

use crate::{
    detector::Statistics,
    disparity::{DisparityPicture, DisparityPixel, Reason},
    ground::GroundPlane,
    work::{self, Loop},
};

/// Fewer tiles than this are not taken for something on a lens.
const LEAST_COVERED: u16 = 3;

/// What one frame gives to judge by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Signs<'a> {
    /// Left and right.
    pub(crate) exposures: [Exposure; 2],
    /// Whether left and right are pictures that came before.
    pub(crate) came_again: [bool; 2],
    pub(crate) content: ContentSigns,
    pub(crate) picture: DisparityPicture<'a>,
    pub(crate) statistics: &'a Statistics,
    pub(crate) ground: Option<&'a GroundPlane>,
    pub(crate) exchanged: bool,
}

/// Judges a frame by itself and by what it says about those before it.
///
/// # Bound
/// One pass over the lower half of the disparity picture.
pub(crate) fn judge(signs: &Signs<'_>, settings: &HealthSettings) -> Findings {
    let mut findings = Findings::NONE;
    judge_exposure(signs, settings, &mut findings);
    judge_content(&signs.content, settings, &mut findings);
    // From here on, what came out of the pictures.
    let coverage = 100.0 * signs.statistics.coverage();
    if coverage < settings.blind_coverage_percent {
        findings.raise(HealthReason::LowCoverage, HealthLevel::Blind);
    } else if coverage < settings.low_coverage_percent {
        findings.raise(HealthReason::LowCoverage, HealthLevel::Degraded);
    }
    match signs.ground {
        None => findings.raise(HealthReason::NoGround, HealthLevel::Degraded),
        Some(ground) if ground.age_frames > 0 => findings.raise(HealthReason::GroundHeld, HealthLevel::Degraded),
        Some(_) => {}
    }
    if signs.statistics.surfaces_dropped > 0 || signs.statistics.obstacles_dropped > 0 {
        findings.raise(HealthReason::TableFull, HealthLevel::Degraded);
    }
    let near_percent = signs.content.rows.near_percent.max(100.0 * out_of_range_below(signs.picture));
    if near_percent >= settings.near_zone_percent {
        findings.raise(HealthReason::NearZoneBlocked, HealthLevel::Degraded);
    }
    if signs.exchanged {
        findings.raise(HealthReason::Exchanged, HealthLevel::Fault);
    }
    findings
}

/// Exposure, and whether the pictures are new.
fn judge_exposure(signs: &Signs<'_>, settings: &HealthSettings, findings: &mut Findings) {
    let level = |percent: f32, degraded: f32, blind: f32| match percent {
        _ if percent >= blind => HealthLevel::Blind,
        _ if percent >= degraded => HealthLevel::Degraded,
        _ => HealthLevel::Ok,
    };
    let [left, right] = signs.exposures;
    for exposure in [left, right] {
        let dark = level(exposure.dark_percent, settings.dark_percent, settings.dark_blind_percent);
        findings.raise(HealthReason::Underexposed, dark);
        let bright = level(exposure.bright_percent, settings.bright_percent, settings.bright_blind_percent);
        findings.raise(HealthReason::Overexposed, bright);
    }
    if left.mean.max(right.mean) > settings.exposure_ratio * left.mean.min(right.mean).max(1.0) {
        findings.raise(HealthReason::ExposureMismatch, HealthLevel::Degraded);
    }
    if signs.came_again.contains(&true) {
        findings.raise(HealthReason::FrozenPicture, HealthLevel::Blind);
    }
}

/// Lenses, pairing and rows.
fn judge_content(content: &ContentSigns, settings: &HealthSettings, findings: &mut Findings) {
    let [left, right] = content.coverings;
    let excess_percent = (left.flat_percent - right.flat_percent).abs();
    let is_flat = left.flat_percent.max(right.flat_percent) >= settings.flat_percent;
    if is_flat {
        findings.raise(HealthReason::Blocked, HealthLevel::Blind);
    } else if excess_percent >= settings.flat_excess_percent {
        findings.raise(HealthReason::Blocked, HealthLevel::Degraded);
    }
    for covering in [left, right].into_iter().filter(|covering| covering.covered >= LEAST_COVERED) {
        let covered_percent = 100.0 * f32::from(covering.covered) / f32::from(covering.judged.max(1));
        if covered_percent >= settings.covered_blind_percent {
            findings.raise(HealthReason::Blocked, HealthLevel::Blind);
        } else if covered_percent >= settings.covered_percent {
            findings.raise(HealthReason::Blocked, HealthLevel::Degraded);
        }
    }
    // A picture that shows little is unlike the other one, and less unlike that of any other moment.
    let shows_little = is_flat
        || excess_percent >= settings.flat_excess_percent
        || [HealthReason::Underexposed, HealthReason::Overexposed]
            .iter()
            .any(|reason| findings.level(*reason) >= HealthLevel::Blind);
    let PairingSign { advantage_sigmas, likeness, .. } = content.pairing;
    if !shows_little && advantage_sigmas >= settings.pairing_sigmas && likeness >= settings.pairing_likeness {
        findings.raise(HealthReason::BadlyPaired, HealthLevel::Blind);
    }
    if content.rows.error_px >= settings.row_error_blind_px {
        findings.raise(HealthReason::BadlyRectified, HealthLevel::Blind);
    } else if content.rows.error_px >= settings.row_error_px {
        findings.raise(HealthReason::BadlyRectified, HealthLevel::Degraded);
    }
}

/// Leaves out what is told and has its cause in something else that is told. Pictures of different moments have their rows out
/// of line as well, for as long as something moves; rows that are out of line by themselves stay so.
pub(crate) fn explained(told: Health) -> Health {
    let consequence = 1 << HealthReason::BadlyRectified as u8;
    if told.has(HealthReason::BadlyPaired) { Health { reasons: told.reasons & !consequence, ..told } } else { told }
}

/// Share of the lower half of the picture whose best match lies at the end of the disparity range. The far end lies above the
/// horizon, so down there it is the near one.
fn out_of_range_below(picture: DisparityPicture<'_>) -> f32 {
    let pixels = picture.pixels();
    let lower = &pixels[pixels.len() / 2..];
    let said = DisparityPixel::none(Reason::OutOfRange);
    work::count(Loop::HealthPixels, lower.len());
    // Zero reads as out of range, too. In short pieces the count fits 16 bits, as wide as the pixels.
    let is_so = |pixel: &DisparityPixel| u16::from(*pixel == said) | u16::from(pixel.bits() == 0);
    let counts = lower.chunks(4096).map(|piece| usize::from(piece.iter().map(is_so).fold(0u16, u16::wrapping_add)));
    let out_of_range = counts.fold(0, usize::wrapping_add);
    out_of_range as f32 / lower.len().max(1) as f32
}

#[cfg(test)]
mod tests;
