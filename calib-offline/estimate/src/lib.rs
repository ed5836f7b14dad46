//! From labelled corners to ray fields, poses and extrinsics: what is adjusted and how ([`adjust`]), where
//! it starts ([`init`]), the joint estimate ([`joint`]), what may be wrong with a recording
//! ([`explain`](mod@explain)), and what it is compared with, a pinhole ([`pinhole`]) and
//! the published procedure ([`alternating`]).

pub mod adjust;
pub mod alternating;
pub mod explain;
pub mod init;
pub mod joint;
pub mod pinhole;
pub mod reprojection;
