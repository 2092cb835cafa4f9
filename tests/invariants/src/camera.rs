//! A pair of cameras on a vehicle, its settings, and disparity pictures for it: all within the capacity of the smallest of detectors.

use fencepost_core::{
    arch::Backend,
    detector::{Band, Detector},
    disparity::{DisparityPixel, Reason},
    geometry::{Mount, RectifiedPair},
    settings::Settings,
    surfaces::TILE,
};

use crate::{Source, settings};

/// Largest width, px: more than a tile.
pub(crate) const WIDTH: usize = 40;
/// Largest height, px.
pub(crate) const HEIGHT: usize = 36;
/// Pixels of the largest picture.
pub(crate) const PIXELS: usize = WIDTH * HEIGHT;
/// Disparities.
pub(crate) const DISPARITIES: usize = 12;
/// Obstacles.
pub(crate) const OBSTACLES: usize = 3;
/// Cells.
pub(crate) const CELLS: usize = 64;
/// Surfaces: so few that some are dropped.
pub(crate) const SURFACES: usize = 8;

/// The detector that is fuzzed.
pub(crate) type Small = Detector<PIXELS, WIDTH, DISPARITIES, 42, SURFACES, OBSTACLES, CELLS>;
/// What it needs for each further band of a picture.
pub(crate) type Piece = Band<WIDTH, DISPARITIES, CELLS>;

/// Everything that a detector is configured with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Camera {
    pub(crate) pair: RectifiedPair,
    pub(crate) mount: Mount,
    pub(crate) settings: Settings,
}

impl Camera {
    /// Of any bytes. Nearly all of them can be used.
    pub(crate) fn read(source: &mut Source<'_>) -> Self {
        let (width, height) = size(source);
        let focal_px = source.within(12.0, 60.0);
        let pair = RectifiedPair {
            width: width as u32,
            height: height as u32,
            focal_px,
            cx: 0.5 * width as f32 + source.within(-8.0, 8.0),
            cy: 0.5 * height as f32 + source.within(-8.0, 8.0),
            baseline_m: source.within(0.02, 0.6),
            disparity_offset_px: source.one_of(&[0.0, 0.0, 0.0, 1.5, -2.25, -4.0]),
        };
        let mount = Mount {
            height_m: (source.below(4) > 0).then_some(source.within(0.1, 2.0)),
            pitch_down_deg: source.within(-10.0, 60.0),
            roll_deg: source.one_of(&[0.0, 0.0, 5.0, -20.0]),
            forward_m: source.one_of(&[0.0, 0.0, 0.75, -1.5]),
            left_m: source.one_of(&[0.0, 0.0, 0.3, -1.0]),
            yaw_left_deg: source.one_of(&[0.0, 0.0, 30.0, -90.0, 179.0]),
        };
        let mut camera = Self { pair, mount, settings: settings::read(source) };
        // Now and then a number that nobody should have written.
        match source.byte() {
            of if of % 16 != 15 => {}
            0..128 => {
                let value = f32::from_bits(source.double_word());
                *camera.number(source.byte()) = value;
            }
            _ => settings::change(source, &mut camera.settings),
        }
        camera
    }

    /// One of the numbers of the geometry.
    fn number(&mut self, which: u8) -> &mut f32 {
        let Self { pair, mount, settings } = self;
        match which % 14 {
            0 => &mut pair.focal_px,
            1 => &mut pair.cx,
            2 => &mut pair.cy,
            3 => &mut pair.baseline_m,
            4 => &mut pair.disparity_offset_px,
            5 => mount.height_m.get_or_insert(1.0),
            6 => &mut mount.pitch_down_deg,
            7 => &mut mount.roll_deg,
            8 => &mut mount.forward_m,
            9 => &mut mount.left_m,
            10 => &mut mount.yaw_left_deg,
            11 => &mut settings.map.max_range_m,
            12 => &mut settings.ground.max_range_m,
            _ => &mut settings.obstacles.max_range_m,
        }
    }

    /// Number of pixels.
    pub(crate) const fn pixels(&self) -> usize {
        (self.pair.width * self.pair.height) as usize
    }
}

/// Width and height of pictures, px: mostly the smallest, or as small with a border of tiles across them or down, so that an execution
/// is short; two borders that cross each other, and any others, now and then.
fn size(source: &mut Source<'_>) -> (usize, usize) {
    let any = (17 + source.below(24), 17 + source.below(20));
    let (which, height) = (source.byte(), source.one_of(&[16, 16, 18, 20, 33, 36, any.1]));
    let (large, bordered) = (source.seldom(12), source.seldom(4));
    match which {
        0..14 if large => ([16, 16, 20, 24, 33, 40, any.0][usize::from(which % 7)], height),
        14..60 if bordered => (TILE + 1, 16),
        60..106 if bordered => (16, TILE + 1),
        224..236 if large => (TILE + 1, TILE + 1),
        236..248 if large => any,
        248.. if large => (WIDTH, HEIGHT),
        _ => (16, 16),
    }
}

