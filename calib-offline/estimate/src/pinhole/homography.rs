//! The plane-to-pixel homography of a view, and the pose it stands for once the camera matrix is
//! known (METHOD (4), (5)).

use crate::adjust::observations::ViewBlock;
use crate::init::bearing_pose::BoardHomography;
use crate::init::is_usable;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::{Matrix3, Vector3};

/// `z (u, v, 1)^T = H (X, Y, 1)^T` for a view of a flat board.
///
/// Found by the direct linear transform with pixels brought to the size of 1 about the sensor's
/// middle and board points about their centroid; distortion is not known to it.
#[derive(Debug, Clone, Copy)]
pub struct PixelHomography {
    unit_from_board: BoardHomography,
    pixel_from_unit: Matrix3<f64>,
}

impl PixelHomography {
    /// Of the corners of a view; `None` if they are too few or lie on a line.
    pub fn of_view(view: &ViewBlock, sensor: SensorSize) -> Option<Self> {
        if !is_usable(view) {
            return None;
        }
        let (pixels, points): (Vec<PixelPoint>, Vec<_>) = view
            .corners
            .iter()
            .map(|corner| (corner.pixel, corner.point_in_board))
            .unzip();
        Self::fit(&pixels, &points, sensor)
    }

    /// Of pixels and the points of the board (z = 0, mm) that they see; `None` if the points lie
    /// on a line.
    pub fn fit(
        pixels: &[PixelPoint],
        points_in_board: &[Vector3<f64>],
        sensor: SensorSize,
    ) -> Option<Self> {
        let center = sensor.center();
        let half_px = f64::from(sensor.width.max(sensor.height)) / 2.0;
        let units: Vec<Vector3<f64>> = pixels
            .iter()
            .map(|pixel| {
                Vector3::new(
                    (pixel.u - center.u) / half_px,
                    (pixel.v - center.v) / half_px,
                    1.0,
                )
            })
            .collect();
        Some(Self {
            unit_from_board: BoardHomography::fit(&units, points_in_board)?,
            pixel_from_unit: camera_matrix([half_px; 2], center),
        })
    }

    /// H, up to a factor that is positive for boards in front of the camera.
    pub fn matrix(&self) -> Matrix3<f64> {
        self.pixel_from_unit * self.unit_from_board.matrix()
    }

    /// `camera_from_board` through a camera matrix K: `[r1 r2 t] ~ K^-1 H`. `None` if the homography
    /// or K is degenerate.
    pub fn pose(&self, pixel_from_camera: &Matrix3<f64>) -> Option<RigidTransform> {
        let camera_from_unit = pixel_from_camera.try_inverse()? * self.pixel_from_unit;
        self.unit_from_board.then(&camera_from_unit).pose()
    }
}

/// K: focal lengths along u and v (px) and the principal point, without skew.
pub fn camera_matrix(focal_px: [f64; 2], center: PixelPoint) -> Matrix3<f64> {
    Matrix3::new(
        focal_px[0],
        0.0,
        center.u,
        0.0,
        focal_px[1],
        center.v,
        0.0,
        0.0,
        1.0,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::board::BoardSpec;
    use calib_rays::geometry::so3;

    const SENSOR: SensorSize = SensorSize::new(1280, 1024);
    const BOARD: BoardSpec = BoardSpec::chessboard(7, 9, 12.0);

    fn exact() -> (
        Matrix3<f64>,
        RigidTransform,
        Vec<PixelPoint>,
        Vec<Vector3<f64>>,
    ) {
        let k = camera_matrix([1400.0, 1390.0], PixelPoint::new(655.0, 500.0));
        let camera_from_board = RigidTransform::new(
            so3::exp(&Vector3::new(0.3, -0.4, 0.1)),
            Vector3::new(-30.0, -20.0, 400.0),
        );
        let points: Vec<_> = (0..7)
            .flat_map(|row| (0..9).map(move |col| BOARD.corner_in_board(row, col)))
            .collect();
        let pixels = points
            .iter()
            .map(|point| {
                let h = k * camera_from_board.point(point);
                PixelPoint::new(h.x / h.z, h.y / h.z)
            })
            .collect();
        (k, camera_from_board, pixels, points)
    }

    #[test]
    fn exact_pixels_give_the_homography_and_its_pose() {
        let (k, camera_from_board, pixels, points) = exact();
        let found = PixelHomography::fit(&pixels, &points, SENSOR).unwrap();
        let h = found.matrix();
        for (pixel, point) in pixels.iter().zip(&points) {
            let seen = h * Vector3::new(point.x, point.y, 1.0);
            assert!(seen.z > 0.0);
            // Round-off of 1000 px through a condition of some 1e3.
            assert!((seen.x / seen.z - pixel.u).hypot(seen.y / seen.z - pixel.v) < 1e-9);
        }
        let truth = k * Matrix3::from_columns(&[
            camera_from_board.rotation.column(0).into_owned(),
            camera_from_board.rotation.column(1).into_owned(),
            camera_from_board.translation_mm,
        ]);
        assert!((h / h.norm() - truth / truth.norm()).norm() < 1e-10);
        let pose = found.pose(&k).unwrap();
        assert!((pose.rotation - camera_from_board.rotation).norm() < 1e-10);
        assert!((pose.translation_mm - camera_from_board.translation_mm).norm() < 1e-7);
    }

    #[test]
    fn corners_on_a_line_have_no_homography() {
        let (_, _, pixels, points) = exact();
        assert!(PixelHomography::fit(&pixels[..9], &points[..9], SENSOR).is_none());
    }
}
