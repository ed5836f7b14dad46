//! The metadata of a blob: messages of postcard.

use serde::{Deserialize, Serialize};

/// First message of the metadata; a [`CameraMeta`] for each camera and the [`SelfTest`]s follow it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Meta<'a> {
    /// First 16 bytes of a hash that identifies the calibration.
    pub identity: &'a [u8],
    /// The frame of rays and points, in words.
    pub frame: &'a str,
    /// Program and version that wrote the blob.
    pub written_by: &'a str,
    /// Where (0, 0) is.
    pub pixel_convention: PixelConvention,
    /// Unit of lengths.
    pub length_unit: LengthUnit,
    /// No pixel in the calibrated area is further than this from the field that was packed, px.
    pub max_error_px: f32,
    /// The distance at which a ray's offset was turned into pixels for that bound, mm.
    pub working_distance_mm: f32,
    /// How many [`SelfTest`]s there are.
    pub self_test_count: u16,
}

/// Where pixel coordinates have their zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PixelConvention {
    /// The center of the sensor's top-left pixel is (0, 0); u points right, v down.
    TopLeftPixelCenter,
}

/// Unit of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum LengthUnit {
    /// Millimeters.
    Millimeter,
}

/// What is to be known of a camera besides its [`Record`](super::Record).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraMeta<'a> {
    /// Unique in the blob, not empty.
    pub name: &'a str,
    /// Columns of the sensor, px.
    pub sensor_width: u32,
    /// Rows of the sensor, px.
    pub sensor_height: u32,
    /// First column of the calibrated region, px. Pixel coordinates stay those of the sensor.
    pub region_u: u32,
    /// First row of the calibrated region, px.
    pub region_v: u32,
    /// Columns of the calibrated region, px.
    pub region_width: u32,
    /// Rows of the calibrated region, px.
    pub region_height: u32,
}

/// A question with the bits of its answer, so that a device can check itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SelfTest {
    /// A pixel and its ray.
    Ray {
        /// Index of the camera.
        camera: u16,
        /// (u, v), px.
        pixel: [f32; 2],
        /// Origin in the rig frame, mm.
        origin_mm: [f32; 3],
        /// Direction in the rig frame.
        direction: [f32; 3],
    },
    /// A match and its point.
    Pair {
        /// Indices of the two cameras.
        cameras: [u16; 2],
        /// (u, v) in each, px.
        pixels: [[f32; 2]; 2],
        /// The point in the rig frame, mm.
        point_mm: [f32; 3],
        /// Square of the gap, mm2.
        gap_squared_mm2: f32,
    },
    /// A match and the standard deviations of its point, of a pair whose uncertainty is known.
    Sigma {
        /// Indices of the two cameras.
        cameras: [u16; 2],
        /// (u, v) in each, px.
        pixels: [[f32; 2]; 2],
        /// Along x, y and z of the rig frame, mm.
        sigma_mm: [f32; 3],
    },
}
