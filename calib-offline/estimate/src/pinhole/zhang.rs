//! Zhang's closed form: the camera matrix from plane homographies, before anything is iterated.
//!
//! The columns h1, h2 of a homography are images of perpendicular directions of equal length, so
//! `h1^T B h2 = 0` and `(h1 + h2)^T B (h1 - h2) = 0` with the conic `B = K^-T K^-1`: two linear
//! equations per view. Lens distortion is not part of it; what it gives is a starting point.
//!
//! What it determines, and how well:
//! * A board that moves without turning, or turns about its own normal only, tells nothing beyond
//!   its first view: two equations, or for a board that faces the camera none.
//! * A board that turns about one axis parallel to itself, as on a stage, determines everything from
//!   three angles on: the circular points of its planes wander along the absolute conic, and five
//!   points fix a conic. It was believed to be nearly critical (METHOD section 3) and is not: from
//!   -40 to 40 degrees it amplifies noise by 1.1 to 1.2 against tilts both ways of the same size, and
//!   only tilts within 4 degrees make that 1.7 (a test below).
//! * What does harm is small tilts of either kind (noise grows with the inverse square), and
//!   distortion, which the closed form takes for perspective.

use super::homography::{PixelHomography, camera_matrix};
use calib_rays::geometry::{PixelPoint, SensorSize};
use calib_rays::numerics::SingularValues;
use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2, Vector3};

/// A singular value this much smaller than the largest is zero: homographies from exact pixels
/// satisfy their equations to some 1e-11.
const ROUND_OFF: f64 = 1e-8;
/// The last singular value (misfit) over the last but one (what determines the conic) must stay
/// below this for the solution to stand out from the noise.
const MOST_MISFIT: f64 = 0.3;
/// A principal point farther than this from the sensor's middle, in half widths of its longer side,
/// is no camera's.
const FARTHEST_CENTER: f64 = 1.0;

/// Which closed form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ZhangForm {
    /// The whole conic: focal lengths, principal point and skew.
    Conic,
    /// Focal lengths only; the principal point is put into the middle of the sensor.
    FixedCenter,
}

/// A camera matrix in closed form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZhangCamera {
    /// Along u and v, px.
    pub focal_px: [f64; 2],
    /// Principal point, px.
    pub center: PixelPoint,
    /// `K[0][1]`, px; 0 in the form with fixed center.
    pub skew_px: f64,
}

impl ZhangCamera {
    /// K without the skew, which no later step knows.
    pub fn matrix(&self) -> Matrix3<f64> {
        camera_matrix(self.focal_px, self.center)
    }
}

/// The closed form of the kind asked for; `None` if the homographies do not determine it or what
/// they give is no camera.
pub fn zhang(
    homographies: &[PixelHomography],
    sensor: SensorSize,
    form: ZhangForm,
) -> Option<ZhangCamera> {
    let center = sensor.center();
    let half_px = f64::from(sensor.width.max(sensor.height)) / 2.0;
    let unit_from_pixel = camera_matrix([half_px; 2], center).try_inverse()?;
    let pairs: Vec<[Vector3<f64>; 2]> = homographies
        .iter()
        .flat_map(|homography| {
            let h = unit_from_pixel * homography.matrix();
            let (h1, h2) = (h.column(0).into_owned(), h.column(1).into_owned());
            [[h1, h2], [h1 + h2, h1 - h2]].map(|pair| pair.map(|column| column.normalize()))
        })
        .collect();
    let unit = match form {
        ZhangForm::Conic => conic(&pairs)?,
        ZhangForm::FixedCenter => fixed_center(&pairs)?,
    };
    let camera = ZhangCamera {
        focal_px: unit.focal_px.map(|focal| focal * half_px),
        center: PixelPoint::new(
            center.u + unit.center.u * half_px,
            center.v + unit.center.v * half_px,
        ),
        skew_px: unit.skew_px * half_px,
    };
    let is_camera = camera.focal_px.iter().all(|f| f.is_finite() && *f > 0.0)
        && unit.center.u.hypot(unit.center.v) <= FARTHEST_CENTER;
    is_camera.then_some(camera)
}

