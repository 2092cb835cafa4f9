//! What the whole-system tests share: what they need from outside, the program run on a recording, and a small recording of
//! their own.
#![deny(unsafe_code)]

pub mod at_hand;
pub mod golden;
pub mod replay;
pub mod steadiness;
pub mod table;

/// Prints a line past the test runner's capture, so that figures and tests that did not run are seen in every run.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {
        $crate::at_hand::say(format_args!($($text)*))
    };
}
