//! The colours, in one place, so that pictures, legends and the report agree.

use fencepost_core::disparity::Reason;

/// Red, green, blue.
pub(crate) type Colour = [u8; 3];

/// Pixels without a value: dark red, as in the paper's disparity pictures.
pub const NO_VALUE: Colour = [84, 14, 20];
/// Ground over the left picture; the paper, Figure 11 (g).
pub const GROUND: Colour = [226, 44, 42];
/// Obstacles over the left picture; the paper, Figure 11 (g).
pub const OBSTACLE: Colour = [36, 92, 240];
/// Cells that hold an obstacle that was not reported.
pub const MISSED: Colour = [20, 96, 214];
/// Cells that hold an obstacle and are reported free.
pub const CALLED_FREE: Colour = [196, 0, 196];
/// Cells that are reported as obstacles where there is none.
pub const NOT_THERE: Colour = [240, 140, 0];
/// Pixels of surfaces that a picture does not show.
pub(super) const HIDDEN: Colour = [30, 32, 36];

/// Low to high: dark blue to yellow, rising in brightness, so that it also reads in grey and for colour-blind eyes.
const RAMP: [Colour; 6] =
    [[34, 28, 110], [38, 82, 176], [20, 134, 178], [46, 178, 134], [158, 206, 66], [252, 232, 50]];

/// Colour of `value` between 0 and 1, blue to yellow.
pub fn value_colour(value: f32) -> Colour {
    let scaled = value.clamp(0.0, 1.0) * (RAMP.len() - 1) as f32;
    let index = (scaled as usize).min(RAMP.len() - 2);
    mix(RAMP[index], RAMP[index + 1], scaled - index as f32)
}

/// Colour of a reason.
pub const fn reason_colour(reason: Reason) -> Colour {
    match reason {
        Reason::OutsideValidArea => [72, 76, 84],
        Reason::LowTexture => [64, 132, 214],
        Reason::NotUnique => [244, 142, 40],
        Reason::LeftRightMismatch => [220, 58, 74],
        Reason::SmallSurface => [96, 190, 170],
        Reason::Saturated => [250, 226, 90],
        Reason::OutOfRange => [170, 108, 196],
    }
}

/// A colour that tells object `number` from its neighbours: hues a golden angle apart.
pub(super) fn object_colour(number: u32, lightness: f32) -> Colour {
    let hue = (number as f32 * 0.618_034).fract();
    let channel = |shift: f32| {
        let distance = ((hue + shift).fract() * 6.0 - 3.0).abs() - 1.0;
        let saturated = distance.clamp(0.0, 1.0);
        (255.0 * lightness * (0.28 + 0.72 * saturated)) as u8
    };
    [channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0)]
}

/// `share` of `b` over `a`.
pub(super) fn mix(a: Colour, b: Colour, share: f32) -> Colour {
    std::array::from_fn(|i| {
        let value = f32::from(a[i]) + (f32::from(b[i]) - f32::from(a[i])) * share;
        value.round().clamp(0.0, 255.0) as u8
    })
}

/// As `#rrggbb`.
pub fn hex(colour: Colour) -> String {
    format!("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(c: Colour) -> f32 {
        0.2126 * f32::from(c[0]) + 0.7152 * f32::from(c[1]) + 0.0722 * f32::from(c[2])
    }

    #[test]
    fn the_ramp_rises_in_brightness() {
        let steps: Vec<f32> = (0..=100).map(|i| luminance(value_colour(i as f32 / 100.0))).collect();
        assert!(steps.windows(2).all(|w| w[1] >= w[0] - 0.5), "{steps:?}");
    }

    #[test]
    fn reasons_have_colours_of_their_own() {
        for (i, a) in Reason::ALL.iter().enumerate() {
            for b in &Reason::ALL[i + 1..] {
                let (a, b) = (reason_colour(*a), reason_colour(*b));
                let distance: i32 = (0..3).map(|k| (i32::from(a[k]) - i32::from(b[k])).pow(2)).sum();
                assert!(distance > 3000, "{a:?} and {b:?} look alike");
            }
        }
    }
}
