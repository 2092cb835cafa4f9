//! From light to grey values: lens blur, fall-off to the corners, exposure, noise and the curve of the camera.

use super::noise::hash;
use super::parallel::for_each_chunk;

/// How one camera turns light into grey values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sensor {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Exposure over that of the left camera.
    pub(crate) exposure: f32,
    /// Read noise, grey values.
    pub(crate) noise_sigma: f32,
    /// Different for every picture.
    pub(crate) seed: u32,
}

/// Brings sunlit soil to the middle of the range.
const EXPOSURE: f32 = 1.45;
/// Weights of the blur of a good lens, about 0.5 px.
const BLUR: [f32; 3] = [0.12, 0.76, 0.12];

impl Sensor {
    /// The picture that `light` makes.
    pub(crate) fn expose(&self, light: &[f32], grey: &mut [u8]) {
        let (w, h) = (self.width, self.height);
        for_each_chunk(grey, w, |y, row| {
            let (above, below) = (y.saturating_sub(1), (y + 1).min(h - 1));
            let column =
                |x: usize| BLUR[0] * light[above * w + x] + BLUR[1] * light[y * w + x] + BLUR[2] * light[below * w + x];
            let (mut left, mut middle) = (column(0), column(0));
            for (x, pixel) in row.iter_mut().enumerate() {
                let right = column((x + 1).min(w - 1));
                let blurred = BLUR[0] * left + BLUR[1] * middle + BLUR[2] * right;
                (left, middle) = (middle, right);
                *pixel = self.grey(blurred, x, y);
            }
        });
    }

    fn grey(&self, light: f32, x: usize, y: usize) -> u8 {
        let (dx, dy) = ((x as f32 / self.width as f32 - 0.5) * 2.0, (y as f32 / self.height as f32 - 0.5) * 2.0);
        let corner = 1.0 - 0.1 * (dx * dx + dy * dy);
        let exposed = (light * EXPOSURE * self.exposure * corner).max(0.0);
        // A straight foot, which keeps the shadows apart, and a long shoulder, which keeps the sky from burning out.
        let coded = 0.94 * exposed / (0.5 + exposed) + 0.23 * exposed.sqrt();
        let value = 255.0 * coded;
        // Under such coding the noise of the light is much the same at every brightness.
        let sigma = self.noise_sigma;
        let noise = sigma * normal(self.seed, (y * self.width + x) as u32);
        (value + noise + 0.5).clamp(0.0, 255.0) as u8
    }
}

/// A number with the normal distribution, near enough: the sum of twelve even ones.
fn normal(seed: u32, index: u32) -> f32 {
    let mut sum = 0u32;
    for i in 0..6u32 {
        let h = hash(index.wrapping_mul(6).wrapping_add(i) ^ seed);
        sum += (h & 0xffff) + (h >> 16);
    }
    (sum as f32) * (1.0 / 65536.0) - 6.0
}
