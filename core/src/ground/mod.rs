//! The ground plane.

mod plane;
mod settings;
mod terrain;

pub use plane::GroundPlane;
pub use settings::GroundSettings;
pub use terrain::Terrain;

use terrain::Bend;

use crate::{
    arch::Chosen,
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::{DepthTable, Rays, VehicleFrame},
    planes::{Scatter, SymmetricMatrix3},
    surfaces::{Regions, Surface, SurfaceClass, Surfaces},
    work::{self, Loop},
};

/// Rounds of choosing the surfaces near the plane and fitting it again. The choice settles after two or three.
const REFINEMENTS: usize = 4;

/// Regions that a plane is grown from, largest first.
const REGIONS: usize = 3;

/// Finds the ground plane from the near-horizontal surfaces.
///
/// Source: the paper, section 4.4: the surfaces within 30 degrees of horizontal are joined over the whole picture, and a plane
/// is fitted to the largest region by orthogonal distance regression. Then the plane is fitted anew to all near-horizontal
/// surfaces that lie on it, wherever they are: bits of ground seen between obstacles count too.
///
/// # Bound
/// The joining of regions and up to 25 passes over the table of surfaces, twice if there is no ground at the height of the mount;
/// the terrain.
pub struct GroundFinder {
    settings: GroundSettings,
    frame: Option<VehicleFrame>,
    height_known: bool,
    min_support: f32,
    min_support_elsewhere: f32,
    /// Largest error of a disparity that is believed, as a shift of the point along its ray, in parts of its distance and for each
    /// metre of it.
    most_noise_per_m: f32,
    /// Tangents of the largest tilt and of the steepest ground, cosine of the largest tilt.
    max_slope: f32,
    terrain_slope: f32,
    least_upright: f32,
    last: Option<GroundPlane>,
    terrain: Terrain,
    chosen: Chosen,
}

impl GroundFinder {
    /// A stage that is not configured and finds nothing.
    pub const fn new() -> Self {
        Self {
            settings: GroundSettings::UNSET,
            frame: None,
            height_known: false,
            min_support: 0.0,
            min_support_elsewhere: 0.0,
            max_slope: 0.0,
            terrain_slope: 0.0,
            most_noise_per_m: 0.0,
            least_upright: 0.0,
            last: None,
            terrain: Terrain::new(),
            chosen: Chosen::PLAIN,
        }
    }

