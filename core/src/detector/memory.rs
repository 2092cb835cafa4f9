//! How much memory a detector takes.

use super::{Band, Detection, Detector, Setup, interpreter::Interpreter};
use crate::{
    disparity::DisparityPixel,
    health::{Content, ContentSigns, Debounce, HealthSettings, RecentPictures},
    matching::Matcher,
    methods::{ConfidenceSettings, Detectors},
    rectify::{Rectifier, grid_nodes},
    validate::SurfaceSize,
};

/// What a detector is to hold; the const generics of [`Detector`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacities {
    /// Pixels of a picture.
    pub pixels: usize,
    /// Width of a picture.
    pub width: usize,
    /// Disparities.
    pub disparities: usize,
    /// Nodes of the rectification map.
    pub grid: usize,
    /// Surfaces.
    pub surfaces: usize,
    /// Obstacles.
    pub obstacles: usize,
    /// Cells.
    pub cells: usize,
}

impl Capacities {
    /// Just enough for pictures of one size: five surfaces to a tile (a typical picture has three; where there are more, the
    /// smallest are left out), 64 obstacles and 2500 cells.
    pub const fn for_pictures(width: usize, height: usize, disparities: usize) -> Self {
        let tiles = width.div_ceil(crate::surfaces::TILE) * height.div_ceil(crate::surfaces::TILE);
        let grid = grid_nodes(width, height);
        Self { pixels: width * height, width, disparities, grid, surfaces: 5 * tiles, obstacles: 64, cells: 2500 }
    }
}

/// Bytes that a detector of these capacities takes, all of its state and tables; at most 128 bytes of padding more or less.
///
/// The size is a constant, and a term for each capacity and for width x disparities. Each term is the difference between two
/// detectors that the compiler has laid out; they differ by multiples of 64, which is what the table of costs is aligned to.
pub const fn memory_bytes(capacities: &Capacities) -> usize {
    const BASE: usize = size_of::<Detector<1024, 64, 16, 64, 64, 64, 64>>();
    const PIXELS: usize = (size_of::<Detector<2048, 64, 16, 64, 64, 64, 64>>() - BASE) / 1024;
    const GRID: usize = (size_of::<Detector<1024, 64, 16, 128, 64, 64, 64>>() - BASE) / 64;
    const SURFACES: usize = (size_of::<Detector<1024, 64, 16, 64, 128, 64, 64>>() - BASE) / 64;
    const OBSTACLES: usize = (size_of::<Detector<1024, 64, 16, 64, 64, 128, 64>>() - BASE) / 64;
    const CELLS: usize = (size_of::<Detector<1024, 64, 16, 64, 64, 64, 128>>() - BASE) / 64;
    // Width and disparities stand alone and as a product.
    const BY_WIDTH: usize = size_of::<Detector<1024, 128, 16, 64, 64, 64, 64>>() - BASE;
    const BY_DISPARITIES: usize = size_of::<Detector<1024, 64, 80, 64, 64, 64, 64>>() - BASE;
    const BOTH: usize = size_of::<Detector<1024, 128, 80, 64, 64, 64, 64>>() - BASE;
    const PRODUCT: usize = (BOTH - BY_WIDTH - BY_DISPARITIES) / (64 * 64);
    const WIDTH: usize = BY_WIDTH / 64 - 16 * PRODUCT;
    const DISPARITIES: usize = BY_DISPARITIES / 64 - 64 * PRODUCT;
    const CONSTANT: usize = BASE
        - (PIXELS * 1024
            + 64 * (GRID + SURFACES + OBSTACLES + CELLS)
            + WIDTH * 64
            + DISPARITIES * 16
            + PRODUCT * 64 * 16);
    CONSTANT
        + PIXELS * capacities.pixels
        + WIDTH * capacities.width
        + DISPARITIES * capacities.disparities
        + PRODUCT * capacities.width * capacities.disparities
        + GRID * capacities.grid
        + SURFACES * capacities.surfaces
        + OBSTACLES * capacities.obstacles
        + CELLS * capacities.cells
}

/// Bytes that a [`Band`] for a detector of these capacities takes, beside the detector itself; at most 128 bytes of padding more or
/// less.
pub const fn band_bytes(capacities: &Capacities) -> usize {
    const BASE: usize = size_of::<Band<64, 16, 64>>();
    const CELLS: usize = (size_of::<Band<64, 16, 128>>() - BASE) / 64;
    const BY_WIDTH: usize = size_of::<Band<128, 16, 64>>() - BASE;
    const BY_DISPARITIES: usize = size_of::<Band<64, 80, 64>>() - BASE;
    const BOTH: usize = size_of::<Band<128, 80, 64>>() - BASE;
    const PRODUCT: usize = (BOTH - BY_WIDTH - BY_DISPARITIES) / (64 * 64);
    const WIDTH: usize = BY_WIDTH / 64 - 16 * PRODUCT;
    const DISPARITIES: usize = BY_DISPARITIES / 64 - 64 * PRODUCT;
    const CONSTANT: usize = BASE - (64 * CELLS + WIDTH * 64 + DISPARITIES * 16 + PRODUCT * 64 * 16);
    let Capacities { width, disparities, cells, .. } = *capacities;
    CONSTANT + WIDTH * width + DISPARITIES * disparities + PRODUCT * width * disparities + CELLS * cells
}

/// A part of a detector and the bytes that it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryPart {
    /// The stage, or what is kept beside the stages.
    pub name: &'static str,
    /// Its size.
    pub bytes: usize,
    /// What the size is a multiple of.
    pub align: usize,
}

