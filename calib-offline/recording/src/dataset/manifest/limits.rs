//! What numbers in a manifest can be meant.

/// Fewest inner corners along a side: fewer leave no distance to compare with its neighbor.
pub const MIN_CORNERS_PER_SIDE: i64 = 3;

/// Most inner corners along a side; more is a slip of the pen.
pub const MAX_CORNERS_PER_SIDE: i64 = 1000;

/// Longest side of a sensor, px: the longest that a blob can describe.
pub const MAX_SENSOR_PX: i64 = ray_runtime::format::MAX_EXTENT_PX as i64;

/// Most cameras: the most that a blob can hold.
pub const MAX_CAMERAS: usize = ray_runtime::format::MAX_CAMERAS as usize;

/// Longest name of a camera, characters; it stands in CSV headers and in the blob.
pub const MAX_NAME_CHARS: usize = 64;

/// Smallest square, mm: a micrometer. Less is a slip of the pen or of the unit.
pub const MIN_SQUARE_MM: f64 = 1e-3;

/// Largest square, mm: ten meters. More is a slip of the pen or of the unit.
pub const MAX_SQUARE_MM: f64 = 1e4;
