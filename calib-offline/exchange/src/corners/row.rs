//! A corner, and the text of `corners.csv`.

use calib_rays::geometry::PixelPoint;
use std::fmt::Write as _;

/// A corner of a board in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct CornerRow {
    /// The camera's name.
    pub camera: String,
    /// Number of the pose.
    pub pose: usize,
    /// Row on the board.
    pub row: usize,
    /// Column on the board.
    pub col: usize,
    /// Where it was seen; the center of the top-left pixel is (0, 0).
    pub pixel: PixelPoint,
    /// Standard deviation per axis, px, if it is known.
    pub sigma_px: Option<f64>,
}

/// The text of `corners.csv`, in the order of the rows. The column of standard deviations is there if any row has one, and is
/// empty in the others.
pub fn to_csv(rows: &[CornerRow]) -> String {
    let has_sigma = rows.iter().any(|row| row.sigma_px.is_some());
    let mut text = "camera,pose,row,col,u,v".to_owned();
    text += if has_sigma { ",sigma_px\n" } else { "\n" };
    for row in rows {
        let PixelPoint { u, v } = row.pixel;
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{},{},{},{},{u},{v}",
            row.camera, row.pose, row.row, row.col
        );
        if has_sigma {
            text.push(',');
            if let Some(sigma) = row.sigma_px {
                let _ = write!(text, "{sigma}");
            }
        }
        text.push('\n');
    }
    text
}
