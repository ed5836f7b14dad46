//! What a calibration says of itself: `calibration.json` and the report page. Computes nothing new.

pub mod record;

pub use record::Calibration;
