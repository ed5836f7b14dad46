//! What can be chosen in the detection.

/// Choices in the detection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectSettings {
    /// Half the largest window over which a corner's edges are taken as straight, px. Smaller
    /// squares have a window of half a square to each side.
    pub max_half_window_px: f64,
    /// Added in quadrature to the standard deviation that each fit predicts from its own residuals,
    /// for what all models of an edge leave out, px, where no image of the camera has corners enough to
    /// tell it ([`FittedGrid::sigma_px`](super::grid::FittedGrid::sigma_px)).
    pub sigma_floor_px: f64,
}

impl Default for DetectSettings {
    /// 20 px: on the `opencv-stereo` images (squares of 25 to 45 px) the held-out error of
    /// neighboring corners is 0.46 % of the square with 6 px, 0.44 % with 8 px, 0.41 % with 12 px
    /// and 0.40 % from 16 px on. The floor is the scatter that remains on images
    /// rendered through a fisheye whatever the noise.
    fn default() -> Self {
        Self {
            max_half_window_px: 20.0,
            sigma_floor_px: 0.02,
        }
    }
}
