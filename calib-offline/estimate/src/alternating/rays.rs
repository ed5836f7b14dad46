//! The rays of one camera: from control points to a table with one ray per pixel.

use super::alternation::{PixelControl, control_points, supported_line};
use super::plane_map::PlaneMap;
use calib_rays::field::RayTable;
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize};
use nalgebra::Vector3;
use rayon::prelude::*;

/// A ray with the stretch of it that control points support, rig frame.
#[derive(Debug, Clone, Copy)]
pub struct SupportedRay {
    /// Which pixel sees it.
    pub pixel: PixelPoint,
    /// Origin at the foot point of the camera's place; direction of length 1, into the scene.
    pub ray: Ray,
    /// Distances along it, from the origin, of the nearest and the farthest control point, mm.
    pub near_mm: f64,
    /// See [`Self::near_mm`].
    pub far_mm: f64,
}

/// What turns a pixel of one camera into its ray: a map to each board that the camera saw, the
/// boards' poses, and where the camera is about.
#[derive(Debug, Clone)]
pub struct RaySource {
    /// Per pose index; `None` where the camera saw no board.
    pub maps: Vec<Option<PlaneMap>>,
    /// Per pose index, rig frame.
    pub rig_from_board: Vec<Option<RigidTransform>>,
    /// Where the camera is about, rig frame, mm: which side of the boards is its side.
    pub place_mm: Vector3<f64>,
}

impl RaySource {
    /// Where a pixel looks on each board.
    pub fn control(&self, pixel: PixelPoint) -> PixelControl {
        control(&self.maps, pixel)
    }

    /// The ray of a pixel, anywhere between pixels too; `None` where [`supported_line`] finds
    /// none.
    pub fn ray(&self, pixel: PixelPoint) -> Option<SupportedRay> {
        let control = self.control(pixel);
        let points: Vec<Vector3<f64>> = control_points(&control, &self.rig_from_board)
            .into_iter()
            .map(|(_, _, point)| point)
            .collect();
        let line = supported_line(&points, &self.place_mm)?;
        let forward = (line.origin_mm - self.place_mm).dot(&line.direction);
        let direction = line.direction * 1f64.copysign(forward);
        let origin_mm = line.foot_point(&self.place_mm);
        let mut along: Vec<f64> = points
            .iter()
            .map(|point| (point - origin_mm).dot(&direction))
            .collect();
        along.sort_by(f64::total_cmp);
        let (near_mm, far_mm) = (*along.first()?, *along.last()?);
        Some(SupportedRay {
            pixel,
            ray: Ray {
                origin_mm,
                direction,
            },
            near_mm,
            far_mm,
        })
    }

    /// The rays of a lattice over the sensor, `spacing_px` apart, row by row.
    pub fn lattice(&self, sensor: SensorSize, spacing_px: f64) -> Vec<Option<SupportedRay>> {
        lattice(sensor, spacing_px)
            .into_par_iter()
            .map(|pixel| self.ray(pixel))
            .collect()
    }

    /// One ray per pixel: the publication's form of a camera.
    ///
    /// Cost: an exponential per neuron, board and pixel; a few seconds for a megapixel.
    pub fn table(&self, sensor: SensorSize) -> RayTable {
        RayTable::new(sensor, |pixel| Some(self.ray(pixel)?.ray))
    }
}

/// Where a pixel looks on each board.
pub fn control(maps: &[Option<PlaneMap>], pixel: PixelPoint) -> PixelControl {
    PixelControl {
        boards: maps
            .iter()
            .enumerate()
            .filter_map(|(pose_idx, map)| Some((pose_idx, map.as_ref()?.board_point(pixel)?)))
            .collect(),
    }
}

/// Pixels `spacing_px` apart over a sensor, row by row, the outer ones half of that from its edges.
pub fn lattice(sensor: SensorSize, spacing_px: f64) -> Vec<PixelPoint> {
    let axis = |extent: u32| {
        let count = (f64::from(extent) / spacing_px).round().max(1.0);
        let step = f64::from(extent) / count;
        (0..count as usize).map(move |k| (k as f64 + 0.5) * step - 0.5)
    };
    axis(sensor.height)
        .flat_map(|v| axis(sensor.width).map(move |u| PixelPoint::new(u, v)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_covers_the_sensor_evenly() {
        let pixels = lattice(SensorSize::new(40, 20), 10.0);
        assert_eq!(pixels.len(), 8);
        assert_eq!(pixels[0], PixelPoint::new(4.5, 4.5));
        assert_eq!(pixels[7], PixelPoint::new(34.5, 14.5));
    }
}
