//! The image that a mesh makes: that of a pinhole without distortion.

use super::error::MeshError;
use crate::camera_rays::CameraRays;
use crate::distortion::Distortion;
use crate::line;
use crate::nearest::nearest_pinholes;
use crate::rectify::pair_axes;
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::Vector3;

/// Places along the longer side of the sensor at which a view is fitted.
const PLACES: u32 = 49;
/// What lies farther off the axis than this many times its depth is not fitted to: a pinhole hardly shows it.
const WIDEST: f64 = 4.0;

/// An image without distortion. The center of its top-left pixel is (0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Its size, that of the camera's sensor.
    pub size: SensorSize,
    /// `[fx, fy]`, px.
    pub focal_px: [f64; 2],
    /// `[cx, cy]`, px.
    pub center_px: [f64; 2],
    /// Where it is seen from: z along the axis, x right, y down.
    pub rig_from_view: RigidTransform,
}

impl View {
    /// The point that a place in the image shows, rig frame.
    pub fn point_mm(&self, [u, v]: [f64; 2], distance_mm: f64) -> Vector3<f64> {
        let ideal = Vector3::new(
            (u - self.center_px[0]) / self.focal_px[0],
            (v - self.center_px[1]) / self.focal_px[1],
            1.0,
        );
        self.rig_from_view.point(&(ideal.normalize() * distance_mm))
    }

    /// The same with another focal length, about the principal point.
    #[must_use]
    pub fn zoomed(self, zoom: f64) -> Self {
        Self {
            focal_px: self.focal_px.map(|focal_px| focal_px * zoom),
            ..self
        }
    }
}

/// A view of each camera, with the center and the axes of the nearest pinhole with distortion, and the focal lengths and the principal
/// point that come nearest to its pixels without.
pub(super) fn own(source: &dyn RaySource, distance_mm: f64) -> Result<Vec<View>, MeshError> {
    let forms = [Distortion::Five, Distortion::Eight];
    let pinholes = nearest_pinholes(source, distance_mm, &forms)?;
    let cameras = pinholes.cameras.iter().enumerate();
    Ok(cameras
        .map(|(camera_idx, pinhole)| {
            let start = View {
                size: pinhole.lens.sensor,
                focal_px: pinhole.lens.focal_px,
                center_px: pinhole.lens.center_px,
                rig_from_view: pinhole.rig_from_pinhole,
            };
            fitted(source, camera_idx, distance_mm, start)
        })
        .collect())
}

/// A rectified pair: one rotation, one focal length and one principal point for both, rows along the line between the centers.
pub(super) fn rectified(source: &dyn RaySource, distance_mm: f64) -> Result<[View; 2], MeshError> {
    let views = own(source, distance_mm)?;
    let [first, second] = views[..] else {
        return Err(MeshError::NoPair);
    };
    let Some((rotation, true)) = pair_axes(&[first.rig_from_view, second.rig_from_view]) else {
        return Err(MeshError::NoPair);
    };
    let turned = [first, second].map(|view| View {
        rig_from_view: RigidTransform::new(rotation, view.rig_from_view.translation_mm),
        ..view
    });
    let [a, b] = [0, 1].map(|k| fitted(source, k, distance_mm, turned[k]));
    let focal_px = (a.focal_px[0] + a.focal_px[1] + b.focal_px[0] + b.focal_px[1]) / 4.0;
    let center_px = [0, 1].map(|k| (a.center_px[k] + b.center_px[k]) / 2.0);
    Ok([a, b].map(|view| View {
        focal_px: [focal_px; 2],
        center_px,
        ..view
    }))
}

/// With the focal lengths and the principal point that come nearest; as it was where too little is seen.
fn fitted(source: &dyn RaySource, camera_idx: usize, distance_mm: f64, view: View) -> View {
    let camera = &source.cameras()[camera_idx];
    let rays = CameraRays::new(source, camera_idx, camera);
    let view_from_camera = view.rig_from_view.inverse() * rays.rig_from_camera;
    let seen: Vec<(PixelPoint, Vector3<f64>)> = rays
        .on_lattice(PLACES)
        .into_iter()
        .filter_map(|(pixel, ray)| {
            let point = view_from_camera.point(&(ray.origin_mm + ray.direction * distance_mm));
            let is_shown = point.z > 0.0 && point.xy().norm() < WIDEST * point.z;
            is_shown.then_some((pixel, point))
        })
        .collect();
    let u = line::rising(
        seen.iter()
            .map(|(pixel, point)| (point.x / point.z, pixel.u)),
    );
    let v = line::rising(
        seen.iter()
            .map(|(pixel, point)| (point.y / point.z, pixel.v)),
    );
    match (u, v) {
        (Some((fx, cx)), Some((fy, cy))) => View {
            focal_px: [fx, fy],
            center_px: [cx, cy],
            ..view
        },
        _ => view,
    }
}
