//! Which way a view's labels turn.

use calib_rays::observed::Corner;

/// Whether columns and rows turn as u and v do; `None` if the corners do not say. The sign of the
/// determinant of the best affine map from (col, row) to (u, v).
pub fn turns_like_image(corners: &[Corner]) -> Option<bool> {
    let count = corners.len() as f64;
    let mean = |of: fn(&Corner) -> f64| corners.iter().map(of).sum::<f64>() / count;
    let (mx, my) = (mean(|c| c.col as f64), mean(|c| c.row as f64));
    let (mu, mv) = (mean(|c| c.pixel.u), mean(|c| c.pixel.v));
    // Sums of products about the means; the normal matrix is positive and does not change the sign.
    let (mut xu, mut xv, mut yu, mut yv) = (0.0, 0.0, 0.0, 0.0);
    for c in corners {
        let (x, y) = (c.col as f64 - mx, c.row as f64 - my);
        let (u, v) = (c.pixel.u - mu, c.pixel.v - mv);
        xu += x * u;
        xv += x * v;
        yu += y * u;
        yv += y * v;
    }
    let determinant = xu * yv - xv * yu;
    (determinant != 0.0 && determinant.is_finite()).then_some(determinant > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::PixelPoint;

    #[test]
    fn mirrored_labels_turn_the_other_way() {
        let corner = |k: usize| Corner {
            row: k / 3,
            col: k % 3,
            pixel: PixelPoint::new(10.0 * (k % 3) as f64 + (k / 3) as f64, 9.0 * (k / 3) as f64),
            sigma_px: None,
        };
        let mut corners: Vec<Corner> = (0..9).map(corner).collect();
        assert_eq!(turns_like_image(&corners), Some(true));
        for corner in &mut corners {
            corner.pixel.v *= -1.0;
        }
        assert_eq!(turns_like_image(&corners), Some(false));
        assert_eq!(turns_like_image(&corners[..3]), None);
    }
}
