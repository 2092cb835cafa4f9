//! What the errors say.

use std::string::ToString;

use super::*;

#[test]
fn a_value_must_be_finite_and_within_its_limits() {
    let check = |value| ConfigError::check("a.b", value, -1.0, 2.0).map_err(|error| error.problem);
    for value in [-1.0, 0.0, -0.0, 2.0] {
        assert_eq!(check(value), Ok(()));
    }
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(check(value), Err(ConfigProblem::NotFinite));
    }
    for value in [-1.000_001, 2.000_001, f32::MAX, f32::MIN] {
        assert_eq!(check(value), Err(ConfigProblem::OutOfRange { min: -1.0, max: 2.0 }));
    }
}

#[test]
fn every_problem_names_the_field_and_the_mend() {
    for (problem, text) in [
        (ConfigProblem::NotFinite, "a.b: is not a finite number"),
        (ConfigProblem::OutOfRange { min: 0.5, max: 2.0 }, "a.b: must lie within 0.5 to 2"),
        (ConfigProblem::NotOdd, "a.b: must be odd"),
        (ConfigProblem::NotAMultiple { of: 8 }, "a.b: must be a multiple of 8"),
        (ConfigProblem::OverCapacity { needed: 9, capacity: 8 }, "a.b: needs 9, but this build has room for 8"),
        (ConfigProblem::NotARotation, "a.b: is not a rotation matrix"),
        (ConfigProblem::Exchanged, "a.b: puts the right camera to the left of the left one: exchange the two"),
        (ConfigProblem::SameDetector, "a.b: is the detector itself: choose another one"),
    ] {
        assert_eq!(ConfigError::new("a.b", problem).to_string(), text);
    }
}
