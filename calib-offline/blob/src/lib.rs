//! From a rig of ray fields to the bytes that a device opens ([`pack`]), in other forms ([`export`]),
//! and from matched pixels to points, by a blob or a calibration ([`mod@matches`]).

pub mod export;
pub mod matches;
pub mod pack;
pub mod rays;
