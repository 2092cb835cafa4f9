//! A colour picture in memory, and PNG files.

use std::{collections::BTreeMap, convert::Infallible};

use embedded_graphics::{
    Pixel,
    pixelcolor::{Rgb888, RgbColor},
    prelude::{DrawTarget, OriginDimensions, Size},
};

use super::colours::{Colour, mix};

/// A picture with 8 bits each of red, green and blue. Shapes and text are drawn on it by `embedded-graphics`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<Colour>,
}

impl Canvas {
    /// A picture of one colour.
    pub fn new(width: usize, height: usize, colour: Colour) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// A picture whose pixels `paint(x, y)` gives.
    pub fn from_fn(width: usize, height: usize, mut paint: impl FnMut(usize, usize) -> Colour) -> Self {
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            pixels.extend((0..width).map(|x| paint(x, y)));
        }
        Self { width, height, pixels }
    }

    /// Width, px.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Pixel at column x and row y; black outside.
    pub fn get(&self, x: usize, y: usize) -> Colour {
        if x < self.width { self.pixels.get(y * self.width + x).copied().unwrap_or_default() } else { [0; 3] }
    }

    /// Paints a pixel; nothing outside.
    pub fn set(&mut self, x: i32, y: i32, colour: Colour) {
        self.blend(x, y, colour, 1.0);
    }

    /// Paints `share` of a colour over a pixel; nothing outside.
    pub fn blend(&mut self, x: i32, y: i32, colour: Colour, share: f32) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x < self.width && y < self.height {
            let pixel = &mut self.pixels[y * self.width + x];
            *pixel = if share >= 1.0 { colour } else { mix(*pixel, colour, share) };
        }
    }

    /// Every `step`-th pixel of every `step`-th row: classes and reasons must not be mixed.
    #[must_use]
    pub fn thinned(&self, step: usize) -> Self {
        let step = step.max(1);
        Self::from_fn(self.width / step, self.height / step, |x, y| self.get(x * step + step / 2, y * step + step / 2))
    }

    /// As the bytes of a PNG file, quick to write: for the pictures of every frame.
    pub fn png(&self) -> Vec<u8> {
        encode(self.width, self.height, png::ColorType::Rgb, png::BitDepth::Eight, self.pixels.as_flattened())
    }

    /// As the bytes of a PNG file, small: with a palette if there are few enough colours. For the pictures of the report.
    pub fn small_png(&self) -> Vec<u8> {
        let mut places = BTreeMap::new();
        let mut palette = Vec::new();
        let mut indices = Vec::with_capacity(self.pixels.len());
        for pixel in &self.pixels {
            let place = *places.entry(*pixel).or_insert_with(|| {
                palette.push(*pixel);
                palette.len() - 1
            });
            let Ok(index) = u8::try_from(place) else { return self.png() };
            indices.push(index);
        }
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(palette.into_flattened());
        encoder.set_compression(png::Compression::Balanced);
        // Neighbouring indices of a palette are not alike: filters would only spoil them.
        encoder.set_filter(png::Filter::NoFilter);
        finish(encoder, &indices);
        bytes
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.width as u32, self.height as u32)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            self.set(at.x, at.y, [colour.r(), colour.g(), colour.b()]);
        }
        Ok(())
    }
}

/// A grey picture of 8 bits as the bytes of a PNG file.
pub fn grey8_png(width: usize, height: usize, pixels: &[u8]) -> Vec<u8> {
    encode(width, height, png::ColorType::Grayscale, png::BitDepth::Eight, pixels)
}

/// A grey picture of 16 bits as the bytes of a PNG file.
pub fn grey16_png(width: usize, height: usize, pixels: &[u16]) -> Vec<u8> {
    let bytes: Vec<u8> = pixels.iter().flat_map(|value| value.to_be_bytes()).collect();
    encode(width, height, png::ColorType::Grayscale, png::BitDepth::Sixteen, &bytes)
}

fn encode(width: usize, height: usize, colour: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(data.len() / 2 + 1024);
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    finish(encoder, data);
    bytes
}

fn finish(encoder: png::Encoder<'_, &mut Vec<u8>>, data: &[u8]) {
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(data))
        .expect("writing to memory fails only if the picture has no pixels or its data another size");
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Reads a PNG file back: width, height and the bytes of its pixels.
    pub(crate) fn read_png(bytes: &[u8]) -> (usize, usize, Vec<u8>) {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut data = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut data).unwrap();
        data.truncate(info.buffer_size());
        (info.width as usize, info.height as usize, data)
    }

    #[test]
    fn pictures_come_back_exactly() {
        let canvas = Canvas::from_fn(37, 5, |x, y| [x as u8, y as u8, (x * y) as u8]);
        let (width, height, data) = read_png(&canvas.png());
        assert_eq!((width, height), (37, 5));
        assert_eq!(data, canvas.pixels.as_flattened());

        let wide: Vec<u16> = (0..37 * 5).map(|i| i * 353).collect();
        let (_, _, data) = read_png(&grey16_png(37, 5, &wide));
        let back: Vec<u16> = data.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
        assert_eq!(back, wide);
    }

    #[test]
    fn small_pictures_have_the_same_pixels() {
        for colours in [1, 2, 200, 256, 257, 900] {
            let canvas = Canvas::from_fn(31, 29, |x, y| {
                let k = (y * 31 + x) % colours;
                [(k % 256) as u8, (k / 256) as u8, 7]
            });
            let mut decoder = png::Decoder::new(std::io::Cursor::new(canvas.small_png()));
            decoder.set_transformations(png::Transformations::EXPAND);
            let mut reader = decoder.read_info().unwrap();
            let mut data = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut data).unwrap();
            assert_eq!(&data[..info.buffer_size()], canvas.pixels.as_flattened(), "{colours} colours");
        }
    }

    #[test]
    fn painting_outside_changes_nothing() {
        let mut canvas = Canvas::new(4, 4, [9; 3]);
        for (x, y) in [(-1, 0), (0, -1), (4, 0), (0, 4), (i32::MIN, i32::MAX)] {
            canvas.set(x, y, [1, 2, 3]);
        }
        assert_eq!(canvas, Canvas::new(4, 4, [9; 3]));
    }
}