/// How many frames a detector sees: mostly one.
pub(crate) fn frames(source: &mut Source<'_>) -> usize {
    let (which, several) = (source.byte(), source.seldom(4));
    match which {
        160..224 if several => 2,
        224..248 if several => 3,
        248.. if several => 4,
        _ => 1,
    }
}

/// A disparity picture, stroke by stroke: planes, the ground, noise, reasons, cuts along tiles, and any bits at all.
pub(crate) fn draw(source: &mut Source<'_>, camera: &Camera, pixels: &mut Vec<DisparityPixel>) {
    let (width, height) = (camera.pair.width as usize, camera.pair.height as usize);
    let eye = Eye::new(&camera.pair, &camera.mount);
    pixels.clear();
    pixels.resize(width * height, DisparityPixel::from_bits(0));
    for _ in 0..1 + source.below(10) {
        let kind = source.below(8);
        if kind == 7 {
            let place = usize::from(source.word()) % pixels.len();
            pixels[place] = DisparityPixel::from_bits(source.word());
            continue;
        }
        if kind == 5 {
            ledge(source, (width, height), camera.settings.surfaces.step_sixteenths, pixels);
            continue;
        }
        if kind == 6 {
            cut(source, (width, height), pixels);
            continue;
        }
        let (left, top) = (source.below(width), source.below(height));
        let (columns, rows) = (1 + source.below(width - left), 1 + source.below(height - top));
        let base = i32::from(source.word() % 1024);
        let slope = [i32::from(source.byte() as i8), i32::from(source.byte() as i8)];
        let mut noise = u32::from(source.byte()) | 1;
        for y in top..top + rows {
            for x in left..left + columns {
                let steps = base + (slope[0] * (x - left) as i32 + slope[1] * (y - top) as i32) / 8;
                let bits = match kind {
                    // The ground as the mount promises it, a little off.
                    0 | 1 => eye.ground_steps(x, y) + (base & 7) - 3,
                    2 => {
                        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        steps + (noise >> 28) as i32
                    }
                    3 => 0x8000 | (base & 15),
                    _ => steps,
                };
                pixels[y * width + x] = DisparityPixel::from_bits(bits as u16);
            }
        }
    }
}

/// Fills the picture with two disparities that meet at the border of a tile and differ by about as much as a surface may bridge.
fn ledge(source: &mut Source<'_>, (width, height): (usize, usize), step: u16, pixels: &mut [DisparityPixel]) {
    let along_row = source.flag();
    let near = 1 + u16::from(source.byte()) / 2;
    let far = near.saturating_add(step).saturating_add(source.below(4) as u16).saturating_sub(1);
    for (place, pixel) in pixels.iter_mut().enumerate().take(width * height) {
        let beyond = if along_row { place / width } else { place % width } >= TILE;
        *pixel = DisparityPixel::from_steps(if beyond { far } else { near });
    }
}

/// Cuts the picture at the border of a tile but for one pixel, mostly at an end of the cut: what lies on both sides hangs together
/// only there.
fn cut(source: &mut Source<'_>, (width, height): (usize, usize), pixels: &mut [DisparityPixel]) {
    let along_row = source.flag();
    let (length, across) = if along_row { (width, height) } else { (height, width) };
    let at = (TILE - 1 + source.below(2)).min(across - 1);
    let any = source.below(length);
    let open = source.one_of(&[length - 1, 0, TILE - 1, TILE, any]);
    for place in (0..length).filter(|place| *place != open) {
        let (x, y) = if along_row { (place, at) } else { (at, place) };
        pixels[y * width + x] = DisparityPixel::none(Reason::LowTexture);
    }
}

/// Where a pixel's point lies, in f64 and by formulae of its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eye {
    /// Forward, left and up in the vehicle frame, by right, down and ahead in the camera's.
    rows: [[f64; 3]; 3],
    origin_m: [f64; 3],
    /// Sine and cosine of the heading.
    heading: (f64, f64),
    focal_px: f64,
    middle: [f64; 2],
    scale: f64,
    offset_px: f64,
}

