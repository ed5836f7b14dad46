//! Whoever knows a camera's rays: a calibration in f64, or a blob with the device's own code.

use calib_rays::field::{PairUncertainty, Rig};
use calib_rays::geometry::{PixelPoint, Ray, RigidTransform, SensorSize};
use ray_runtime::RayBlob;

/// A camera of a [`RaySource`].
#[derive(Debug, Clone, PartialEq)]
pub struct SourceCamera {
    /// Unique in the rig.
    pub name: String,
    /// Its sensor.
    pub sensor: SensorSize,
    /// Where it is. A blob's rotation is orthonormal to f32 round-off.
    pub rig_from_camera: RigidTransform,
}

/// Gives the rays of pixels.
pub trait RaySource: Sync {
    /// The cameras, in the rig's order.
    fn cameras(&self) -> Vec<SourceCamera>;

    /// What a pixel sees: rig frame, mm, unit direction, the origin at the foot point of the camera's reference point;
    /// `None` outside the calibrated area.
    fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray>;

    /// The rectangle of pixels that is asked for, upper left and lower right corner; `None` for whole sensors.
    fn region(&self) -> Option<[PixelPoint; 2]> {
        None
    }

    /// What is known of the uncertainty of pairs; a blob keeps it to itself.
    fn uncertainty(&self) -> Vec<PairUncertainty> {
        Vec::new()
    }
}

impl RaySource for Rig {
    fn cameras(&self) -> Vec<SourceCamera> {
        let cameras = self.cameras.iter();
        cameras
            .map(|camera| SourceCamera {
                name: camera.name.clone(),
                sensor: camera.field.sensor,
                rig_from_camera: camera.rig_from_camera,
            })
            .collect()
    }

    fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        let ray = self.cameras.get(camera_idx)?.ray_in_rig(pixel)?;
        Some(with_unit_direction(ray))
    }

    fn uncertainty(&self) -> Vec<PairUncertainty> {
        self.uncertainty.clone()
    }
}

impl RaySource for RayBlob<'_> {
    fn cameras(&self) -> Vec<SourceCamera> {
        (0..self.camera_count())
            .filter_map(|camera_idx| self.camera(camera_idx))
            .map(|camera| SourceCamera {
                name: camera.name.to_owned(),
                sensor: SensorSize::new(camera.sensor_width, camera.sensor_height),
                rig_from_camera: RigidTransform::new(
                    camera.rig_from_camera.rotation_matrix().matrix().cast(),
                    camera.rig_from_camera.translation_mm.map(f64::from).into(),
                ),
            })
            .collect()
    }

    fn ray(&self, camera_idx: usize, pixel: PixelPoint) -> Option<Ray> {
        let pixel = ray_runtime::PixelPoint::new(pixel.u as f32, pixel.v as f32);
        let ray = self.lookup(camera_idx, pixel).ok()?;
        Some(with_unit_direction(Ray {
            origin_mm: ray.origin_mm.map(f64::from).into(),
            direction: ray.direction.map(f64::from).into(),
        }))
    }
}

fn with_unit_direction(ray: Ray) -> Ray {
    Ray {
        direction: ray.direction.normalize(),
        ..ray
    }
}
