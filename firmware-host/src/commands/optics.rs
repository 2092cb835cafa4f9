//! What a pair of cameras can see: depth steps by distance, and where the ground comes into view.

use fencepost_core::{
    geometry::{Mount, RectifiedPair, VehicleFrame},
    matching::MatchSettings,
};

/// How well a pair sees at a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resolution {
    /// Distance along the optical axis, metres.
    pub(super) distance_m: f32,
    /// Disparity there, px.
    pub(super) disparity_px: f32,
    /// Change of distance for a sixteenth of a pixel, the step of the matcher, metres.
    pub(super) step_m: f32,
    /// Change of distance for half a pixel, a usual error, metres.
    pub(super) half_pixel_m: f32,
    /// Width of a cell in the picture, px.
    pub(super) cell_px: f32,
}

/// Resolution at usual distances within the disparity range.
pub(super) fn resolutions(pair: &RectifiedPair, matching: &MatchSettings, cell_size_m: f32) -> Vec<Resolution> {
    const DISTANCES_M: [f32; 13] = [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0, 20.0, 25.0, 30.0];
    let (nearest_m, farthest_m) = range_m(pair, matching);
    let at = |distance_m: f32| {
        let disparity_px = pair.disparity_px(distance_m);
        // The step away from the camera is the longer one.
        let farther = |px: f32| pair.distance_m(disparity_px - px) - distance_m;
        Resolution {
            distance_m,
            disparity_px,
            step_m: farther(1.0 / 16.0),
            half_pixel_m: farther(0.5),
            cell_px: cell_size_m * pair.focal_px / distance_m,
        }
    };
    DISTANCES_M.into_iter().filter(|d| *d >= nearest_m && *d <= farthest_m).map(at).collect()
}

/// Nearest and farthest distance along the optical axis that the disparity range reaches, metres. The outermost disparities
/// have no neighbour to interpolate with and are never reported.
pub(super) fn range_m(pair: &RectifiedPair, matching: &MatchSettings) -> (f32, f32) {
    let first = f32::from(matching.min_disparity);
    let last = first + f32::from(matching.disparities);
    (pair.distance_m(last - 2.0), pair.distance_m(first + 1.0))
}

/// Where the lowest row of the picture meets level ground straight ahead of the camera, metres from the camera; `None` if it does not.
pub(super) fn ground_begins_m(pair: &RectifiedPair, mount: &Mount) -> Option<f32> {
    let frame = VehicleFrame::new(&mount.without_place()).ok()?;
    let bottom = pair.height as f32 - 1.0;
    let [x, _, z] = frame.direction([0.0, (bottom - pair.cy) / pair.focal_px, 1.0]);
    (z < 0.0 && x > 0.0).then(|| x * frame.camera_height_m() / -z)
}

/// Where level ground straight ahead of the camera is far enough away for the disparity range, metres from the camera.
pub(super) fn ground_in_range_m(mount: &Mount, nearest_m: f32) -> Option<f32> {
    let frame = VehicleFrame::new(&mount.without_place()).ok()?;
    let [_, _, ahead_z] = frame.rows()[0].map(f64::from);
    let [_, _, up_z] = frame.rows()[2].map(f64::from);
    // Along the ground straight ahead, the distance along the optical axis is z(x) = x cos(pitch) + h sin(pitch).
    let height_m = f64::from(frame.camera_height_m());
    let x = (f64::from(nearest_m) + height_m * up_z) / ahead_z;
    x.is_finite().then_some(x.max(0.0) as f32)
}

/// Angle of view along the row, degrees.
pub(super) fn view_deg(pair: &RectifiedPair) -> f32 {
    let left = (pair.cx / pair.focal_px).atan();
    let right = ((pair.width as f32 - 1.0 - pair.cx) / pair.focal_px).atan();
    (left + right).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIR: RectifiedPair = RectifiedPair {
        width: 640,
        height: 480,
        focal_px: 500.0,
        cx: 319.5,
        cy: 239.5,
        baseline_m: 0.12,
        disparity_offset_px: 0.0,
    };

    #[test]
    fn depth_steps_grow_with_the_square_of_the_distance() {
        let rows = resolutions(&PAIR, &MatchSettings { disparities: 64, ..MatchSettings::default() }, 0.5);
        // f b = 60: 62 px reach 0.97 m. z^2 / (f b) per pixel of disparity.
        assert_eq!(rows[0].distance_m, 1.0);
        for row in &rows {
            let slope = row.distance_m * row.distance_m / 60.0;
            assert!((row.step_m / (slope / 16.0) - 1.0).abs() < 0.05, "{row:?}");
            assert!((row.disparity_px - 60.0 / row.distance_m).abs() < 1.0e-4);
            assert!((row.cell_px - 250.0 / row.distance_m).abs() < 1.0e-3);
        }
    }

    #[test]
    fn the_ground_begins_where_the_lowest_row_meets_it() {
        let mount = |pitch_down_deg| Mount { height_m: Some(1.0), pitch_down_deg, ..Mount::default() };
        // Half the picture is 239.5 / 500 below the axis: level, 1 m up, that is 2.088 m away.
        assert!((ground_begins_m(&PAIR, &mount(0.0)).unwrap() - 500.0 / 239.5).abs() < 1.0e-3);
        let pitched = (20.0_f32.to_radians() + (239.5_f32 / 500.0).atan()).tan();
        assert!((ground_begins_m(&PAIR, &mount(20.0)).unwrap() - 1.0 / pitched).abs() < 1.0e-3);
        assert_eq!(ground_begins_m(&PAIR, &mount(-40.0)), None);
    }

    #[test]
    fn ground_in_range_lies_at_the_nearest_distance_along_the_axis() {
        let mount = Mount { height_m: Some(1.0), pitch_down_deg: 30.0, ..Mount::default() };
        let x = ground_in_range_m(&mount, 1.5).unwrap();
        let (sin, cos) = 30.0_f32.to_radians().sin_cos();
        assert!((x * cos + 1.0 * sin - 1.5).abs() < 1.0e-4, "{x}");
    }
}
