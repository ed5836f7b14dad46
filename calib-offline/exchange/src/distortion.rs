//! Which coefficients a lens of another tool has.

/// Coefficients that a lens has at most.
pub(super) const MOST_COEFFICIENTS: usize = 14;

/// Which coefficients a lens has: of a pinhole the first ones of `k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Distortion {
    /// `k1, k2, p1, p2`: Kalibr's `radtan`.
    Four,
    /// And `k3`: Brown's, ROS' `plumb_bob`.
    Five,
    /// And `k4, k5, k6`: the rational one.
    Eight,
    /// And `s1, s2, s3, s4`: a thin prism.
    Twelve,
    /// And `tau_x, tau_y`: a tilted sensor.
    Fourteen,
    /// `k1, k2, k3, k4` of a fisheye, Kannala and Brandt's: no pinhole.
    Equidistant,
}

impl Distortion {
    /// Number of coefficients.
    pub const fn count(self) -> usize {
        match self {
            Self::Four | Self::Equidistant => 4,
            Self::Five => 5,
            Self::Eight => 8,
            Self::Twelve => 12,
            Self::Fourteen => 14,
        }
    }

    /// As `--model` calls it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Four => "pinhole4",
            Self::Five => "pinhole5",
            Self::Eight => "rational8",
            Self::Twelve => "prism12",
            Self::Fourteen => "tilted14",
            Self::Equidistant => "equidistant",
        }
    }

    /// Whether it is a fisheye, whose plane is the angle off axis.
    pub const fn is_fisheye(self) -> bool {
        matches!(self, Self::Equidistant)
    }
}
