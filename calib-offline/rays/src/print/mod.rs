//! What is printed on calibration targets: where their points lie, which coded markers they carry,
//! and what they look like.
//!
//! Lengths in millimeters. A target's frame has its origin at the point labelled (0, 0), x along the
//! columns to the right and y along the rows down, as seen on the printed face.

pub mod april_grid;
pub mod artwork;
pub mod charuco;
pub mod chessboard;
pub mod circles;
pub mod codes;
pub mod pdf;
pub mod rings;
pub mod svg;

pub use april_grid::{AprilGrid, TagBorder, TagOrder};
pub use artwork::{Artwork, Shade, Shape};
pub use charuco::Charuco;
pub use circles::Circles;
pub use codes::{Code, Codes};
