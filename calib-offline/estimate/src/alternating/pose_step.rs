//! The pose of one board among fixed rays: the closed form of the publication (Eqs. 18 to 30).
//!
//! With the control points `Po_j` of a board at the pose `Theta_o = (R_o, t_o)` and the foot points
//! `Pn_j` on their rays, `f(eps) = 1/2 sum_j w_j |Pn_j - exp(eps^) Theta_o Po_j|^2` is least, to first
//! order in `eps = (rho, phi)`, where its gradient (24) vanishes:
//!
//! `eps = F_o M^-1 F_o^T a` (26), with the adjoint `F_o` of the pose (25), the constant matrix M of the
//! board's points (27, 28), and `a` from their means and the matrix S of their products. As printed,
//! (26) to (28) are not readable; this is what they must be, as the tests prove: a step equals that
//! of the normal equations, and repeated steps end where Kabsch's rotation is.

use calib_rays::geometry::RigidTransform;
use calib_rays::geometry::so3::skew;
use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3, Vector6};

/// A point of the board and the foot point that it should meet.
#[derive(Debug, Clone, Copy)]
pub struct Pull {
    /// Board frame, mm (`Po_j`).
    pub board_mm: Vector3<f64>,
    /// On the ray, frame of the poses, mm (`Pn_j`).
    pub foot_mm: Vector3<f64>,
    /// How much it counts (`w_j`).
    pub weight: f64,
}

/// `eps^` (23): the matrix whose exponential is the change of pose.
fn hat(eps: &Vector6<f64>) -> Matrix4<f64> {
    let (rho, phi) = (eps.fixed_rows::<3>(0), eps.fixed_rows::<3>(3));
    let mut matrix = Matrix4::zeros();
    // (22)
    matrix
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&skew(&phi.into_owned()));
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&rho);
    matrix
}

/// `exp(eps^) Theta` (21, 30).
pub fn moved(theta: &RigidTransform, eps: &Vector6<f64>) -> RigidTransform {
    let exponential = hat(eps).exp();
    let change = RigidTransform::new(
        exponential.fixed_view::<3, 3>(0, 0).into_owned(),
        exponential.fixed_view::<3, 1>(0, 3).into_owned(),
    );
    (change * *theta).orthonormalized()
}

/// The adjoint of a pose (25).
fn adjoint(theta: &RigidTransform) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    let rotation = theta.rotation;
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    matrix
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&(skew(&theta.translation_mm) * rotation));
    matrix
}

/// The inverse of M (27): `M = [I 0; c^ I] diag(I, L) [I -c^; 0 I]` with the points' mean c.
///
/// `None` if the points lie on a line: L is not positive definite then.
fn inverse_of_m(mean_in_board: &Vector3<f64>, l: &Matrix3<f64>) -> Option<Matrix6<f64>> {
    let c = skew(mean_in_board);
    let mut left = Matrix6::identity();
    left.fixed_view_mut::<3, 3>(0, 3).copy_from(&c);
    let mut middle = Matrix6::identity();
    middle
        .fixed_view_mut::<3, 3>(3, 3)
        .copy_from(&l.cholesky()?.inverse());
    // [I -c^; 0 I]^-1 = [I c^; 0 I], and c^T = -c.
    Some(left * middle * left.transpose())
}

