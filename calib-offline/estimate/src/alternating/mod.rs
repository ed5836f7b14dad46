//! The published procedure (Fu et al. 2022, "Non-parametric camera calibration method using
//! single-axis rotational target"), equation by equation.
//!
//! Read [`estimate()`] beside the paper: it calls the steps in the paper's order.
//!
//! | equation | what it says | where | what was repaired or reconstructed |
//! | --- | --- | --- | --- |
//! | (1), (18) | `Pe = Theta P` | [`alternation::control_points`] | |
//! | (2) | Gaussian network, pixel to board | [`network`], [`k_means`], [`plane_map`] | sign of the exponent; weights by a truncated decomposition ([`truncated`]), never normal equations; the spread is chosen by corners left out ([`spread`]): the paper's 6000 px is the flat limit |
//! | (3)-(5) | pose from the homography | [`crate::pinhole::homography`], [`start`] | columns of the board's plane; several starts, the cheapest by (14) |
//! | (6), (7) | plane of the trajectories | [`stage_circle`] | one normal for all corners of a placement |
//! | (8)-(11) | circle through positions | [`stage_circle`] | singular as printed; solved in the plane |
//! | (12) | new pose from projected corners | [`stage_circle`] | taken only if it lowers (14) |
//! | (13), (14), (17) | sum of squared distances | [`alternation`] | over the pixels of all cameras with one pose per board |
//! | (15), (16) | line through control points | [`line_fit`] | |
//! | (19), (20), (24)-(28) | closed-form step of a pose | [`pose_step`] | (26)-(28) unreadable; reconstructed, proved against normal equations and Kabsch |
//! | (21)-(23), (30) | exponential update | [`pose_step::moved`] | |
//! | (29) | foot points | [`alternation`] | |
//! | stop | the pose no longer changes | [`alternation::AlternationSettings`] | earlier sweeps are mixed in ([`mixing`]); the step alone stops far from the minimum |
//! | (31), (32) | rotation and translation averaging | [`stereo`], [`calib_rays::geometry::so3::karcher_mean`] | cameras brought into one frame first; L1 is no choice with two cameras |
//! | (33)-(35) | midpoint of two rays | [`calib_rays::geometry::triangulate_pair`] | derivative equal to zero, not "at its maximum" |
//!
//! The result is one ray per pixel ([`calib_rays::field::RayTable`]), and through [`calib_rays::field`] the compressed
//! field that everything else works with.

pub mod alternation;
pub mod estimate;
pub mod field_rig;
pub mod k_means;
pub mod line_fit;
pub mod mixing;
pub mod network;
pub mod plane_map;
pub mod pose_step;
pub mod rays;
pub mod spread;
pub mod stage_circle;
pub mod start;
pub mod stereo;
pub mod truncated;

pub use estimate::{AlternatingError, AlternatingEstimate, AlternatingSettings, estimate};
