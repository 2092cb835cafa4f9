//! Each rule of the obstacles by itself, on surfaces made by hand.

use super::*;
use crate::{
    ground::GroundPlane,
    planes::{Scatter, SymmetricMatrix3},
    surfaces::{Surface, SurfaceClass},
};

fn finder() -> ObstacleFinder {
    let settings = ObstacleSettings {
        min_height_m: 0.25,
        platform_height_m: 0.6,
        max_range_m: 10.0,
        ..ObstacleSettings::default()
    };
    let mut finder = ObstacleFinder::new();
    finder.configure(&settings, 200.0).unwrap();
    finder
}

/// Level ground at the height of the origin, that so many pixels speak for.
fn level(support: u32) -> Terrain {
    let mut terrain = Terrain::new();
    let plane = GroundPlane::of_mount(&World::level(1.2, 12.0, 0.0).frame());
    terrain.flatten(GroundPlane { support, ..plane });
    terrain
}

fn surface(class: SurfaceClass, mean_m: [f32; 3], zz: f32) -> Surface {
    let covariance = SymmetricMatrix3 { xx: 0.01, yy: 0.01, zz, ..SymmetricMatrix3::default() };
    Surface { points: Scatter { weight: 500.0, mean_m, covariance }, class, ..Surface::default() }
}

#[test]
fn what_is_upright_and_near_stands_up() {
    let stands = |class, x, y| finder().stands_up(&surface(class, [x, y, 0.0], 0.0), &level(1000));
    for class in [SurfaceClass::Vertical, SurfaceClass::Obstacle] {
        // Ten metres, at first from ahead and aside.
        let places = [(6.0, 8.0, true), (6.0, 8.01, false), (-6.0, 7.99, true), (10.0, 0.0, true), (0.0, 10.01, false)];
        for (x, y, found) in places {
            assert_eq!(stands(class, x, y), found, "{class:?} at {x}, {y}");
        }
    }
    assert!(!stands(SurfaceClass::Ground, 1.0, 1.0));
}

#[test]
fn what_is_level_stands_up_where_it_lies_high_above_ground_that_was_seen() {
    let stands =
        |z, support| finder().stands_up(&surface(SurfaceClass::Horizontal, [3.0, 1.0, z], 0.0), &level(support));
    assert!(stands(0.61, 1) && !stands(0.59, 1));
    assert!(!stands(0.61, 0) && !stands(5.0, 0), "it may be the ground itself");
}

#[test]
fn what_slants_stands_up_where_it_reaches_the_least_height() {
    // Evenly spread over 0.6 m of height: a variance of 0.6 x 0.6 / 12.
    for class in [SurfaceClass::Slanted, SurfaceClass::Undefined] {
        for (z, found) in [(-0.06, false), (-0.04, true), (0.2, true), (-2.0, false)] {
            assert_eq!(finder().stands_up(&surface(class, [3.0, 1.0, z], 0.03), &level(1000)), found, "{z} m");
        }
    }
}

#[test]
fn an_obstacle_begins_no_nearer_than_half_way() {
    let mut wide = surface(SurfaceClass::Vertical, [6.0, 8.0, 0.5], 0.03);
    wide.points.covariance.xx = 100.0;
    let place = Place::new(&crate::geometry::Mount::default());
    let obstacle = finder().measure([&wide].into_iter(), &level(1000), &place).unwrap();
    // Half of ten metres, instead of 17.
    assert!((obstacle.min_m[0] - 1.0).abs() < 1.0e-5 && (obstacle.max_m[0] - 11.0).abs() < 1.0e-5, "{obstacle:?}");
    assert!((obstacle.min_m[2] - 0.2).abs() < 1.0e-5 && (obstacle.max_m[2] - 0.8).abs() < 1.0e-5, "{obstacle:?}");
    assert!((range_m(&wide.points) - 10.0).abs() < 1.0e-5);
}

#[test]
fn a_line_has_its_direction_and_length() {
    for degrees in (-85..=85_i16).step_by(5) {
        let (sin, cos) = f32::from(degrees).to_radians().sin_cos();
        // Evenly spread over 3 m along it and 0.5 m across.
        let (along, across) = (9.0 / 12.0, 0.25 / 12.0);
        let covariance = SymmetricMatrix3 {
            xx: along * cos * cos + across * sin * sin,
            xy: (along - across) * sin * cos,
            yy: along * sin * sin + across * cos * cos,
            ..SymmetricMatrix3::default()
        };
        let (orientation_rad, length_m) = orientation(&covariance);
        let found = orientation_rad.to_degrees();
        assert!((found - f32::from(degrees)).abs() < 0.01, "{found} instead of {degrees} degrees");
        assert!((length_m - 3.0).abs() < 1.0e-4, "{length_m} m");
    }
    // Both ends of a half turn are in the range, and what is in it stays.
    for angle_rad in [-FRAC_PI_2, -1.0, 0.0, 1.0, FRAC_PI_2] {
        assert_eq!(within_half_turn(angle_rad), angle_rad);
    }
}

#[test]
fn of_obstacles_at_one_distance_the_first_found_comes_first() {
    let at =
        |x: f32, surfaces| Obstacle { min_m: [x, 0.0, 0.0], max_m: [x, 0.0, 1.0], surfaces, ..Obstacle::default() };
    let mut obstacles: heapless::Vec<Obstacle, 3, u16> = heapless::Vec::new();
    let dropped = [at(2.0, 1), at(2.0, 2), at(1.0, 3), at(2.0, 4)].map(|obstacle| insert(&mut obstacles, obstacle));
    assert_eq!(dropped, [0, 0, 0, 1]);
    assert_eq!(obstacles.iter().map(|obstacle| obstacle.surfaces).collect::<Vec<_>>(), [3, 1, 2]);
}