    /// Has the terrain followed with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
    }

    /// Takes settings, the frame of the vehicle and the size of the pictures, and forgets the ground of earlier frames.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `ground.*`.
    pub fn configure(
        &mut self,
        settings: &GroundSettings,
        frame: &VehicleFrame,
        height_known: bool,
        pixels: usize,
    ) -> Result<(), ConfigError> {
        settings.check()?;
        self.settings = *settings;
        self.frame = Some(*frame);
        self.height_known = height_known;
        self.min_support = settings.min_support_permille * 1.0e-3 * pixels as f32;
        self.min_support_elsewhere = settings.other_height_support_permille * 1.0e-3 * pixels as f32;
        let max_tilt = settings.max_tilt_deg.to_radians();
        self.max_slope = libm::tanf(max_tilt);
        self.terrain_slope = libm::tanf(settings.terrain_max_slope_deg.to_radians());
        self.least_upright = libm::cosf(max_tilt);
        self.forget();
        Ok(())
    }

    /// Forgets the ground of earlier frames.
    pub const fn forget(&mut self) {
        self.last = None;
    }

    /// Finds the ground, or holds that of an earlier frame, gives the surfaces on it their class and follows them with the
    /// terrain. Without ground the terrain is the plane that the mount promises.
    pub fn run<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        regions: &mut Regions<SURFACES>,
        picture: DisparityPicture<'_>,
        geometry: (&DepthTable<DISPARITIES>, &Rays),
    ) -> Option<GroundPlane> {
        let frame = self.frame?;
        let focal_baseline_px_m = geometry.0.focal_baseline_px_m().max(f32::MIN_POSITIVE);
        self.most_noise_per_m = self.settings.fit_noise_max_px / focal_baseline_px_m;
        let mut found = None;
        for height in self.heights() {
            regions.join(surfaces, picture, |surface| self.may_be_ground(surface, height));
            found = self.find(surfaces.table(), regions, &frame, height);
            if found.is_some() {
                break;
            }
        }
        let plane = found.or_else(|| {
            let last = self.last?;
            let age_frames = last.age_frames.saturating_add(1);
            (age_frames <= self.settings.hold_frames).then_some(GroundPlane { age_frames, ..last })
        });
        // Without holding, no frame has a say in the next.
        self.last = plane.filter(|_| self.settings.hold_frames > 0);
        match plane {
            Some(plane) => {
                self.spread(&plane, surfaces, regions);
                let bend = Bend {
                    patch_m: self.settings.terrain_patch_m,
                    share: self.settings.terrain_share,
                    max_slope: self.terrain_slope,
                    tolerance_m: self.settings.surface_tolerance_m,
                    tolerance_per_m: self.settings.terrain_noise_px * plane.camera_height_m / focal_baseline_px_m,
                };
                self.terrain.fit(plane, surfaces, picture, geometry, &bend, self.chosen);
            }
            None => self.terrain.flatten(GroundPlane::of_mount(&frame)),
        }
        plane
    }

    /// Exchanges the ground of the frame before for that of another detector, which looks at the same pictures in turn.
    pub(crate) const fn exchange(&mut self, other: &mut Option<GroundPlane>) {
        core::mem::swap(&mut self.last, other);
    }

    /// Has heights measured from `plane`, without bends, after a detector that finds the ground in its own way.
    pub(crate) fn flatten(&mut self, plane: GroundPlane) {
        self.terrain.flatten(plane);
    }

    /// Where heights are measured from, after [`Self::run`].
    pub const fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Gives the class of ground to the near-horizontal surfaces on the plane, and to those that hang together with them:
    /// ground that bends away from the plane is ground all the same.
    fn spread<const PIXELS: usize, const SURFACES: usize>(
        &self,
        plane: &GroundPlane,
        surfaces: &mut Surfaces<PIXELS, SURFACES>,
        regions: &Regions<SURFACES>,
    ) {
        work::count(Loop::GroundSurfaces, surfaces.table().len().saturating_mul(3));
        for root in regions.roots() {
            let table = surfaces.table();
            let mut on_plane = 0u32;
            for surface in regions.members(root).filter_map(|place| table.get(place)) {
                if surface.class == SurfaceClass::Horizontal {
                    on_plane = on_plane.saturating_add(if self.lies_on(plane, surface) { surface.pixels() } else { 0 });
                }
            }
            let grows = on_plane as f32 >= self.min_support;
            for place in regions.members(root) {
                let Some(surface) = surfaces.table_mut().get_mut(place) else { continue };
                if surface.class == SurfaceClass::Horizontal && (grows || self.lies_on(plane, surface)) {
                    surface.class = SurfaceClass::Ground;
                }
            }
        }
    }

    /// What is taken for known about the height of the camera, one try after the other.
    fn heights(&self) -> impl Iterator<Item = Height> + use<> {
        let known = self.height_known.then_some(Height::OfMount);
        let other = if self.height_known { Height::NotOfMount } else { Height::Unknown };
        known.into_iter().chain([other])
    }

    /// Whether a surface is near-horizontal and where ground can be, for all tilts and heights that are allowed.
    fn may_be_ground(&self, surface: &Surface, height: Height) -> bool {
        let [x, y, z] = surface.points.mean_m;
        let of_mount = height == Height::OfMount;
        let reach = if of_mount { self.settings.height_tolerance_m } else { f32::INFINITY };
        let level = if of_mount { 0.0 } else { f32::NEG_INFINITY };
        let allowance = reach + self.max_slope * libm::sqrtf(x * x + y * y);
        surface.class == SurfaceClass::Horizontal && z <= allowance && z >= level - allowance
    }

    /// Whether a surface that may be ground is near enough to say something about the plane.
    fn tells_plane(&self, surface: &Surface, height: Height) -> bool {
        let [x, y, _] = surface.points.mean_m;
        x * x + y * y <= self.settings.max_range_m * self.settings.max_range_m && self.may_be_ground(surface, height)
    }

    /// The plane that the most ground lies on, of those that grow from the largest regions, from the last plane and from
    /// what the mount promises.
    fn find<const SURFACES: usize>(
        &self,
        table: &[Surface],
        regions: &Regions<SURFACES>,
        frame: &VehicleFrame,
        height: Height,
    ) -> Option<GroundPlane> {
        let noise = self.noise(table, height);
        let mut best: Option<(f32, GroundPlane)> = None;
        let mut attempt = |seed: Option<GroundPlane>| {
            let grown = seed.and_then(|seed| self.grow(seed, table, frame, height, &noise));
            if let Some((weight, plane)) = grown.filter(|(weight, _)| best.is_none_or(|(most, _)| *weight > most)) {
                best = Some((weight, plane));
            }
        };
        attempt(self.last);
        attempt((height == Height::OfMount).then(|| GroundPlane::of_mount(frame)));
        let mut below = f32::INFINITY;
        for _ in 0..REGIONS {
            // The largest region that was not tried yet; the first of equals.
            let mut largest: Option<Scatter> = None;
            work::count(Loop::GroundSurfaces, table.len());
            for root in regions.roots() {
                if !table.get(root).is_some_and(|surface| self.may_be_ground(surface, height)) {
                    continue;
                }
                let members = regions.members(root).filter_map(|place| table.get(place));
                let members = members.inspect(|_| work::count(Loop::GroundSurfaces, 1));
                let members = members.filter(|surface| self.tells_plane(surface, height));
                let region = members.fold(Scatter::default(), |all, surface| all.joined(&self.weighed(surface, 0.0)));
                if region.weight < below && largest.is_none_or(|largest| region.weight > largest.weight) {
                    largest = Some(region);
                }
            }
            let Some(region) = largest else { break };
            below = region.weight;
            attempt(GroundPlane::through(&region, frame));
        }
        best.map(|(_, plane)| plane)
    }

    /// Fits the plane anew to all surfaces that lie on it, a few times; `None` if it leaves the limits. Also says how much
    /// lies on it.
    fn grow(
        &self,
        mut plane: GroundPlane,
        table: &[Surface],
        frame: &VehicleFrame,
        height: Height,
        noise: &Noise,
    ) -> Option<(f32, GroundPlane)> {
        let mut weight = 0.0;
        for round in 0..REFINEMENTS {
            // A first plane may be bent by what is not ground, or come from an earlier frame: it is forgiven more.
            let tolerance = self.settings.fit_tolerance_m * if round == 0 { 2.5 } else { 1.0 };
            let near = |surface: &Surface| plane.height_m(surface.points.mean_m).abs() <= tolerance;
            let tells =
                |surface: &&Surface| self.tells_plane(surface, height) && near(surface) && noise.allows(surface);
            let mut support = 0u32;
            work::count(Loop::GroundSurfaces, table.len());
            let mut points = Scatter::default();
            for surface in table.iter().filter(tells) {
                support = support.saturating_add(surface.pixels());
                points = points.joined(&self.weighed(surface, noise.shift_per_m));
            }
            plane = GroundPlane { support, ..GroundPlane::through(&points, frame)? };
            weight = points.weight;
        }
        self.plausible(&plane, table, height).then_some((weight, plane))
    }

    /// The points of a surface with the weight that their heights deserve, and without what noise adds to their spread.
    ///
    /// The height of a point on the ground is as uncertain as its distance is long (the error of the distance grows with its square,
    /// the slope of the ray falls with it), so the weight falls with the square; and it falls to the sides, where the road does not
    /// lead. The error of a disparity moves a point along its ray, down when it moves away: taken for the spread of the surface, it
    /// would tilt the plane away from the camera.
    fn weighed(&self, surface: &Surface, noise_per_m: f32) -> Scatter {
        let [x, y, _] = surface.points.mean_m;
        let aside = y / self.settings.corridor_m;
        let weight = surface.points.weight / ((1.0 + x * x + y * y) * (1.0 + aside * aside));
        let camera_m = self.frame.map_or([0.0; 3], |frame| frame.point([0.0; 3]));
        let ray: [f32; 3] = core::array::from_fn(|i| surface.points.mean_m[i] - camera_m[i]);
        let shift = noise_per_m * libm::sqrtf(ray.iter().map(|r| r * r).sum());
        let noise = ray.map(|r| r * shift);
        let c = surface.points.covariance;
        let covariance = SymmetricMatrix3 {
            xx: c.xx - noise[0] * noise[0],
            xy: c.xy - noise[0] * noise[1],
            xz: c.xz - noise[0] * noise[2],
            yy: c.yy - noise[1] * noise[1],
            yz: c.yz - noise[1] * noise[2],
            zz: c.zz - noise[2] * noise[2],
        };
        Scatter { weight, covariance, ..surface.points }
    }

    /// What surfaces that tell of the plane say of the error of a disparity: the quadratic mean over how far their points lie off
    /// their planes, because it is squares that the spread of the ground is made of. What is much rougher than that in the mean is
    /// left out of it.
    fn noise(&self, table: &[Surface], height: Height) -> Noise {
        let camera_m = self.frame.map_or([0.0; 3], |frame| frame.point([0.0; 3]));
        let mean = |most_per_m: f32| {
            let (mut sum, mut weight) = (0.0, 0.0);
            work::count(Loop::GroundSurfaces, table.len());
            for surface in table.iter().filter(|surface| self.tells_plane(surface, height)) {
                let shift_per_m = shift_per_m(surface, camera_m).filter(|&shift_per_m| shift_per_m <= most_per_m);
                if let Some(shift_per_m) = shift_per_m {
                    sum += surface.points.weight * shift_per_m * shift_per_m;
                    weight += surface.points.weight;
                }
            }
            if weight > 0.0 { libm::sqrtf(sum / weight) } else { 0.0 }
        };
        let most_per_m = self.settings.fit_roughness * mean(f32::INFINITY);
        let shift_per_m = self.settings.fit_noise_factor * mean(most_per_m);
        Noise { camera_m, most_per_m, shift_per_m: shift_per_m.min(self.most_noise_per_m) }
    }

    fn lies_on(&self, plane: &GroundPlane, surface: &Surface) -> bool {
        let [x, y, _] = surface.points.mean_m;
        let range = libm::sqrtf(x * x + y * y);
        let tolerance = self.settings.surface_tolerance_m + self.settings.surface_tolerance_per_m * range;
        plane.height_m(surface.points.mean_m).abs() <= tolerance
    }

    fn plausible(&self, plane: &GroundPlane, table: &[Surface], height: Height) -> bool {
        let level = plane.normal[2] >= self.least_upright;
        let expected = self.frame.map_or(0.0, |frame| frame.camera_height_m());
        let off = (plane.camera_height_m - expected).abs();
        let height = match height {
            // A tolerance that is larger than the height lets in what lies above a camera.
            Height::OfMount => off <= self.settings.height_tolerance_m && plane.camera_height_m > 0.0,
            Height::Unknown => plane.camera_height_m > LEAST_HEIGHT_M,
            Height::NotOfMount => {
                plane.camera_height_m > LEAST_HEIGHT_M.max(LEAST_SHARE * expected)
                    && plane.support as f32 >= self.min_support_elsewhere
                    && self.is_lowest(plane, table)
            }
        };
        level && height && plane.support as f32 >= self.min_support
    }

    /// Whether hardly anything lies below a plane: a table has a floor, the ground has none.
    fn is_lowest(&self, plane: &GroundPlane, table: &[Surface]) -> bool {
        let below = |surface: &&Surface| {
            let [x, y, _] = surface.points.mean_m;
            let near = x * x + y * y <= self.settings.max_range_m * self.settings.max_range_m;
            near && plane.height_m(surface.points.mean_m) < -self.settings.height_tolerance_m
        };
        work::count(Loop::GroundSurfaces, table.len());
        let pixels = table.iter().filter(below).map(Surface::pixels).fold(0, u32::saturating_add);
        pixels as f32 <= MOST_BELOW * plane.support as f32
    }
}

