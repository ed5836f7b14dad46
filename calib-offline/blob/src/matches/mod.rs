//! Matches in, points out: `MATCHES.csv` and `POINTS.csv`.
//!
//! A match is one point as pixels of two or more cameras. Every row of the input has exactly one
//! row in the output, in the input's order. Files of any length go through in blocks, so that
//! memory does not grow with them. So do single pixels, to rays (`PIXELS.csv`, `RAYS.csv`).

pub mod blob_source;
mod chosen;
mod error;
mod header;
pub mod known;
pub mod lengths;
mod list;
mod noise;
mod pixels;
mod row;
mod stream;

pub use blob_source::BlobSource;
pub use chosen::read_chosen;
pub use error::MatchesError;
pub use header::Columns;
pub use known::{KnownMatches, TruePoint, read_known};
pub use lengths::{KnownLength, LengthProblem, LengthsError, read_lengths};
pub use list::read_matches;
pub use noise::{NoiseError, NoiseEstimate, noise_with_blob, noise_with_calibration};
pub use pixels::{PixelsError, RAYS_HEADER, RaysSummary, rays_of_pixels};
pub use row::POINTS_HEADER;
pub use stream::{
    MeasureSummary, StreamError, measure_batches, measure_with_blob, measure_with_calibration,
};
