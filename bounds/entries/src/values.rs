//! The values that flow between the stages: pictures, disparities, planes, places, health.

use fencepost_core::{
    disparity::{DisparityPicture, DisparityPixel},
    error::ConfigError,
    geometry::{Mount, Place, Rays, RectifiedPair, VehicleFrame},
    ground::GroundPlane,
    health::{Debounce, Findings, Health, HealthLevel, HealthReason},
    map::MapGeometry,
    picture::{Picture, PictureError},
    planes::{Eigen, Scatter, SymmetricMatrix3},
    surfaces::Surface,
};

#[unsafe(no_mangle)]
fn entry_value_picture<'a>(
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
) -> Result<Picture<'a>, PictureError> {
    Picture::new(data, width, height, stride)
}

#[unsafe(no_mangle)]
fn entry_value_picture_row<'a>(picture: &Picture<'a>, y: usize) -> &'a [u8] {
    picture.row(y)
}

#[unsafe(no_mangle)]
fn entry_value_disparity_picture<'a>(pixels: &'a [DisparityPixel], width: usize) -> DisparityPicture<'a> {
    DisparityPicture::new(pixels, width)
}

#[unsafe(no_mangle)]
fn entry_value_disparity_row<'a>(picture: &DisparityPicture<'a>, y: usize) -> &'a [DisparityPixel] {
    picture.row(y)
}

#[unsafe(no_mangle)]
fn entry_value_disparity(bits: u16) -> (DisparityPixel, u16, bool) {
    let pixel = DisparityPixel::from_bits(bits);
    (DisparityPixel::from_steps(bits), pixel.steps(), pixel.get().is_ok())
}

#[unsafe(no_mangle)]
fn entry_value_eigen(matrix: &SymmetricMatrix3) -> Option<Eigen> {
    matrix.eigen()
}

#[unsafe(no_mangle)]
fn entry_value_eigen_gaps(eigen: &Eigen) -> (f32, f32) {
    (eigen.lower_gap(), eigen.upper_gap())
}

#[unsafe(no_mangle)]
fn entry_value_scatter_joined(a: &Scatter, b: &Scatter) -> Scatter {
    a.joined(b)
}

#[unsafe(no_mangle)]
fn entry_value_scatter_plane(points: &Scatter, along: &[f32; 3]) -> (Option<([f32; 3], f32)>, f32) {
    (points.plane(), points.variance_along(*along))
}

#[unsafe(no_mangle)]
fn entry_value_surface(surface: &Surface) -> (f32, f32, u32) {
    (surface.dot(), surface.cross(), surface.pixels())
}

#[unsafe(no_mangle)]
fn entry_value_vehicle_frame(mount: &Mount, rotation: &[[f32; 3]; 3]) -> Result<VehicleFrame, ConfigError> {
    Ok(VehicleFrame::new(mount)?.turned(rotation))
}

#[unsafe(no_mangle)]
fn entry_value_place(mount: &Mount, point_m: [f32; 2]) -> [[f32; 2]; 2] {
    let place = Place::new(mount);
    [place.to_vehicle(point_m), place.to_pair(point_m)]
}

#[unsafe(no_mangle)]
fn entry_value_pair(pair: &RectifiedPair, at: f32) -> Result<(f32, f32), ConfigError> {
    pair.check()?;
    Ok((pair.distance_m(at), pair.disparity_px(at)))
}

#[unsafe(no_mangle)]
fn entry_value_rays(pair: &RectifiedPair, frame: &VehicleFrame, u: f32, v: f32, z_m: f32) -> [f32; 3] {
    Rays::new(pair, frame).point_m(u, v, z_m)
}

#[unsafe(no_mangle)]
fn entry_value_ground_plane(points: &Scatter, frame: &VehicleFrame, place: &Place) -> Option<GroundPlane> {
    Some(GroundPlane::through(points, frame)?.moved(place))
}

#[unsafe(no_mangle)]
fn entry_value_map_geometry(geometry: &MapGeometry, i: i16, j: i16) -> (usize, Option<usize>, (f32, f32)) {
    (geometry.len(), geometry.index(i, j), geometry.centre_m(i, j))
}

#[unsafe(no_mangle)]
fn entry_value_map_cell(geometry: &MapGeometry, index: usize) -> (i16, i16) {
    geometry.cell_at(index)
}

#[unsafe(no_mangle)]
fn entry_value_health(health: &mut Health, other: Health, reason: HealthReason, level: HealthLevel) -> Health {
    health.raise(reason, level);
    health.and(other)
}

#[unsafe(no_mangle)]
fn entry_value_findings(findings: &mut Findings, reason: HealthReason, level: HealthLevel) -> Health {
    findings.raise(reason, level);
    findings.health()
}

#[unsafe(no_mangle)]
fn entry_value_debounce(debounce: &mut Debounce, findings: &Findings) -> Health {
    debounce.update(findings);
    debounce.told()
}
