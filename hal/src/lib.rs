//! Everything between the core and the world: cameras, recordings, the scene renderer, CAN buses.
#![deny(unsafe_code)]

pub mod calibration;
pub mod camera;
pub mod can;
pub mod clock;
pub mod recording;
pub mod scene;
