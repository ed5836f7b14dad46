//! Exact optics: pixel to ray, and point to pixel.
//!
//! A camera is a [`Lens`] in air, and what stands between it and the scene: nothing, flat glass or
//! a dome ([`Media`]). The ray of a pixel is what leaves the last surface into the scene.

mod camera;
mod changed;
pub mod lens;
pub mod media;
mod project;

pub use camera::CameraOptics;
pub use lens::{Bump, Distortion, FisheyeLens, Lens, PerspectiveLens, TelecentricLens};
pub use media::{Dome, FlatWindow, Media};

#[cfg(test)]
mod tests;
