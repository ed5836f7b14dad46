//! A camera after something has happened to it: another focus, another window of its sensor, pixels
//! put together.

use super::camera::CameraOptics;
use super::lens::{Bump, FisheyeLens, Lens, PerspectiveLens, TelecentricLens};
use calib_rays::geometry::{PixelPoint, SensorSize};

impl CameraOptics {
    /// Its image `factor` times as large about the principal point.
    pub fn refocused(&self, factor: f64) -> Self {
        let lens = match self.lens().clone() {
            Lens::Perspective(lens) => Lens::Perspective(PerspectiveLens {
                focal_px: lens.focal_px.map(|focal| focal * factor),
                ..lens
            }),
            Lens::Fisheye(lens) => Lens::Fisheye(FisheyeLens {
                focal_px: lens.focal_px * factor,
                ..lens
            }),
            Lens::Telecentric(lens) => Lens::Telecentric(TelecentricLens {
                mm_per_px: lens.mm_per_px / factor,
                ..lens
            }),
        };
        Self::new(self.sensor(), lens, self.media().clone())
    }

    /// Read out from a window that begins `by_px` to the right and below.
    pub fn window_moved(&self, by_px: [f64; 2]) -> Self {
        let moved = |pixel: PixelPoint| PixelPoint::new(pixel.u - by_px[0], pixel.v - by_px[1]);
        let lens = in_pixels(self.lens(), 1.0, moved);
        Self::new(self.sensor(), lens, self.media().clone())
    }

    /// Two by two pixels made one; (0, 0) is the center of the first one again.
    pub fn half_size(&self) -> Self {
        let halved = |pixel: PixelPoint| {
            PixelPoint::new((pixel.u + 0.5) / 2.0 - 0.5, (pixel.v + 0.5) / 2.0 - 0.5)
        };
        let SensorSize { width, height } = self.sensor();
        Self::new(
            SensorSize::new(width / 2, height / 2),
            in_pixels(self.lens(), 0.5, halved),
            self.media().clone(),
        )
    }
}

/// A lens in other pixels: where a place lies, and how many of them a pixel is long.
fn in_pixels(lens: &Lens, scale: f64, place: impl Fn(PixelPoint) -> PixelPoint) -> Lens {
    match lens.clone() {
        Lens::Perspective(lens) => Lens::Perspective(PerspectiveLens {
            focal_px: lens.focal_px.map(|focal| focal * scale),
            principal: place(lens.principal),
            bumps: lens
                .bumps
                .iter()
                .map(|bump| Bump {
                    center: place(bump.center),
                    amplitude_px: bump.amplitude_px.map(|amplitude| amplitude * scale),
                    width_px: bump.width_px * scale,
                })
                .collect(),
            distortion: lens.distortion,
        }),
        Lens::Fisheye(lens) => Lens::Fisheye(FisheyeLens {
            focal_px: lens.focal_px * scale,
            principal: place(lens.principal),
            ..lens
        }),
        Lens::Telecentric(lens) => Lens::Telecentric(TelecentricLens {
            mm_per_px: lens.mm_per_px / scale,
            principal: place(lens.principal),
            ..lens
        }),
    }
}