/// All of B from pairs (a, b) with `a^T B b = 0`, in units of half the sensor from its middle.
fn conic(pairs: &[[Vector3<f64>; 2]]) -> Option<ZhangCamera> {
    const UNKNOWNS: usize = 6;
    // The decomposition has as many right vectors as the smaller side: rows of zeros change nothing.
    let mut rows = DMatrix::zeros(pairs.len().max(UNKNOWNS), UNKNOWNS);
    for (k, [a, b]) in pairs.iter().enumerate() {
        let row = [
            a.x * b.x,
            a.x * b.y + a.y * b.x,
            a.y * b.y,
            a.x * b.z + a.z * b.x,
            a.y * b.z + a.z * b.y,
            a.z * b.z,
        ];
        rows.row_mut(k).copy_from_slice(&row);
    }
    let svd = SingularValues::new(rows)?;
    let value = &svd.values;
    if value[4] <= ROUND_OFF * value[0] || value[5] > MOST_MISFIT * value[4] {
        return None;
    }
    let b = svd.right.column(5);
    let [b11, b12, b22, b13, b23, b33] = [b[0], b[1], b[2], b[3], b[4], b[5]];
    let determinant = b11 * b22 - b12 * b12;
    let cv = (b12 * b13 - b11 * b23) / determinant;
    let lambda = b33 - (b13 * b13 + cv * (b12 * b13 - b11 * b23)) / b11;
    if !(determinant > 0.0 && lambda / b11 > 0.0) {
        return None;
    }
    let fu = (lambda / b11).sqrt();
    let fv = (lambda * b11 / determinant).sqrt();
    let skew = -b12 * fu * fu * fv / lambda;
    Some(ZhangCamera {
        focal_px: [fu, fv],
        center: PixelPoint::new(skew * cv / fv - b13 * fu * fu / lambda, cv),
        skew_px: skew,
    })
}

