//! The plausibility sheet: what is wrong on its face with a recording, seen from labels, pixels and a
//! quick look through each camera, before anything is fitted. One list for `inspect`, for a calibration
//! and for an error.
//!
//! [`Sheet::of`] is all of it. What a board's labels and pixels could have been meant as is in
//! `reading`; a camera's views are tried against another's in `whole_camera` and `single_views`.

mod agreement;
mod corner_noise;
mod coverage;
mod design;
mod duplicates;
mod finding;
mod geometry;
mod handedness;
mod image_size;
mod look;
mod measured;
mod mirrored;
mod misread;
mod numbering;
mod placed;
mod reading;
mod sheet;
mod sides;
mod single_views;
mod stage_angles;
#[cfg(test)]
mod tests;
mod units;
mod whole_camera;

pub use finding::Explained;
pub use misread::{FITS_PER_WIDTH, Misread, misread};
pub use sheet::Sheet;
pub use stage_angles::{Dial, dial};
pub use units::units_of_places;
