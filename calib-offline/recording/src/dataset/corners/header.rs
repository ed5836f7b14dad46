//! The first line of `corners.csv`.

/// The header without the optional column.
pub const HEADER: &str = "camera,pose,row,col,u,v";
/// The header with the optional column.
pub const HEADER_WITH_SIGMA: &str = "camera,pose,row,col,u,v,sigma_px";
