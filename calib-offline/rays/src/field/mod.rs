//! The ray field: for every pixel a line in space, with no assumption that the lines meet.

pub mod base_lens;
pub mod coverage;
pub mod from_rays;
pub mod knot_order;
pub mod lattice;
pub mod lens_fit;
pub mod polynomial;
pub mod projection;
pub mod ray_field;
pub mod ray_table;
pub mod rig;
pub mod spline;
pub mod structured;
pub mod transport;
pub mod uncertainty;

pub use base_lens::{BaseLens, Projection};
pub use coverage::CoverageMask;
pub use ray_field::{FieldSample, RayField, SmoothMap};
pub use ray_table::RayTable;
pub use rig::{CalibratedCamera, Gap, MeasureError, PointCovariance, Rig};
pub use uncertainty::PairUncertainty;