/// `1/fu^2` and `1/fv^2` by least squares, the principal point being the origin: the form that
/// `OpenCV` starts from.
fn fixed_center(pairs: &[[Vector3<f64>; 2]]) -> Option<ZhangCamera> {
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for [a, b] in pairs {
        let row = Vector2::new(a.x * b.x, a.y * b.y);
        normal += row * row.transpose();
        right -= row * (a.z * b.z);
    }
    let eigenvalues = normal.symmetric_eigenvalues();
    // Squares of singular values.
    if !(eigenvalues.min() > ROUND_OFF * ROUND_OFF * eigenvalues.max()) {
        return None;
    }
    let inverse_squares = normal.cholesky()?.solve(&right);
    (inverse_squares.min() > 0.0).then(|| ZhangCamera {
        focal_px: [0, 1].map(|k| 1.0 / inverse_squares[k].sqrt()),
        center: PixelPoint::new(0.0, 0.0),
        skew_px: 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::board::BoardSpec;
    use calib_rays::geometry::{RigidTransform, so3};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const SENSOR: SensorSize = SensorSize::new(1280, 1024);
    const BOARD: BoardSpec = BoardSpec::chessboard(9, 11, 12.0);

    fn truth(center: PixelPoint) -> Matrix3<f64> {
        camera_matrix([2050.0, 2030.0], center)
    }

    /// Homographies of boards with these rotation vectors, their middles on the axis 400 mm away.
    fn homographies(
        k: &Matrix3<f64>,
        turns_rad: &[[f64; 3]],
        mut noise_px: impl FnMut() -> f64,
    ) -> Vec<PixelHomography> {
        let points: Vec<_> = (0..BOARD.rows)
            .flat_map(|row| (0..BOARD.cols).map(move |col| BOARD.corner_in_board(row, col)))
            .collect();
        turns_rad
            .iter()
            .map(|turn| {
                let rotation = so3::exp(&Vector3::from(*turn));
                let middle = rotation * BOARD.center_in_board();
                let pose = RigidTransform::new(rotation, Vector3::new(5.0, -8.0, 400.0) - middle);
                let pixels: Vec<_> = points
                    .iter()
                    .map(|point| {
                        let h = k * pose.point(point);
                        PixelPoint::new(h.x / h.z + noise_px(), h.y / h.z + noise_px())
                    })
                    .collect();
                PixelHomography::fit(&pixels, &points, SENSOR).unwrap()
            })
            .collect()
    }

    /// Tilts of up to 40 degrees in all directions.
    fn general() -> Vec<[f64; 3]> {
        (0..17)
            .map(|k| {
                let (angle, tilt) = (2.4 * f64::from(k), 0.7 * f64::from(k) / 16.0);
                [tilt * angle.cos(), tilt * angle.sin(), 0.1]
            })
            .collect()
    }

    /// -40 to 40 degrees about an axis parallel to the board, which stands across the image.
    fn single_axis() -> Vec<[f64; 3]> {
        (-8..=8)
            .map(|k| [0.0, f64::from(k) * 5f64.to_radians(), 0.0])
            .collect()
    }

    #[test]
    fn exact_homographies_give_the_camera_matrix() {
        let middle = SENSOR.center();
        for (form, center) in [
            (ZhangForm::Conic, PixelPoint::new(655.0, 490.0)),
            (ZhangForm::FixedCenter, middle),
        ] {
            let k = truth(center);
            for turns in [general(), single_axis()] {
                let found = zhang(&homographies(&k, &turns, || 0.0), SENSOR, form).unwrap();
                // Homographies are exact to some 1e-11, and the conic amplifies that.
                assert!((found.matrix() - k).abs().max() < 1e-8 * 2050.0, "{form:?}");
                assert!(found.skew_px.abs() < 1e-8 * 2050.0);
            }
        }
    }

    /// RMS error of the focal lengths over noise draws of 0.1 px, px.
    fn focal_error_px(turns_rad: &[[f64; 3]], share: f64, form: ZhangForm) -> f64 {
        const DRAWS: usize = 40;
        let k = truth(SENSOR.center());
        let turns: Vec<_> = turns_rad
            .iter()
            .map(|turn| turn.map(|x| x * share))
            .collect();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut squared = 0.0;
        for _ in 0..DRAWS {
            let noisy = homographies(&k, &turns, || {
                let x: f64 = StandardNormal.sample(&mut rng);
                0.1 * x
            });
            let found = zhang(&noisy, SENSOR, form).unwrap().focal_px;
            squared += (found[0] - k[(0, 0)]).powi(2) + (found[1] - k[(1, 1)]).powi(2);
        }
        (squared / (2 * DRAWS) as f64).sqrt()
    }

    #[test]
    fn one_axis_is_nearly_as_good_as_two_and_small_tilts_are_bad() {
        for form in [ZhangForm::Conic, ZhangForm::FixedCenter] {
            let loss = |share: f64| {
                focal_error_px(&single_axis(), share, form)
                    / focal_error_px(&general(), share, form)
            };
            // 1.1 and 1.7 here; a ratio of two such errors, of 40 draws each, is known to 16 %.
            let (wide, narrow) = (loss(1.0), loss(0.1));
            assert!((0.7..1.6).contains(&wide), "{form:?} {wide}");
            assert!((1.0..2.5).contains(&narrow), "{form:?} {narrow}");
            let [wide_px, narrow_px] =
                [1.0, 0.1].map(|share| focal_error_px(&single_axis(), share, form));
            assert!(narrow_px > 20.0 * wide_px, "{form:?} {wide_px} {narrow_px}");
        }
    }

    #[test]
    fn two_angles_of_one_axis_leave_the_conic_open() {
        let k = truth(PixelPoint::new(655.0, 490.0));
        let two = homographies(&k, &[[0.0, -0.5, 0.0], [0.0, 0.4, 0.0]], || 0.0);
        assert!(zhang(&two, SENSOR, ZhangForm::Conic).is_none());
    }

    #[test]
    fn boards_that_do_not_turn_determine_no_conic() {
        let k = truth(SENSOR.center());
        let tilted = homographies(&k, &[[0.3, 0.4, 0.0]; 5], || 0.0);
        assert!(zhang(&tilted, SENSOR, ZhangForm::Conic).is_none());
        // Two equations for two focal lengths.
        assert!(zhang(&tilted, SENSOR, ZhangForm::FixedCenter).is_some());
        let facing: Vec<[f64; 3]> = (0..5).map(|k| [0.0, 0.0, 0.3 * f64::from(k)]).collect();
        let facing = homographies(&k, &facing, || 0.0);
        for form in [ZhangForm::Conic, ZhangForm::FixedCenter] {
            assert!(zhang(&facing, SENSOR, form).is_none(), "{form:?}");
        }
    }
}