/// The error of disparities, as shifts of a point along its ray, in parts of its distance and for each metre of it.
struct Noise {
    camera_m: [f32; 3],
    /// What is taken out of the spread of a surface.
    shift_per_m: f32,
    /// What lies farther off its plane than this is no piece of ground alone.
    most_per_m: f32,
}

impl Noise {
    fn allows(&self, surface: &Surface) -> bool {
        shift_per_m(surface, self.camera_m).is_none_or(|shift_per_m| shift_per_m <= self.most_per_m)
    }
}

/// How far a surface's points lie off its plane, as [`Noise`] says it; `None` where the plane leads to the camera.
fn shift_per_m(surface: &Surface, camera_m: [f32; 3]) -> Option<f32> {
    let ray: [f32; 3] = core::array::from_fn(|i| surface.points.mean_m[i] - camera_m[i]);
    let range_m = libm::sqrtf(ray.iter().map(|r| r * r).sum());
    let across_m = (0..3).map(|i| surface.normal[i] * ray[i]).sum::<f32>().abs();
    (across_m > LEAST_HEIGHT_M).then(|| surface.rms_m / (across_m * range_m))
}

/// What is taken for known about the height of the camera.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Height {
    /// That of the mount, within its tolerance.
    OfMount,
    /// Not that of the mount, though it gives one: a camera that is carried, or a mount that was measured badly.
    NotOfMount,
    /// Nothing.
    Unknown,
}

/// A camera nearer to the ground sees none of it, metres.
const LEAST_HEIGHT_M: f32 = 0.05;

/// Least share of the height of the mount at which another plane may lie: what fills the view from near is not the ground.
const LEAST_SHARE: f32 = 0.33;

/// Largest share of what supports a plane at another height than that of the mount that may lie below it.
const MOST_BELOW: f32 = 0.05;

impl Default for GroundFinder {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests;
