//! The stages on a rendered pair of the project's own, 320 x 240 with 48 disparities.

use std::{fs::File, io::BufReader};

use fencepost_core::{
    arch::Backend,
    detector::{Capacities, Detector},
    disparity::{DisparityPicture, DisparityPixel},
    geometry::{
        CameraModel, DepthTable, Distortion, Mount, RawPair, Rays, Rectification, RectifiedPair, StereoCalibration,
        VehicleFrame,
    },
    matching::{MatchSettings, Matcher, ValidSpan},
    picture::Picture,
    rectify::{Rectifier, Side},
    settings::Settings,
    surfaces::Surfaces,
    validate::SurfaceSize,
};

pub(crate) const WIDTH: usize = 320;
pub(crate) const HEIGHT: usize = 240;
pub(crate) const DISPARITIES: usize = 48;
const CAPACITIES: Capacities = Capacities::for_pictures(WIDTH, HEIGHT, DISPARITIES);
const GRID: usize = CAPACITIES.grid;
const SURFACES: usize = CAPACITIES.surfaces;

pub(crate) const PAIR: RectifiedPair = RectifiedPair {
    width: WIDTH as u32,
    height: HEIGHT as u32,
    focal_px: 262.5,
    cx: 159.5,
    cy: 119.5,
    baseline_m: 0.12,
    disparity_offset_px: 0.0,
};

pub(crate) const MOUNT: Mount =
    Mount { height_m: Some(1.1), pitch_down_deg: 10.0, roll_deg: 0.0, forward_m: 0.0, left_m: 0.0, yaw_left_deg: 0.0 };

pub(crate) type Whole =
    Detector<{ WIDTH * HEIGHT }, WIDTH, DISPARITIES, GRID, SURFACES, { CAPACITIES.obstacles }, { CAPACITIES.cells }>;

/// Every stage, with what the one before it has made.
pub(crate) struct Stages {
    pictures: [Vec<u8>; 2],
    pub(crate) detector: Box<Whole>,
    rectifier: Box<Rectifier<GRID>>,
    matcher: Box<Matcher<WIDTH, DISPARITIES>>,
    matched: Vec<DisparityPixel>,
    surface_size: Box<SurfaceSize<WIDTH>>,
    validated: Vec<DisparityPixel>,
    surfaces: Box<Surfaces<{ WIDTH * HEIGHT }, SURFACES>>,
    depth: Box<DepthTable<DISPARITIES>>,
    rays: Rays,
}

impl Stages {
    /// Ready to run, and warm.
    pub(crate) fn new() -> Self {
        Self::with(Backend::fastest())
    }

    /// The same with a backend that the processor has.
    pub(crate) fn with(backend: Backend) -> Self {
        let matching = MatchSettings { disparities: DISPARITIES as u16, ..MatchSettings::DEFAULT };
        let settings = Settings { matching, ..Settings::default() };
        let frame = VehicleFrame::new(&MOUNT).unwrap();
        let mut stages = Self {
            pictures: ["image_0", "image_1"].map(|folder| picture(folder, 0)),
            detector: Box::default(),
            rectifier: Box::default(),
            matcher: Box::default(),
            matched: vec![DisparityPixel::default(); WIDTH * HEIGHT],
            surface_size: Box::default(),
            validated: Vec::new(),
            surfaces: Box::default(),
            depth: Box::default(),
            rays: Rays::new(&PAIR, &frame),
        };
        assert!(stages.detector.set_backend(backend) && stages.matcher.set_backend(backend));
        stages.detector.configure(&settings, &StereoCalibration::Rectified(PAIR), &MOUNT).unwrap();
        stages.rectifier.configure(&StereoCalibration::Raw(raw(PAIR))).unwrap();
        stages.matcher.configure(&settings.matching, WIDTH, HEIGHT).unwrap();
        stages.surface_size.configure(&settings.validate, WIDTH).unwrap();
        stages.surfaces.configure(&settings.surfaces, WIDTH, HEIGHT).unwrap();
        stages.depth.configure(&PAIR, 0, DISPARITIES as u16);
        stages.detect();
        stages.match_rows();
        stages.validated = stages.matched.clone();
        stages.validate();
        stages
    }

    /// The whole chain, of a pair that is rectified.
    pub(crate) fn detect(&mut self) -> usize {
        let [left, right] = self.pictures.each_ref().map(|pixels| Picture::packed(pixels, WIDTH, HEIGHT).unwrap());
        self.detector.detect(&left, &right, &mut ()).unwrap().obstacles.len()
    }

    /// Both pictures, as if they were raw.
    pub(crate) fn rectify(&mut self) -> u32 {
        let mut row = [0; WIDTH];
        let mut sum = 0;
        for (side, pixels) in [Side::Left, Side::Right].into_iter().zip(&self.pictures) {
            let raw = Picture::packed(pixels, WIDTH, HEIGHT).unwrap();
            for y in 0..HEIGHT {
                self.rectifier.row(side, &raw, y, &mut row);
                sum += u32::from(row[y]);
            }
        }
        sum
    }

    /// Matching of the pictures as they are.
    pub(crate) fn match_rows(&mut self) -> usize {
        let span = ValidSpan::from(0..WIDTH);
        let [left, right] = &self.pictures;
        let mut next = 0;
        self.matcher.begin();
        for (left, right) in left.chunks_exact(WIDTH).zip(right.chunks_exact(WIDTH)) {
            self.matcher.push(left, right, span, span);
            while let Some(out) = self.matched.get_mut(next * WIDTH..(next + 1) * WIDTH) {
                if !self.matcher.pull(next, out) {
                    break;
                }
                next += 1;
            }
        }
        next
    }

    /// Takes the small surfaces out of what was matched.
    pub(crate) fn validate(&mut self) -> usize {
        self.validated.copy_from_slice(&self.matched);
        self.surface_size.run(&mut self.validated);
        self.validated.len()
    }

    /// Surfaces of what is valid, and their planes.
    pub(crate) fn surfaces(&mut self) -> u32 {
        self.surfaces.run(DisparityPicture::new(&self.validated, WIDTH), &self.depth, &self.rays).found
    }
}

/// A left or right picture of the recording that is committed beside the tests of the whole system.
pub(crate) fn picture(folder: &str, number: usize) -> Vec<u8> {
    let path = format!("{}/../tests/recordings/trail/{folder}/{number:06}.png", env!("CARGO_MANIFEST_DIR"));
    let file = BufReader::new(File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; WIDTH * HEIGHT];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

/// A pair behind lenses.
pub(crate) fn raw(pair: RectifiedPair) -> RawPair {
    const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let camera = CameraModel {
        width: pair.width,
        height: pair.height,
        fx: pair.focal_px,
        fy: pair.focal_px,
        cx: pair.cx,
        cy: pair.cy,
        distortion: Distortion([-0.2, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    };
    RawPair {
        left: camera,
        right: camera,
        rotation: IDENTITY,
        translation_m: [-pair.baseline_m, 0.0, 0.0],
        rectification: Some(Rectification { left_rotation: IDENTITY, right_rotation: IDENTITY, pair }),
    }
}
