//! How noisy the pixels of matches are.

/// Standard deviation of each pixel coordinate of a match, px, the same in all directions and cameras.
///
/// A matcher is no corner finder: what the calibration knows of its corners' noise says nothing of it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MatchNoise {
    px: f32,
}

impl MatchNoise {
    /// The most, px.
    pub const MOST_PX: f32 = 1000.0;
    /// The least above none at all, px: its square is still far above the smallest number of full
    /// precision, so that a target which takes those below for zero gives the same bits.
    pub const LEAST_PX: f32 = 1e-6;

    /// No noise leaves what the calibration itself leaves uncertain.
    pub const NONE: Self = Self { px: 0.0 };

    /// `None` unless it is 0 or from [`LEAST_PX`](Self::LEAST_PX) to [`MOST_PX`](Self::MOST_PX).
    pub fn from_px(px: f32) -> Option<Self> {
        // NaN is in no range.
        let is_noise = px == 0.0 || (Self::LEAST_PX..=Self::MOST_PX).contains(&px);
        is_noise.then_some(Self { px: px.abs() })
    }

    /// Standard deviation of a coordinate, px.
    pub const fn px(self) -> f32 {
        self.px
    }

    /// Its variance, px^2.
    pub(crate) fn px2(self) -> f32 {
        self.px * self.px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_noise_is_none() {
        for px in [0.0, -0.0, 1e-6, 0.05, 1000.0] {
            assert_eq!(MatchNoise::from_px(px).map(MatchNoise::px), Some(px));
        }
        for px in [-0.05, 1e-7, 1000.1, f32::NAN, f32::INFINITY] {
            assert_eq!(MatchNoise::from_px(px), None);
        }
        assert!(MatchNoise::from_px(-0.0).is_some_and(|noise| noise.px().is_sign_positive()));
        assert_eq!(MatchNoise::from_px(0.5).map(MatchNoise::px2), Some(0.25));
    }
}
