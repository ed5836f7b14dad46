//! What a sensor delivers, mapped to the pixels of the calibration.

use crate::{Camera, PixelPoint, ReadoutError};

/// What of a sensor is read out: a region of interest, and how many pixels are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Readout {
    /// Columns and rows of the whole sensor, px.
    pub sensor: [u32; 2],
    /// First column and row of the region, sensor pixels.
    pub first: [u32; 2],
    /// Columns and rows of the image: pixels after binning.
    pub image: [u32; 2],
    /// Sensor pixels joined along u and v; 1 is none.
    pub binning: [u32; 2],
}

/// Maps between the pixels of an image that was read in part or binned and those of the sensor.
///
/// The center of the image's top-left pixel is (0, 0): that of the first `binning` sensor pixels. A
/// smaller sensor, or one whose driver scales the image, is another camera: it needs a calibration of
/// its own.
// As C sees it, six numbers: the C interface passes it by value.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorWindow {
    /// Sensor coordinates of the image's pixel (0, 0), px.
    origin_px: [f32; 2],
    /// Sensor pixels per image pixel, and the inverse.
    binning: [f32; 2],
    per_binning: [f32; 2],
}

impl SensorWindow {
    /// The map for a camera's readout.
    ///
    /// # Errors
    /// [`ReadoutError::WrongSensor`] if the camera was calibrated on a sensor of another size,
    /// [`ReadoutError::NotOnSensor`] if the region is empty or not on the sensor.
    pub fn new(camera: &Camera<'_>, readout: &Readout) -> Result<Self, ReadoutError> {
        let calibrated = [camera.sensor_width, camera.sensor_height];
        if calibrated != readout.sensor {
            return Err(ReadoutError::WrongSensor {
                calibrated,
                found: readout.sensor,
            });
        }
        let mut window = Self {
            origin_px: [0.0; 2],
            binning: [1.0; 2],
            per_binning: [1.0; 2],
        };
        let axes = readout.first.into_iter().zip(readout.image);
        let axes = axes.zip(readout.binning).zip(readout.sensor);
        let numbers = window.origin_px.iter_mut().zip(&mut window.binning);
        for (((axis, sensor), (origin_px, binning)), per_binning) in
            axes.zip(numbers).zip(&mut window.per_binning)
        {
            let ((first, image), joined) = axis;
            let end = u64::from(image) * u64::from(joined) + u64::from(first);
            if image == 0 || joined == 0 || end > u64::from(sensor) {
                return Err(ReadoutError::NotOnSensor);
            }
            *binning = joined as f32;
            *per_binning = 1.0 / *binning;
            *origin_px = first as f32 + 0.5 * *binning - 0.5;
        }
        Ok(window)
    }

    /// The sensor's pixel at a pixel of the image.
    pub fn to_sensor(&self, image: PixelPoint) -> PixelPoint {
        let [u, v] = self.origin_px;
        PixelPoint::new(u + image.u * self.binning[0], v + image.v * self.binning[1])
    }

    /// The image's pixel at a pixel of the sensor.
    pub fn from_sensor(&self, sensor: PixelPoint) -> PixelPoint {
        let [u, v] = self.origin_px;
        PixelPoint::new(
            (sensor.u - u) * self.per_binning[0],
            (sensor.v - v) * self.per_binning[1],
        )
    }
}