impl MemoryPart {
    pub(super) const fn of<T>(name: &'static str) -> Self {
        Self { name, bytes: size_of::<T>(), align: align_of::<T>() }
    }

    /// The part with a `T` besides; both of a size that no capacity changes.
    pub(super) const fn and<T>(self) -> Self {
        Self { bytes: self.bytes + size_of::<T>(), align: 1, ..self }
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
> Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>
{
    /// What the size of a detector is made of, in the order in which the data pass through; what is left is padding.
    pub const fn memory_parts() -> [MemoryPart; 18] {
        let [depth, surfaces, regions, ground, obstacles, map, methods, pixel_normals, cross_check] =
            Interpreter::<PIXELS, WIDTH, DISPARITIES, SURFACES, CELLS>::memory_parts();
        [
            MemoryPart::of::<Rectifier<GRID>>("rectify"),
            MemoryPart::of::<[[u8; WIDTH]; 2]>("rectified_rows"),
            MemoryPart::of::<Matcher<WIDTH, DISPARITIES>>("match"),
            MemoryPart::of::<[DisparityPixel; PIXELS]>("disparity_picture"),
            MemoryPart::of::<SurfaceSize<WIDTH>>("validate"),
            depth,
            surfaces,
            regions,
            ground,
            obstacles,
            map,
            methods,
            pixel_normals,
            cross_check,
            MemoryPart::of::<Content<WIDTH>>("health"),
            MemoryPart::of::<[DisparityPixel; WIDTH]>("exchanged_row"),
            MemoryPart::of::<Option<Setup>>("setup")
                .and::<HealthSettings>()
                .and::<ContentSigns>()
                .and::<RecentPictures>()
                .and::<Debounce>()
                .and::<Detectors>()
                .and::<ConfidenceSettings>(),
            MemoryPart::of::<Detection<OBSTACLES, CELLS>>("detection"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(found: usize, capacities: Capacities) {
        let told = memory_bytes(&capacities);
        assert!(found.abs_diff(told) <= 128, "{capacities:?}: {found} bytes, not {told}");
    }

    #[test]
    fn tells_the_size_that_the_compiler_lays_out() {
        const SMALL: Capacities = Capacities::for_pictures(320, 240, 48);
        const LAGR: Capacities = Capacities::for_pictures(512, 384, 64);
        const LARGE: Capacities = Capacities::for_pictures(1242, 375, 128);
        check(size_of::<Detector<{ 320 * 240 }, 320, 48, { SMALL.grid }, { SMALL.surfaces }, 64, 2500>>(), SMALL);
        check(size_of::<Detector<{ 512 * 384 }, 512, 64, { LAGR.grid }, { LAGR.surfaces }, 64, 2500>>(), LAGR);
        check(size_of::<Detector<{ 1242 * 375 }, 1242, 128, { LARGE.grid }, { LARGE.surfaces }, 64, 2500>>(), LARGE);
        // Those that do not come with the size of the pictures.
        const OTHER: Capacities = Capacities { surfaces: 100, obstacles: 300, cells: 640, ..SMALL };
        check(size_of::<Detector<{ 320 * 240 }, 320, 48, { SMALL.grid }, 100, 300, 640>>(), OTHER);
        for (name, capacities) in [("320 x 240 x 48", SMALL), ("512 x 384 x 64", LAGR), ("1242 x 375 x 128", LARGE)] {
            std::println!("{name}: {} bytes", memory_bytes(&capacities));
        }
    }

    #[test]
    fn parts_that_belong_together_are_as_large_as_both() {
        let both = MemoryPart::of::<u64>("both").and::<[u8; 3]>();
        assert_eq!(both, MemoryPart { name: "both", bytes: 11, align: 1 });
        assert_eq!(MemoryPart::of::<u32>("one"), MemoryPart { name: "one", bytes: 4, align: 4 });
    }

    #[test]
    fn tells_the_size_of_a_band() {
        for (found, (width, height, disparities)) in [
            (size_of::<Band<320, 48, 2500>>(), (320, 240, 48)),
            (size_of::<Band<512, 64, 2500>>(), (512, 384, 64)),
            (size_of::<Band<1242, 128, 2500>>(), (1242, 375, 128)),
        ] {
            let told = band_bytes(&Capacities::for_pictures(width, height, disparities));
            std::println!("{width} x {height} x {disparities}: {told} bytes for a band");
            assert!(found.abs_diff(told) <= 128, "{width} x {disparities}: {found} bytes, not {told}");
        }
    }

    #[test]
    fn the_sizes_that_all_others_are_told_by_are_told_to_the_byte() {
        let least =
            Capacities { pixels: 1024, width: 64, disparities: 16, grid: 64, surfaces: 64, obstacles: 64, cells: 64 };
        assert_eq!(memory_bytes(&least), size_of::<Detector<1024, 64, 16, 64, 64, 64, 64>>());
        assert_eq!(band_bytes(&least), size_of::<Band<64, 16, 64>>());
    }

    /// What an integrator plans with: a change of these shows up in review.
    #[test]
    fn sizes_are_those_that_were_agreed() {
        let kib = |width, height, disparities| {
            memory_bytes(&Capacities::for_pictures(width, height, disparities)).div_ceil(1024)
        };
        let found = [kib(128, 96, 16), kib(320, 240, 48), kib(512, 384, 64), kib(640, 480, 64), kib(1242, 375, 128)];
        assert_eq!(found, [170, 455, 930, 1343, 2234], "KiB");
    }
}
