//! What crosses the interface by value: the structs of `rays.h`, field by field.

use core::ffi::{c_char, c_int};
use ray_runtime::format::IDENTITY_LEN;
use ray_runtime::{PixelPoint, RayBlob, Triangulation};

/// A pixel of a camera.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Sighting {
    pub(crate) camera: usize,
    pub(crate) u_px: f32,
    pub(crate) v_px: f32,
}

/// A place on a sensor or an image.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Pixel {
    pub(crate) u_px: f32,
    pub(crate) v_px: f32,
}

/// What a blob says of itself.
#[repr(C)]
pub struct Info {
    pub(crate) identity: [u8; IDENTITY_LEN],
    pub(crate) max_error_px: f32,
    pub(crate) working_distance_mm: f32,
    pub(crate) blob_len: usize,
}

impl Info {
    pub(crate) fn of_rust(blob: &RayBlob<'_>) -> Self {
        Self {
            identity: *blob.identity(),
            max_error_px: blob.max_error_px(),
            working_distance_mm: blob.working_distance_mm(),
            blob_len: blob.len(),
        }
    }
}

/// A camera of the blob.
#[repr(C)]
pub struct Camera {
    pub(crate) name: *const c_char,
    pub(crate) name_len: usize,
    pub(crate) sensor_width_px: u32,
    pub(crate) sensor_height_px: u32,
}

/// A point on the ray of a pixel, and where another camera sees it.
#[repr(C)]
pub struct CurvePoint {
    pub(crate) pixel: Pixel,
    pub(crate) point_mm: [f32; 3],
}

/// What a camera reads out.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CameraReadout {
    pub(crate) sensor_px: [u32; 2],
    pub(crate) first_px: [u32; 2],
    pub(crate) image_px: [u32; 2],
    pub(crate) binning: [u32; 2],
}

/// A ray, rig frame.
#[repr(C)]
pub struct Ray {
    pub(crate) origin_mm: [f32; 3],
    pub(crate) direction: [f32; 3],
}

/// A triangulated point, rig frame.
#[repr(C)]
pub struct Point {
    pub(crate) point_mm: [f32; 3],
    pub(crate) gap_squared_mm2: f32,
}

impl Point {
    pub(crate) fn of_rust(found: Triangulation) -> Self {
        Self {
            point_mm: found.point_mm,
            gap_squared_mm2: found.gap_squared_mm2,
        }
    }
}

/// A triangulated point with its standard deviations, rig frame.
#[repr(C)]
pub struct Measurement {
    pub(crate) point_mm: [f32; 3],
    pub(crate) gap_squared_mm2: f32,
    pub(crate) sigma_mm: [f32; 3],
    pub(crate) has_sigma: c_int,
    pub(crate) gap_mm: f32,
    pub(crate) gap_variance_mm2: f32,
}

impl Measurement {
    pub(crate) fn of_rust(measured: ray_runtime::Measurement) -> Self {
        let sigma_mm = measured.covariance.map(|covariance| covariance.sigma_mm());
        Self {
            point_mm: measured.found.point_mm,
            gap_squared_mm2: measured.found.gap_squared_mm2,
            sigma_mm: sigma_mm.unwrap_or_default(),
            has_sigma: sigma_mm.is_some().into(),
            gap_mm: measured.signed_gap_mm(),
            gap_variance_mm2: measured.covariance.map_or(0.0, |known| known.gap_mm2),
        }
    }
}

impl From<PixelPoint> for Pixel {
    fn from(pixel: PixelPoint) -> Self {
        Self {
            u_px: pixel.u,
            v_px: pixel.v,
        }
    }
}

impl From<Pixel> for PixelPoint {
    fn from(pixel: Pixel) -> Self {
        Self::new(pixel.u_px, pixel.v_px)
    }
}

impl From<Sighting> for (usize, PixelPoint) {
    fn from(sighting: Sighting) -> Self {
        sighting.of_rust()
    }
}

impl Sighting {
    pub(crate) const fn pixel(self) -> PixelPoint {
        PixelPoint::new(self.u_px, self.v_px)
    }

    pub(crate) const fn of_rust(self) -> (usize, PixelPoint) {
        (self.camera, self.pixel())
    }
}
