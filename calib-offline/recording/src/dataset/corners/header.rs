//! The first line of `corners.csv`.

use crate::dataset::description::BoardKind;

/// The header without the optional column.
pub const HEADER: &str = "camera,pose,row,col,u,v";
/// The header with the optional column.
pub const HEADER_WITH_SIGMA: &str = "camera,pose,row,col,u,v,sigma_px";
/// The header of points with known places, without the optional columns.
pub const POINTS_HEADER: &str = "camera,pose,u,v,x_mm,y_mm,z_mm";
/// The header of points with the first optional column.
pub const POINTS_HEADER_WITH_SIGMA: &str = "camera,pose,u,v,x_mm,y_mm,z_mm,sigma_px";
/// The header of points with both optional columns.
pub const POINTS_HEADER_WITH_SIGMAS: &str = "camera,pose,u,v,x_mm,y_mm,z_mm,sigma_px,sigma_mm";

/// What stands in which column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Columns {
    pub kind: Labels,
    pub count: usize,
}

/// How corners are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Labels {
    /// By row and column.
    RowCol,
    /// By their places.
    Places,
}

impl Columns {
    /// Of a header; `None` if it is none of this kind of target.
    pub fn of(header: &str, kind: &BoardKind) -> Option<Self> {
        let (kind, count) = match (kind, header) {
            (BoardKind::Points, POINTS_HEADER) => (Labels::Places, 7),
            (BoardKind::Points, POINTS_HEADER_WITH_SIGMA) => (Labels::Places, 8),
            (BoardKind::Points, POINTS_HEADER_WITH_SIGMAS) => (Labels::Places, 9),
            (BoardKind::Points, _) => return None,
            (_, HEADER) => (Labels::RowCol, 6),
            (_, HEADER_WITH_SIGMA) => (Labels::RowCol, 7),
            _ => return None,
        };
        Some(Self { kind, count })
    }
}
