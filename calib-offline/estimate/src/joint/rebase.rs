//! Base lenses fitted anew to what the fields have found, and the frames turned with them (METHOD 2.1).

use crate::adjust::{Model, Observations};
use calib_rays::field::SmoothMap;
use calib_rays::field::lens_fit::{SeenDirection, nearest_lens};
use calib_rays::field::structured::StructuredBasis;
use calib_rays::field::transport;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Corners of a camera that a lens is fitted to, about.
const CORNERS: usize = 1000;

/// Puts the nearest lens under each field and frees its shift. What polynomial and spline of the
/// direction held beyond it is dropped: the next adjustment finds it again. Offsets stay as they
/// are, and their radial terms about the center of the lens that was there when they were freed.
pub fn rebase(model: &mut Model, observations: &Observations) {
    for camera_idx in 0..model.cameras.len() {
        let (seen, reach_px) = seen_directions(model, observations, camera_idx);
        let field = &mut model.cameras[camera_idx].field;
        if let Some((lens, turn)) = nearest_lens(&field.base, &seen, reach_px) {
            field.base = lens;
            field.direction = SmoothMap::zero(field.direction.polynomial.degree);
            turn_camera(model, camera_idx, &turn);
        }
        let camera = &mut model.cameras[camera_idx];
        let degree = camera.field.direction.polynomial.degree;
        camera.basis = StructuredBasis::new(camera.field.sensor, degree, Some(&camera.field.base));
    }
}

/// Directions at some corners of all views, and the largest offset of any corner, px.
pub(super) fn seen_directions(
    model: &Model,
    observations: &Observations,
    camera_idx: usize,
) -> (Vec<SeenDirection>, f64) {
    let field = &model.cameras[camera_idx].field;
    let center = field.sensor.center();
    let pixels: Vec<PixelPoint> = observations
        .views
        .iter()
        .filter(|view| view.camera_idx == camera_idx)
        .flat_map(|view| view.corners.iter().map(|corner| corner.pixel))
        .collect();
    let reach_px = pixels
        .iter()
        .map(|pixel| pixel.distance_px(center))
        .fold(0.0, f64::max);
    let seen = pixels
        .iter()
        .step_by((pixels.len() / CORNERS).max(1))
        .map(|pixel| {
            let direction = transport::direction(&field.sample(*pixel).s);
            (
                Vector2::new(pixel.u - center.u, pixel.v - center.v),
                direction.normalize(),
            )
        })
        .collect();
    (seen, reach_px)
}

/// Turns a camera's frame and, where the rig's frame is that of camera 0, everything else with that.
pub(super) fn turn_camera(model: &mut Model, camera_idx: usize, new_from_old: &Matrix3<f64>) {
    let turn = RigidTransform::new(*new_from_old, Vector3::zeros());
    if camera_idx > 0 || model.has_known_poses() {
        let camera_from_rig = &mut model.cameras[camera_idx].camera_from_rig;
        *camera_from_rig = turn * *camera_from_rig;
        return;
    }
    for pose in &mut model.rig_from_board {
        *pose = turn * *pose;
    }
    for camera in &mut model.cameras[1..] {
        camera.camera_from_rig = camera.camera_from_rig * turn.inverse();
    }
}
