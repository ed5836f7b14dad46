//! Rigs of rays in the formats of other tools.
//!
//! [`nearest_pinholes`] fits a pinhole to each camera's rays and says what that loses; each format is one file that writes
//! it, its quirks at the head: [`opencv`], [`kalibr`], [`ros`]. [`dense`] writes the rays themselves, which
//! loses nothing.

pub mod dense;
mod error;
mod fit;
pub mod kalibr;
mod lens;
mod loss;
mod nearest;
pub mod opencv;
pub mod ros;
#[cfg(test)]
mod tests;
mod yaml;

pub use error::ExchangeError;
pub use lens::{Distortion, Lens};
pub use loss::Loss;
pub use nearest::{CameraPinhole, Pinholes, nearest_pinholes};

/// A file of a format's folder: its name and what it holds.
pub type NamedFile = (String, Vec<u8>);
