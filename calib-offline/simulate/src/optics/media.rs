//! What light crosses between the scene and the lens: flat glass or a dome, by Snell's law.

use calib_rays::geometry::Ray;
use nalgebra::Vector3;
use serde::Serialize;

/// Media in front of a lens in air.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Media {
    /// Nothing.
    Air,
    /// A flat plate: a window if air is behind it, a port if water is.
    Flat(FlatWindow),
    /// A spherical shell.
    Dome(Dome),
}

impl Media {
    /// The ray as it leaves the last surface; origin on that surface, unit direction.
    ///
    /// `None` if the ray misses the glass or is totally reflected.
    pub fn refract(&self, ray: Ray) -> Option<Ray> {
        match self {
            Self::Air => Some(ray),
            Self::Flat(window) => window.refract(&ray),
            Self::Dome(dome) => dome.refract(&ray),
        }
    }
}

/// Direction after a surface (Snell in vector form); `eta` is the index before over the index
/// behind, `normal` a unit normal of either sense. `None` for total reflection.
fn snell(direction: &Vector3<f64>, normal: &Vector3<f64>, eta: f64) -> Option<Vector3<f64>> {
    let facing = direction.dot(normal);
    // The normal on the far side, along the ray.
    let (normal, cos_in) = if facing < 0.0 {
        (-normal, -facing)
    } else {
        (*normal, facing)
    };
    let cos_out_squared = 1.0 - eta * eta * (1.0 - cos_in * cos_in);
    if cos_out_squared.is_nan() || cos_out_squared <= 0.0 {
        return None;
    }
    let cos_out = cos_out_squared.sqrt();
    Some((direction * eta + normal * (cos_out - eta * cos_in)).normalize())
}

/// A plane-parallel plate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FlatWindow {
    /// Unit normal, camera frame, away from the camera.
    pub normal: Vector3<f64>,
    /// Distance of the inner face from the camera's origin along the normal, mm.
    pub distance_mm: f64,
    /// Thickness, mm.
    pub thickness_mm: f64,
    /// Refractive index of the plate.
    pub index: f64,
    /// Refractive index behind it: 1 in air, about 1.333 in water.
    pub index_behind: f64,
}

impl FlatWindow {
    fn refract(&self, ray: &Ray) -> Option<Ray> {
        let inner = self.advance(ray.origin_mm, ray.direction, self.distance_mm)?;
        let in_glass = snell(&ray.direction, &self.normal, 1.0 / self.index)?;
        let outer = self.advance(inner, in_glass, self.distance_mm + self.thickness_mm)?;
        // Equal media: exactly the direction it came in with.
        let direction = if self.index_behind == 1.0 {
            ray.direction
        } else {
            snell(&in_glass, &self.normal, self.index / self.index_behind)?
        };
        Some(Ray {
            origin_mm: outer,
            direction,
        })
    }

    /// Where a line meets the plane at `distance_mm`; `None` if it runs the other way.
    fn advance(
        &self,
        origin_mm: Vector3<f64>,
        direction: Vector3<f64>,
        distance_mm: f64,
    ) -> Option<Vector3<f64>> {
        let cos = direction.dot(&self.normal);
        if cos.is_nan() || cos <= 1e-9 {
            return None;
        }
        Some(origin_mm + direction * ((distance_mm - origin_mm.dot(&self.normal)) / cos))
    }
}

/// A spherical shell of glass with water (or anything) outside. A lens at its center sees straight
/// rays; off center it does not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Dome {
    /// Center of both spheres, camera frame, mm. The lens must stand inside.
    pub center_mm: Vector3<f64>,
    /// Radius of the inner face, mm.
    pub inner_radius_mm: f64,
    /// Thickness, mm.
    pub thickness_mm: f64,
    /// Refractive index of the shell.
    pub index: f64,
    /// Refractive index outside.
    pub index_behind: f64,
}

impl Dome {
    fn refract(&self, ray: &Ray) -> Option<Ray> {
        let inner = self.leave(ray, self.inner_radius_mm)?;
        let normal = (inner - self.center_mm).normalize();
        let in_glass = Ray {
            origin_mm: inner,
            direction: snell(&ray.direction, &normal, 1.0 / self.index)?,
        };
        let outer = self.leave(&in_glass, self.inner_radius_mm + self.thickness_mm)?;
        let normal = (outer - self.center_mm).normalize();
        Some(Ray {
            origin_mm: outer,
            direction: snell(&in_glass.direction, &normal, self.index / self.index_behind)?,
        })
    }

    /// Where a ray from inside leaves the sphere of a radius.
    fn leave(&self, ray: &Ray, radius_mm: f64) -> Option<Vector3<f64>> {
        let from_center = ray.origin_mm - self.center_mm;
        let half_b = from_center.dot(&ray.direction);
        let c = from_center.norm_squared() - radius_mm * radius_mm;
        let discriminant = half_b * half_b - c;
        // Inside (or on) the sphere c <= 0, so the discriminant cannot be negative.
        (c <= 1e-9 && discriminant >= 0.0)
            .then(|| ray.origin_mm + ray.direction * (discriminant.sqrt() - half_b))
    }
}
