//! Stereo obstacle detection for robots with small computers.
//!
//! The core takes pictures from a pair of cameras and tells where a ground robot cannot drive. It knows no file, clock,
//! thread or device, allocates nothing and keeps all of its state in buffers whose size the compiler knows.
//!
//! ```text
//! raw pair ──> rectify ──> matching ──> validate ──> surfaces ──> planes ──┬──> ground ────┐
//!              rows in     disparity    small        32 x 32      a normal │               ├──> map ──> wire
//!              line        + reasons    surfaces     tiles        each     └──> obstacles ─┘    cells   CAN payloads
//! ```
//!
//! The method is that of *Working toward a better vision-based obstacle detection method*, written for the DARPA LAGR
//! programme; "the paper" in this documentation.
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod arch;
pub mod bands;
pub mod detector;
pub mod disparity;
pub mod error;
pub mod geometry;
pub mod ground;
pub mod health;
mod lanes;
mod links;
pub mod map;
pub mod matching;
pub mod methods;
pub mod obstacles;
pub mod picture;
pub mod planes;
pub mod rectify;
pub mod settings;
pub mod surfaces;
pub mod validate;
pub mod wire;
#[cfg(feature = "count-work")]
pub mod work;
#[cfg(not(feature = "count-work"))]
mod work;

#[cfg(test)]
mod test_random;
#[cfg(test)]
mod test_world;
