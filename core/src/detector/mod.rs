//! The whole detector: one call from a pair of pictures to obstacle cells.

mod bands;
mod detection;
#[cfg(any(feature = "health-apart", test))]
mod health_apart;
#[cfg(feature = "interpret")]
mod interpret;
mod interpreter;
mod memory;
mod stage;

pub use bands::Band;
pub use detection::{DetectError, Detection, Statistics};
pub use memory::{Capacities, MemoryPart, band_bytes, memory_bytes};
pub use stage::{Probe, Stage};

use crate::{
    arch::Backend,
    disparity::{DisparityPicture, DisparityPixel, Reason},
    error::ConfigError,
    geometry::{Mount, Place, Rays, RectifiedPair, StereoCalibration, VehicleFrame},
    health::{
        self, Content, ContentSigns, Debounce, Exposure, HealthLevel, HealthSettings, RecentPictures, SearchRange,
        Signs,
    },
    map::SectorDistances,
    matching::{MatchSettings, Matcher, ValidSpan},
    picture::Picture,
    rectify::{Rectifier, Side},
    settings::Settings,
    surfaces::{Surface, Surfaces},
    validate::SurfaceSize,
    work::{self, Loop},
};
use interpreter::{Alone, Interpreter};

/// Rows that are matched the other way round when left and right may be exchanged.
const EXCHANGE_ROWS: usize = 8;

/// Share of their pixels that must match that way.
const EXCHANGED_SHARE: f32 = 0.25;

/// The detector: every stage and every buffer.
///
/// `PIXELS` bounds width x height, `WIDTH` the width, `DISPARITIES` the search range; `GRID` is the number of nodes of the
/// rectification map; `SURFACES`, `OBSTACLES` and `CELLS` are the capacities of the tables. A detector that is not
/// configured is all zero: in a `static` it takes no room in the image of the program.
pub struct Detector<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> {
    setup: Option<Setup>,
    rectifier: Rectifier<GRID>,
    rows: [[u8; WIDTH]; 2],
    matcher: Matcher<WIDTH, DISPARITIES>,
    disparity: [DisparityPixel; PIXELS],
    surface_size: SurfaceSize<WIDTH>,
    interpreter: Interpreter<PIXELS, WIDTH, DISPARITIES, SURFACES, CELLS>,
    health: HealthSettings,
    content: Content<WIDTH>,
    content_signs: ContentSigns,
    recent_pictures: RecentPictures,
    debounce: Debounce,
    /// One row of disparities, for looking at a few rows the other way round.
    probe_row: [DisparityPixel; WIDTH],
    detection: Detection<OBSTACLES, CELLS>,
}

/// What follows from calibration and mount.
#[derive(Clone, Copy)]
struct Setup {
    pair: RectifiedPair,
    /// Width and height of the left and the right picture as they arrive.
    picture_sizes: [(usize, usize); 2],
    /// The left camera in the frame of the vehicle and in that of the pair, where everything is worked out.
    vehicle_frame: VehicleFrame,
    frame: VehicleFrame,
    place: Place,
    rays: Rays,
    nearest_m: f32,
    sector_width_deg: f32,
}