impl Eye {
    pub(crate) fn new(pair: &RectifiedPair, mount: &Mount) -> Self {
        let [pitch, roll, yaw] =
            [mount.pitch_down_deg, mount.roll_deg, mount.yaw_left_deg].map(|angle| f64::from(angle).to_radians());
        // A camera that leans to the right sees the level direction to the right turned to its left.
        let right = [roll.cos(), -roll.sin(), 0.0];
        let down = [roll.sin(), roll.cos(), 0.0];
        let ahead = [0.0, 0.0, 1.0];
        let mix = |a: f64, b: f64| [0, 1, 2].map(|i| a * ahead[i] + b * down[i]);
        let forward = mix(pitch.cos(), -pitch.sin());
        let up = mix(-pitch.sin(), -pitch.cos());
        let height_m = mount.height_m.unwrap_or(Mount::ASSUMED_HEIGHT_M);
        Self {
            rows: [forward, right.map(|r| -r), up],
            origin_m: [mount.forward_m, mount.left_m, height_m].map(f64::from),
            heading: yaw.sin_cos(),
            focal_px: f64::from(pair.focal_px),
            middle: [f64::from(pair.cx), f64::from(pair.cy)],
            scale: f64::from(pair.focal_px) * f64::from(pair.baseline_m),
            offset_px: f64::from(pair.disparity_offset_px),
        }
    }

    /// Direction of a pixel's ray with the heading of the camera, of length 1 along the optical axis.
    fn ray(&self, x: usize, y: usize) -> [f64; 3] {
        let camera = [(x as f64 - self.middle[0]) / self.focal_px, (y as f64 - self.middle[1]) / self.focal_px, 1.0];
        self.rows.map(|row| row[0] * camera[0] + row[1] * camera[1] + row[2] * camera[2])
    }

    /// The point in the frame of the pair, on the ground below the left camera, metres.
    pub(crate) fn in_pair(&self, x: usize, y: usize, steps: u16) -> [f64; 3] {
        let z = self.scale / (f64::from(steps) / 16.0 + self.offset_px);
        let [forward, left, up] = self.ray(x, y);
        [z * forward, z * left, self.origin_m[2] + z * up]
    }

    /// Distance of the camera from a point in the frame of the pair, metres.
    pub(crate) fn distance_m(&self, [forward, left, up]: [f64; 3]) -> f64 {
        forward.hypot(left).hypot(up - self.origin_m[2])
    }

    /// The point in the vehicle frame, metres.
    pub(crate) fn point(&self, x: usize, y: usize, steps: u16) -> [f64; 3] {
        let [forward, left, up] = self.in_pair(x, y, steps);
        let (sin, cos) = self.heading;
        [self.origin_m[0] + forward * cos - left * sin, self.origin_m[1] + forward * sin + left * cos, up]
    }

    /// Distance of the camera from a point on the ground of the vehicle frame, metres.
    pub(crate) fn range_m(&self, [x, y]: [f64; 2]) -> f64 {
        (x - self.origin_m[0]).hypot(y - self.origin_m[1])
    }

    /// Disparity of level ground, 1/16 px; 0 above the horizon.
    fn ground_steps(&self, x: usize, y: usize) -> i32 {
        let up = self.ray(x, y)[2];
        if up >= -1.0e-3 {
            return 0;
        }
        let z = self.origin_m[2] / -up;
        (16.0 * (self.scale / z - self.offset_px)).round().clamp(0.0, 32767.0) as i32
    }
}

/// Two detectors, each with one of the backends that this processor has, and what remembers which: to ask for one takes long.
pub(crate) struct Two {
    pub(crate) first: Small,
    pub(crate) second: Small,
    backends: [Backend; 2],
}

impl Two {
    pub(crate) const fn new() -> Self {
        Self { first: Small::new(), second: Small::new(), backends: [Backend::Dsp; 2] }
    }

    /// Chooses the backends by a byte where both are compared, and now and then besides; else those that every processor has.
    pub(crate) fn choose(&mut self, source: &mut Source<'_>, compared: bool) {
        const USUAL: [Backend; 2] =
            [if cfg!(target_arch = "x86_64") { Backend::Sse2 } else { Backend::Neon }, Backend::Plain];
        let (choice, any) = (usize::from(source.byte()), source.seldom(16));
        let chosen = [choice % 8, choice / 8 % 8].map(|i| Backend::ALL.get(i).copied().unwrap_or(Backend::Plain));
        let wanted = if compared || any { chosen } else { USUAL };
        for ((detector, known), wanted) in
            [&mut self.first, &mut self.second].into_iter().zip(&mut self.backends).zip(wanted)
        {
            if *known != wanted && !detector.set_backend(wanted) {
                detector.set_backend(Backend::Plain);
            }
            *known = wanted;
        }
    }
}
