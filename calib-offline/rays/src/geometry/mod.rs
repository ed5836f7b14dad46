//! Pure geometry: rotations, rigid transforms, rays, triangulation. No files, no estimation.
//!
//! Lengths are millimeters, angles radians. `a_from_b` maps coordinates in frame b to coordinates
//! in frame a, so products chain by eye: `left_from_datum * datum_from_board`.

pub mod hull;
pub mod pixel;
pub mod placement;
pub mod ray;
mod scatter;
pub mod se3;
pub mod so3;
pub mod triangulation;

pub use pixel::{PixelPoint, SensorSize};
pub use placement::best_placement;
pub use ray::Ray;
pub use scatter::Scatter;
pub use se3::RigidTransform;
pub use triangulation::{
    TriangulateError, Triangulation, midpoint_by_shifts, nearest_point, triangulate_pair,
    triangulate_rays,
};
