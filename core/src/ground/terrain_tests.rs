//! Terrain against the ground that its surfaces were taken from.

use std::vec::Vec;

use super::*;
use crate::{
    geometry::{Mount, VehicleFrame},
    planes::Scatter,
};

fn level() -> GroundPlane {
    GroundPlane::of_mount(&VehicleFrame::new(&Mount::default()).unwrap())
}

/// Surfaces on ground of the given height at some distances ahead, right of, on and left of the path.
fn surfaces(ahead_m: impl Iterator<Item = f32>, height_m: impl Fn(f32) -> f32) -> Vec<Surface> {
    let at = |x: f32, y: f32| Surface {
        points: Scatter { weight: 500.0, mean_m: [x, y, height_m(x)], ..Scatter::default() },
        normal: [0.0, 0.0, 1.0],
        rms_m: 0.0,
        class: SurfaceClass::Ground,
    };
    ahead_m.flat_map(|x| [-1.0, 0.0, 1.0].map(|y| at(x, y))).collect()
}

fn steps(from: f32, to: f32) -> impl Iterator<Item = f32> {
    (0..).map(move |i| from + 0.25 * i as f32).take_while(move |&x| x < to)
}

#[test]
fn level_ground_does_not_bend() {
    let terrain = Terrain::of(level(), &surfaces(steps(1.0, 20.0), |_| 0.0), 1.0);
    assert!(steps(-5.0, 60.0).all(|x| terrain.lift_m(x).abs() < 1.0e-6));
    let nothing = Terrain::of(level(), &[], 1.0);
    assert!(steps(-5.0, 60.0).all(|x| nothing.lift_m(x) == 0.0));
}

#[test]
fn a_slope_that_begins_ahead_is_followed() {
    let slope = |x: f32| if x > 4.0 { (x - 4.0) * 10.0_f32.to_radians().tan() } else { 0.0 };
    let terrain = Terrain::of(level(), &surfaces(steps(1.0, 20.0), slope), 1.0);
    for x in steps(1.0, 19.5) {
        let off = terrain.height_m([x, 0.0, slope(x)]).abs();
        // The bend is smoothed over the bands beside it.
        assert!(off < 0.06, "{off} m off at {x} m");
    }
    let beyond = terrain.lift_m(30.0);
    assert!((beyond - slope(19.75)).abs() < 0.25, "held at {beyond} m beyond the last surface");
}

#[test]
fn a_gap_lies_between_its_edges() {
    let step = |x: f32| if x > 10.0 { 0.3 } else { 0.0 };
    let terrain = Terrain::of(level(), &surfaces(steps(2.0, 6.0).chain(steps(14.0, 18.0)), step), 1.0);
    for x in steps(6.0, 14.0) {
        assert!((-0.01..=0.31).contains(&terrain.lift_m(x)), "{} m at {x} m", terrain.lift_m(x));
    }
    assert!(terrain.lift_m(4.0).abs() < 0.02 && (terrain.lift_m(16.0) - 0.3).abs() < 0.02);
}

#[test]
fn only_surfaces_on_the_ground_count() {
    let mut table = surfaces(steps(2.0, 10.0), |_| 1.0);
    for surface in &mut table {
        surface.class = SurfaceClass::Horizontal;
    }
    assert_eq!(Terrain::of(level(), &table, 1.0), Terrain::flat(level()));
}

#[test]
fn no_place_is_out_of_reach() {
    let terrain = Terrain::of(level(), &surfaces(steps(-50.0, 200.0), |x| x), 1.0);
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, 47.5, 48.0, 1.0e30] {
        let _ = terrain.lift_m(x);
    }
}
