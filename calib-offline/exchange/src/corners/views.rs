//! Image points in a file of `OpenCV`'s calibration sample (`image_points`), one row a view, two channels.
//!
//! Quirks. `board_width` and `board_height` are counts of corners, row by row; views are numbered in the order of the rows, as the file says nothing else. Which
//! camera it is of is not in it. The center of the top-left pixel is (0, 0).

use super::CornerRow;
use crate::read::{Document, Problem, tree};
use calib_rays::geometry::PixelPoint;

/// The corners of the camera `camera`.
///
/// # Errors
/// [`Problem`].
pub fn corners(text: &str, camera: &str) -> Result<Vec<CornerRow>, Problem> {
    let node = tree(text)?;
    let document = Document::new(&node);
    let points = document.need("image_points")?;
    let matrix = points.matrix_of(&["2f", "2d"])?;
    let cols = document.need("board_width")?.side()? as usize;
    let rows = document.need("board_height")?.side()? as usize;
    if matrix.cols != rows * cols {
        return Err(points.disagrees(format!("a board of {rows} x {cols}")));
    }
    let views = matrix.data.chunks_exact(2 * matrix.cols).enumerate();
    let corners = views.flat_map(|(pose, view)| {
        view.chunks_exact(2)
            .enumerate()
            .map(move |(index, pair)| CornerRow {
                camera: camera.to_owned(),
                pose,
                row: index / cols,
                col: index % cols,
                pixel: PixelPoint::new(pair[0], pair[1]),
                sigma_px: None,
            })
    });
    Ok(corners.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_rows_of_the_matrix() {
        let text = "%YAML:1.0\n---\nboard_width: 2\nboard_height: 1\nimage_points: !!opencv-matrix\n   rows: 2\n   cols: 2\n   dt: \"2f\"\n   data: [ 1., 2., 3., 4., 5., 6., 7., 8. ]\n";
        let rows = corners(text, "left").unwrap();
        let seen: Vec<_> = rows
            .iter()
            .map(|row| (row.pose, row.col, row.pixel.v))
            .collect();
        assert_eq!(seen, [(0, 0, 2.0), (0, 1, 4.0), (1, 0, 6.0), (1, 1, 8.0)]);
        let one_channel = text.replace("2f", "f");
        assert!(matches!(
            corners(&one_channel, "left"),
            Err(Problem::Wrong { .. })
        ));
        let other_board = text.replace("board_width: 2", "board_width: 3");
        assert!(matches!(
            corners(&other_board, "left"),
            Err(Problem::Disagrees { .. })
        ));
    }
}
