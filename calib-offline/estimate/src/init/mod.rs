//! Initialization: from labelled corners to fields, poses and extrinsics good enough to adjust.
//!
//! Zhang's closed form is no starting point for all lenses: it knows no distortion. (That a rotation
//! about one axis would be near-critical for it was not found: `pinhole::zhang` has the figures.)
//! Instead ([`focal_scan`]) each
//! camera tries ideal lenses of many focal lengths and two kinds, places every board by its
//! bearings ([`bearing_pose`]), and refines the best few with a cubic field; the cameras are then
//! joined over their common poses ([`rig`]). METHOD section 3. On the way views and pairs of views
//! that cannot be what they claim are found ([`screening`]).

pub mod bearing_pose;
pub mod board_pose;
mod error;
pub mod focal_scan;
mod known_rig;
pub mod pair_consensus;
mod parallel_rays;
pub mod rig;
mod rig_start;
pub mod screening;
mod solid_pose;
mod usable;

pub use calib_rays::observed::MIN_POSES;
pub use error::InitError;
pub use usable::{MIN_CORNERS, is_usable};