/// The step of (26) from the pose `theta`; `None` if the points do not determine it.
pub fn closed_form_step(theta: &RigidTransform, pulls: &[Pull]) -> Option<Vector6<f64>> {
    let total: f64 = pulls.iter().map(|p| p.weight).sum();
    let mean = |of: fn(&Pull) -> Vector3<f64>| {
        pulls.iter().map(|p| of(p) * p.weight).sum::<Vector3<f64>>() / total
    };
    let (mean_in_board, mean_foot) = (mean(|p| p.board_mm), mean(|p| p.foot_mm));
    let (mut l, mut s) = (Matrix3::zeros(), Matrix3::zeros());
    for pull in pulls {
        let from_mean = pull.board_mm - mean_in_board;
        let c = skew(&from_mean);
        // (28)
        l -= c * c * (pull.weight / total);
        s += (pull.foot_mm - mean_foot) * from_mean.transpose() * (pull.weight / total);
    }
    let q = theta.point(&mean_in_board);
    // b_j = tr(1_j^ R_o S^T): what turns the feet's products towards the board's.
    let turned = theta.rotation * s.transpose();
    let b = Vector3::from_fn(|j, _| (skew(&Vector3::ith(j, 1.0)) * turned).trace());
    let mut a = Vector6::zeros();
    a.fixed_rows_mut::<3>(0).copy_from(&(mean_foot - q));
    a.fixed_rows_mut::<3>(3)
        .copy_from(&(b - mean_foot.cross(&q)));
    let f = adjoint(theta);
    let eps = f * inverse_of_m(&mean_in_board, &l)? * f.transpose() * a;
    eps.iter().all(|x| x.is_finite()).then_some(eps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::{best_placement, so3};

    /// Points of a board at a pose and feet a few tenths of a millimeter off.
    fn pulls(theta: &RigidTransform) -> Vec<Pull> {
        (0..40)
            .map(|k| {
                let x = f64::from(k);
                let board_mm = Vector3::new(10.0 * f64::from(k % 8), 10.0 * f64::from(k / 8), 0.0);
                let off = Vector3::new((1.3 * x).sin(), (2.1 * x).cos(), (0.7 * x).sin()) * 0.3;
                Pull {
                    board_mm,
                    foot_mm: theta.point(&board_mm) + off,
                    weight: 1.0 + 0.5 * (0.9 * x).sin(),
                }
            })
            .collect()
    }

    fn theta() -> RigidTransform {
        RigidTransform::new(
            so3::exp(&Vector3::new(0.2, -0.5, 0.1)),
            Vector3::new(-30.0, 12.0, 350.0),
        )
    }

    /// Gauss-Newton on `Pn - (Pe + [I, -Pe^] eps)`, the gradient of which is (24).
    fn by_normal_equations(theta: &RigidTransform, pulls: &[Pull]) -> Vector6<f64> {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for pull in pulls {
            let pe = theta.point(&pull.board_mm);
            let mut by_eps = nalgebra::Matrix3x6::zeros();
            by_eps
                .fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&Matrix3::identity());
            by_eps.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&pe));
            normal += by_eps.tr_mul(&by_eps) * pull.weight;
            right += by_eps.tr_mul(&(pull.foot_mm - pe)) * pull.weight;
        }
        normal.try_inverse().unwrap() * right
    }

    #[test]
    fn the_step_is_that_of_the_normal_equations() {
        let theta = theta();
        let pulls = pulls(&theta);
        let step = closed_form_step(&theta, &pulls).unwrap();
        let direct = by_normal_equations(&theta, &pulls);
        assert!(
            (step - direct).norm() < 1e-12 * direct.norm().max(1.0),
            "{step} {direct}"
        );
        assert!(direct.norm() > 1e-3, "there was something to do");
    }

    #[test]
    fn steps_end_at_the_rotation_of_kabsch() {
        let mut theta = theta();
        let mut pulls = pulls(&theta);
        for pull in &mut pulls {
            pull.weight = 1.0;
        }
        for _ in 0..10 {
            theta = moved(&theta, &closed_form_step(&theta, &pulls).unwrap());
        }
        let (from, to): (Vec<_>, Vec<_>) = pulls.iter().map(|p| (p.board_mm, p.foot_mm)).unzip();
        let kabsch = best_placement(&from, &to).unwrap();
        assert!((theta.rotation - kabsch.rotation).norm() < 1e-12);
        // Of 350 mm.
        assert!((theta.translation_mm - kabsch.translation_mm).norm() < 350.0 * 1e-12);
    }

    #[test]
    fn the_determinants_of_m_and_l_are_equal() {
        let mean = Vector3::new(35.0, 20.0, 0.0);
        let l = Matrix3::from_diagonal(&Vector3::new(2.0, 3.0, 5.0));
        let m = inverse_of_m(&mean, &l).unwrap().try_inverse().unwrap();
        assert!((m.determinant() - 30.0).abs() < 1e-9 * 30.0);
    }

    #[test]
    fn points_on_a_line_give_no_step() {
        let theta = theta();
        let mut pulls = pulls(&theta);
        for pull in &mut pulls {
            pull.board_mm.y = 0.0;
        }
        assert!(closed_form_step(&theta, &pulls).is_none());
    }

    #[test]
    fn the_exponential_of_a_twist_is_a_screw() {
        // A quarter turn about z while moving along it: x goes to y.
        let eps = Vector6::new(0.0, 0.0, 2.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let screw = moved(&RigidTransform::identity(), &eps);
        assert!((screw.point(&Vector3::x()) - Vector3::new(0.0, 1.0, 2.0)).norm() < 1e-14);
    }
}
