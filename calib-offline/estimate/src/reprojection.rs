//! Residuals of corners under a rig, whatever method it comes from.

use crate::adjust::Observations;
use crate::adjust::residual::linearize;
use calib_rays::board::BoardShape;
use calib_rays::field::Rig;
use calib_rays::geometry::RigidTransform;
use nalgebra::Vector2;

/// Observed minus predicted, px, per view and corner of the observations: to first order, as in the
/// joint estimate. `rig_from_board` is per pose of the observations.
///
/// `None` behind the camera, where the field is singular, and for a pose or camera that is not
/// there.
pub fn residuals(
    rig: &Rig,
    rig_from_board: &[RigidTransform],
    board_shape: &BoardShape,
    observations: &Observations,
) -> Vec<Vec<Option<Vector2<f64>>>> {
    let board = &observations.board;
    observations
        .views
        .iter()
        .map(|view| {
            let camera = rig.cameras.get(view.camera_idx);
            let place = camera
                .zip(rig_from_board.get(view.pose_idx))
                .map(|(camera, pose)| (camera, camera.rig_from_camera.inverse() * *pose));
            let residual = |corner: &crate::adjust::observations::ObservedCorner| {
                let (camera, camera_from_board) = place.as_ref()?;
                let mut point = corner.point_in_board;
                point.z += board_shape.height_mm(board, &point);
                let sample = camera.field.sample(corner.pixel);
                Some(linearize(&sample, &camera_from_board.point(&point))?.residual_px)
            };
            view.corners.iter().map(residual).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::init::rig::start_rig;
    use crate::joint::estimate;
    use calib_simulate::{CameraOptics, OpticsKind, Scene, SceneSettings};

    #[test]
    fn residuals_are_those_of_the_joint_estimate() {
        let mut settings = SceneSettings::standard_noisy(OpticsKind::Port, 5);
        (settings.board.rows, settings.board.cols) = (7, 6);
        settings.board.square_mm = 22.0;
        settings.bow_mm = 0.3;
        settings.angles_deg = (-3..=3).map(|k| f64::from(k) * 13.0).collect();
        let scene = Scene::new(settings).unwrap();
        let sensors = scene.cameras.iter().map(CameraOptics::sensor).collect();
        let seen = Observations::new(
            scene.settings.board.clone(),
            sensors,
            &scene.observe_corners(),
        );
        let start = start_rig(&seen).unwrap();
        let found = estimate(&start.observations, &start).unwrap();
        let rig = found.rig(&seen.numbered_cameras());
        let own = residuals(
            &rig,
            &found.rig_from_board(),
            &found.model.board_shape,
            &found.observations,
        );
        assert_eq!(own.len(), found.residuals.len());
        let pairs = own.iter().flatten().zip(found.residuals.iter().flatten());
        for (own, expected) in pairs {
            // The same numbers in another frame: round-off of 1000 px and 500 mm.
            assert!((own.unwrap() - expected.unwrap()).norm() < 1e-9);
        }
        // A camera or pose that is not there predicts nothing.
        let none = residuals(&rig, &[], &found.model.board_shape, &found.observations);
        assert!(none.iter().flatten().all(Option::is_none));
    }
}
