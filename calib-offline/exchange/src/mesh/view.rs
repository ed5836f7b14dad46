//! The image that a mesh makes: that of a pinhole without distortion.

use super::error::MeshError;
use crate::distortion::Distortion;
use crate::nearest::nearest_pinholes;
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::{Matrix3, Vector3};

/// Places along the longer side of the sensor at which a view is fitted.
const PLACES: u32 = 49;
/// What lies farther off the axis than this many times its depth is not fitted to: a pinhole hardly shows it.
const WIDEST: f64 = 4.0;
/// Cameras stand side by side if the line between them is nearer to a row of their images than this, as a cosine.
const SIDE_BY_SIDE: f64 = 0.7;

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
    let between = second.rig_from_view.translation_mm - first.rig_from_view.translation_mm;
    let mean = |axis: usize| -> Vector3<f64> {
        first.rig_from_view.rotation.column(axis) + second.rig_from_view.rotation.column(axis)
    };
    let along = between.normalize();
    let cosine = along.dot(&mean(0).normalize());
    // NaN is no pair either.
    if !(cosine.abs() > SIDE_BY_SIDE) {
        return Err(MeshError::NoPair);
    }
    let x = along * cosine.signum();
    let y = mean(2).cross(&x).normalize();
    let rotation = Matrix3::from_columns(&[x, y, x.cross(&y)]);
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
    let view_from_rig = view.rig_from_view.inverse();
    let SensorSize { width, height } = view.size;
    let spacing_px = f64::from(width.max(height) - 1).max(1.0) / f64::from(PLACES - 1);
    let along = |length: u32| {
        let count = (f64::from(length - 1) / spacing_px).round().max(1.0);
        (0..=count as u32).map(move |k| f64::from(k) / count * f64::from(length - 1))
    };
    let seen: Vec<(PixelPoint, Vector3<f64>)> = along(height)
        .flat_map(|v| along(width).map(move |u| PixelPoint::new(u, v)))
        .filter_map(|pixel| {
            let ray = source.ray(camera_idx, pixel)?;
            let point = view_from_rig.point(&(ray.origin_mm + ray.direction * distance_mm));
            let is_shown = point.z > 0.0 && point.xy().norm() < WIDEST * point.z;
            is_shown.then_some((pixel, point))
        })
        .collect();
    let u = line(
        &seen
            .iter()
            .map(|(pixel, point)| (point.x / point.z, pixel.u)),
    );
    let v = line(
        &seen
            .iter()
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

/// Slope and start of the line nearest to places, if it rises.
fn line(places: &(impl Iterator<Item = (f64, f64)> + Clone)) -> Option<(f64, f64)> {
    let count = places.clone().count() as f64;
    let sum = |of: fn((f64, f64)) -> f64| places.clone().map(of).sum::<f64>() / count;
    let (x, y) = (sum(|place| place.0), sum(|place| place.1));
    let square = sum(|(x, _)| x * x) - x * x;
    let product = sum(|(x, y)| x * y) - x * y;
    let slope = product / square;
    (slope > 0.0 && slope.is_finite()).then_some((slope, y - slope * x))
}
