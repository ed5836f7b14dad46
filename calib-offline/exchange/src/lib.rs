//! Rigs of rays in the formats of other tools, and calibrations of other tools as rigs of rays.
//!
//! Each format is one file, its quirks at the head: [`opencv`], [`kalibr`], [`ros`], [`mrcal`], [`colmap`], [`matlab`], [`dice`], [`dense`], [`remap`],
//! [`rectify`], [`undistort`], [`ply`].
//!
//! Out: [`nearest_pinholes`] fits a lens to each camera's rays and says what that loses, [`nearest_splined`] one of mrcal's. [`dense`] writes the rays
//! themselves, which loses nothing; [`remap`] and [`rectify`] pictures as ideal pinholes would have them; [`mesh`] has the tables of chips
//! that undistort. In: [`ForeignRig::read`] finds a file's format from
//! what it holds; [`model`] has the camera models, forward and back; [`ForeignRig::rays`] is the rig of rays nearest to them. [`corners`] has the corners
//! of other tools.

mod brown;
mod camera_rays;
pub mod colmap;
mod content;
pub mod corners;
pub mod dense;
pub mod dice;
mod distortion;
mod error;
mod fit;
mod foreign;
mod foreign_rig;
pub mod kalibr;
mod lens;
mod line;
mod loss;
pub mod matlab;
pub mod mesh;
pub mod model;
pub mod mrcal;
mod nearest;
mod npy;
pub mod opencv;
#[cfg(test)]
mod out_tests;
pub mod ply;
mod projector;
mod read;
#[cfg(test)]
mod read_tests;
pub mod rectify;
mod region;
pub mod remap;
mod rig;
pub mod ros;
mod sight;
mod splined_fit;
#[cfg(test)]
mod tests;
pub mod undistort;
mod valid_region;
mod view;
mod yaml;

pub use distortion::Distortion;
pub use error::ExchangeError;
pub use foreign::{ForeignCamera, ForeignFile, Format};
pub use foreign_rig::{ForeignRig, Naming};
pub use lens::Lens;
pub use loss::{Loss, LossMap};
pub use nearest::{CameraPinhole, Pinholes, nearest_pinholes};
pub use read::{Hint, ImportError, Problem, ReadOptions, RotationForm, Unit};
pub use region::{Region, Within};
pub use rig::{Converted, ConvertedCamera};
pub use splined_fit::{SplinedCamera, SplinedCameras, nearest_splined};
pub use view::{View, ViewMap};

/// A file of a format's folder: its name and what it holds.
pub type NamedFile = (String, Vec<u8>);