impl<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    /// A detector that is not configured.
    pub const fn new() -> Self {
        Self {
            setup: None,
            rectifier: Rectifier::new(),
            rows: [[0; WIDTH]; 2],
            matcher: Matcher::new(),
            disparity: [DisparityPixel::from_bits(0); PIXELS],
            surface_size: SurfaceSize::new(),
            interpreter: Interpreter::new(),
            health: HealthSettings::UNSET,
            content: Content::new(),
            content_signs: ContentSigns::UNSET,
            recent_pictures: RecentPictures::NONE,
            debounce: Debounce::new(0, 0),
            probe_row: [DisparityPixel::from_bits(0); WIDTH],
            detection: Detection::new(),
        }
    }

    /// Takes settings, calibration and mount, and forgets all that was seen before.
    ///
    /// # Errors
    /// The first value that cannot be used. The detector is not configured then.
    pub fn configure(
        &mut self,
        settings: &Settings,
        calibration: &StereoCalibration,
        mount: &Mount,
    ) -> Result<(), ConfigError> {
        self.setup = None;
        self.detection.clear();
        let frames = [VehicleFrame::new(mount)?, VehicleFrame::new(&mount.without_place())?];
        let pair = self.rectifier.configure(calibration)?;
        // The mount speaks of the left camera as it is; disparities are seen by the rectified one.
        let rotation = self.rectifier.rotation(Side::Left);
        let [vehicle_frame, frame] = frames.map(|frame| rotation.map_or(frame, |rotation| frame.turned(rotation)));
        let (width, height) = (pair.width as usize, pair.height as usize);
        self.matcher.configure(&settings.matching, width, height)?;
        self.surface_size.configure(&settings.validate, width)?;
        let MatchSettings { min_disparity, disparities, .. } = settings.matching;
        // The last disparity has no neighbour to interpolate with and is never reported.
        let largest = f32::from(min_disparity) + f32::from(disparities) - 2.0;
        let setup = Setup {
            pair,
            picture_sizes: [Side::Left, Side::Right].map(|side| self.rectifier.raw_size(side)),
            vehicle_frame,
            frame,
            place: Place::new(mount),
            rays: Rays::new(&pair, &frame),
            nearest_m: pair.distance_m(largest),
            sector_width_deg: settings.map.sector_width_deg,
        };
        self.interpreter.configure(settings, &setup, mount.height_m.is_some())?;
        let chosen = self.matcher.chosen();
        self.rectifier.choose(chosen);
        self.surface_size.choose(chosen);
        self.content.choose(chosen);
        self.interpreter.choose(chosen);
        settings.health.check()?;
        self.health = settings.health;
        self.forget_pictures();
        self.debounce = Debounce::new(settings.health.trigger_frames, settings.health.release_frames);
        self.setup = Some(setup);
        Ok(())
    }

    /// Chooses whose instructions the inner loops use from the next [`Self::configure`] on; without this those of the fastest
    /// backend that the processor has. Says whether it has them; if not, nothing changes. No result depends on it.
    pub fn set_backend(&mut self, backend: Backend) -> bool {
        self.matcher.set_backend(backend)
    }

    /// The backend that the matcher uses; see [`Matcher::backend`].
    pub const fn backend(&self) -> Backend {
        self.matcher.backend()
    }

    /// Forgets all that was seen in earlier frames, as [`Self::configure`] does, and keeps what is configured.
    ///
    /// To be called when pictures did not come for long: a ground plane that is held, or a picture that came again, says
    /// something about the frame before only if there is one frame's time between them. The next frame is found to be what it
    /// would be after [`Self::configure`]. What is told of the cameras is not forgotten: a reason that was told goes on being
    /// told until [`HealthSettings::release_frames`] frames in a row have not found it, because a gap is no sign that its cause
    /// is gone; those frames, and those that a new reason must be found in, are counted anew.
    ///
    /// # Bound
    /// The clearing of counts and lengths; no buffer is gone through.
    pub fn forget(&mut self) {
        self.interpreter.forget();
        self.forget_pictures();
        self.debounce.interrupt();
        self.detection.clear();
    }

    /// Forgets the pictures that new ones are compared with.
    fn forget_pictures(&mut self) {
        self.content.clear();
        self.content_signs = ContentSigns::UNSET;
        self.recent_pictures = RecentPictures::NONE;
    }

    /// Looks at a pair of pictures. `probe` is told which stage runs.
    ///
    /// # Errors
    /// [`DetectError`]; the detection is empty then.
    ///
    /// # Bound
    /// The sum of the bounds of the stages: linear in `width x height x disparities`.
    pub fn detect(
        &mut self,
        left: &Picture<'_>,
        right: &Picture<'_>,
        probe: &mut impl Probe,
    ) -> Result<&Detection<OBSTACLES, CELLS>, DetectError> {
        let setup = self.begin(left, right)?;
        let (width, height) = (setup.pair.width as usize, setup.pair.height as usize);
        self.match_rows(left, right, width, height, probe);

        probe.enter(Stage::Validate);
        let disparity = self.disparity.get_mut(..width.saturating_mul(height)).unwrap_or_default();
        self.surface_size.run(disparity);

        let picture = DisparityPicture::new(disparity, width);
        self.interpreter.run(picture, &setup, &mut self.detection, &mut Alone, probe);

        probe.enter(Stage::Health);
        let exposures = [Exposure::of(left), Exposure::of(right)];
        Ok(self.judge(left, right, &setup, exposures))
    }

    /// Forgets the last pair and looks whether the pictures have the size that was configured.
    fn begin(&mut self, left: &Picture<'_>, right: &Picture<'_>) -> Result<Setup, DetectError> {
        self.detection.clear();
        let Some(setup) = self.setup else { return Err(DetectError::NotConfigured) };
        for (picture, expected) in [left, right].into_iter().zip(setup.picture_sizes) {
            let found = (picture.width(), picture.height());
            if found != expected {
                return Err(DetectError::WrongSize { found, expected });
            }
        }
        Ok(setup)
    }

    /// Says how far what was found can be trusted.
    fn judge(
        &mut self,
        left: &Picture<'_>,
        right: &Picture<'_>,
        setup: &Setup,
        exposures: [Exposure; 2],
    ) -> &Detection<OBSTACLES, CELLS> {
        let (width, height) = (setup.pair.width as usize, setup.pair.height as usize);
        let suspect = 100.0 * self.detection.statistics.coverage() < self.health.exchange_test_percent;
        let exchanged = suspect && self.matches_exchanged(left, right, width, height);
        self.content_signs = self.content.signs(self.health.structure_grey);
        let signs = Signs {
            exposures,
            came_again: self.recent_pictures.came_again(&exposures),
            content: self.content_signs,
            picture: picture_of(&self.disparity, width, height),
            statistics: &self.detection.statistics,
            ground: self.detection.ground.as_ref(),
            exchanged,
        };
        let findings = health::judge(&signs, &self.health);
        let told = health::explained(self.debounce.update(&findings));
        // What is told may come later than what is found, and stay longer; what is free must be right at any time.
        if findings.health().level.max(told.level) >= HealthLevel::Blind {
            self.detection.map.withhold_free();
            self.detection.statistics.count_cells(&self.detection.map);
        }
        self.detection.health = told;
        self.detection.sectors = SectorDistances::of(&self.detection.map, setup.sector_width_deg);
        &self.detection
    }

    /// Rectifies and matches, row by row.
    fn match_rows(
        &mut self,
        left: &Picture<'_>,
        right: &Picture<'_>,
        width: usize,
        height: usize,
        probe: &mut impl Probe,
    ) {
        self.matcher.begin();
        self.content.begin(width, height, self.search_range());
        let [left_row, right_row] = &mut self.rows;
        let left_row = left_row.get_mut(..width).unwrap_or_default();
        let right_row = right_row.get_mut(..width).unwrap_or_default();
        let mut next = 0usize;
        for y in 0..height {
            probe.enter(Stage::Rectify);
            let left_span = self.rectifier.row(Side::Left, left, y, left_row);
            let right_span = self.rectifier.row(Side::Right, right, y, right_row);
            probe.enter(Stage::Match);
            let spans = [ValidSpan::from(left_span), ValidSpan::from(right_span)];
            self.matcher.push(left_row, right_row, spans[0], spans[1]);
            while next < height {
                // Within the picture, which the matcher has seen to fit.
                let start = next.wrapping_mul(width);
                let Some(out) = self.disparity.get_mut(start..start.wrapping_add(width)) else { break };
                if !self.matcher.pull(next, out) {
                    break;
                }
                next = next.wrapping_add(1);
            }
            probe.enter(Stage::Health);
            self.content.push(y, [left_row, right_row], spans);
            self.content.look(&self.matcher, &self.disparity, width, next);
        }
    }

    /// The disparities that are searched.
    fn search_range(&self) -> SearchRange {
        let MatchSettings { min_disparity, disparities, .. } = *self.matcher.settings();
        let first = usize::from(min_disparity);
        SearchRange { first, last: first + usize::from(disparities).saturating_sub(1) }
    }

    /// Whether the pictures match far better when left and right are exchanged, seen on a few rows.
    ///
    /// # Bound
    /// The matching of `EXCHANGE_ROWS x (window + 2)` rows.
    fn matches_exchanged(&mut self, left: &Picture<'_>, right: &Picture<'_>, width: usize, height: usize) -> bool {
        let [left_row, right_row] = &mut self.rows;
        let left_row = left_row.get_mut(..width).unwrap_or_default();
        let right_row = right_row.get_mut(..width).unwrap_or_default();
        // The first row that is not at the border of the picture is complete when this many have come.
        let [_, margin] = self.matcher.settings().margins();
        let needed = margin.saturating_mul(2).saturating_add(1);
        let mut matched = 0usize;
        for strip in 0..EXCHANGE_ROWS {
            let top = (height.saturating_mul(strip + 1) / (EXCHANGE_ROWS + 1)).saturating_sub(margin);
            self.matcher.begin();
            for y in top..top.saturating_add(needed) {
                let y = y.min(height.saturating_sub(1));
                let left_span = self.rectifier.row(Side::Left, right, y, left_row);
                let right_span = self.rectifier.row(Side::Right, left, y, right_row);
                self.matcher.push(left_row, right_row, ValidSpan::from(left_span), ValidSpan::from(right_span));
            }
            let row = self.probe_row.get_mut(..width).unwrap_or_default();
            if self.matcher.pull(margin, row) {
                work::count(Loop::HealthPixels, row.len());
                let values = row.iter().fold(0usize, |count, pixel| count.wrapping_add(usize::from(pixel.has_value())));
                matched = matched.saturating_add(values);
            }
        }
        let share = matched as f32 / EXCHANGE_ROWS.saturating_mul(width) as f32;
        // False matches are scattered, and the validation by surface size is not run here: they are counted on both sides.
        let statistics = &self.detection.statistics;
        let small = statistics.pixels_without[Reason::SmallSurface as usize];
        let as_given = statistics.pixels_with_disparity.saturating_add(small);
        let as_given = as_given as f32 / width.saturating_mul(height) as f32;
        share >= EXCHANGED_SHARE && share > 2.0 * as_given
    }

    /// What the last pair of pictures said.
    pub const fn detection(&self) -> &Detection<OBSTACLES, CELLS> {
        &self.detection
    }

    /// The disparity picture of the last pair, of the left rectified picture.
    pub fn disparity(&self) -> DisparityPicture<'_> {
        let (width, height) =
            self.setup.map_or((0, 0), |setup| (setup.pair.width as usize, setup.pair.height as usize));
        picture_of(&self.disparity, width, height)
    }

    /// The rectified pair; `None` before [`Self::configure`].
    pub fn pair(&self) -> Option<&RectifiedPair> {
        self.setup.as_ref().map(|setup| &setup.pair)
    }

    /// Where the left camera sits on the vehicle; `None` before [`Self::configure`].
    pub fn frame(&self) -> Option<&VehicleFrame> {
        self.setup.as_ref().map(|setup| &setup.vehicle_frame)
    }

    /// Nearest distance along the optical axis that the disparity range reaches, metres; `None` before [`Self::configure`].
    pub fn nearest_m(&self) -> Option<f32> {
        self.setup.as_ref().map(|setup| setup.nearest_m)
    }

    /// The surface at pixel `(x, y)` of the last pair.
    pub fn surface_at(&self, x: usize, y: usize) -> Option<&Surface> {
        self.interpreter.surfaces.surface_at(x, y)
    }

    /// The surfaces of the last pair and the tables behind them.
    pub const fn surfaces(&self) -> &Surfaces<PIXELS, SURFACES> {
        &self.interpreter.surfaces
    }

    /// What the last pair of pictures said about the cameras.
    pub const fn content(&self) -> &ContentSigns {
        &self.content_signs
    }

    /// The rectifier, to draw on rectified pictures.
    pub const fn rectifier(&self) -> &Rectifier<GRID> {
        &self.rectifier
    }
}

impl<
    const PIXELS: usize,
    const WIDTH: usize,
    const DISPARITIES: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
> Default for Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    fn default() -> Self {
        Self::new()
    }
}

/// The first pixels as a picture; the matcher has seen that they suffice.
fn picture_of(pixels: &[DisparityPixel], width: usize, height: usize) -> DisparityPicture<'_> {
    DisparityPicture::new(pixels.get(..width.saturating_mul(height)).unwrap_or_default(), width)
}

#[cfg(test)]
mod tests;
