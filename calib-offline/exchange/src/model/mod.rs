//! The camera models of other tools, forward (a point to its pixel) and back (a pixel to its ray), in f64.
//!
//! Frame of every model: origin at the center of projection, z along the axis, x right, y down; mm. The center of the
//! top-left pixel is (0, 0): readers of formats that count otherwise move the principal point. A family is a file.
//! Where a model folds back, or cannot be turned around, it says so with `None`; no pixel is guessed.

mod cahvor;
mod division;
mod double_sphere;
mod eucm;
mod fisheye;
mod fov;
mod inverse;
mod lonlat;
mod omni;
mod pinhole;
mod plane;
mod splined;
pub(crate) mod stereographic;
#[cfg(test)]
mod tests;

pub use cahvor::{Cahvor, Entrance};
pub use division::Division;
pub use double_sphere::DoubleSphere;
pub use eucm::Eucm;
pub use fisheye::Fisheye;
pub use fov::Fov;
pub use lonlat::{Circle, LonLat};
pub use omni::Omni;
pub use pinhole::Pinhole;
pub use plane::ImagePlane;
pub use splined::{Order, Splined};
pub use stereographic::Stereographic;

use calib_rays::geometry::{PixelPoint, Ray};
use nalgebra::Vector3;
use std::fmt::Debug;

/// What a camera of another tool sees.
pub trait CameraModel: Debug + Send + Sync {
    /// The pixel that sees a point of the camera's frame, mm, on the sensor or beyond its edge; `None` where none does.
    fn project(&self, point: &Vector3<f64>) -> Option<PixelPoint>;

    /// What a pixel sees: unit direction, camera frame, mm. `None` where the model cannot be turned around.
    fn ray(&self, pixel: PixelPoint) -> Option<Ray>;

    /// Whether all rays meet in the origin.
    fn is_central(&self) -> bool {
        true
    }
}

/// A ray through the origin.
fn central(direction: Vector3<f64>) -> Option<Ray> {
    let direction = direction.try_normalize(0.0)?;
    direction.iter().all(|x| x.is_finite()).then_some(Ray {
        origin_mm: Vector3::zeros(),
        direction,
    })
}
