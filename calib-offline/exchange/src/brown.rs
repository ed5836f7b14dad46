//! Brown's distortion with its rational part: what all pinholes have in common.

use nalgebra::{Matrix2, Vector2};

/// What Brown's formula makes of an ideal place.
pub(crate) struct Distorted {
    /// The place.
    pub at: Vector2<f64>,
    /// By the ideal place.
    pub slope: Matrix2<f64>,
    /// `g`.
    pub gain: f64,
    /// The denominator of `g`.
    pub under: f64,
}

/// Brown's formula, with the rational part, of `k1, k2, p1, p2, k3, k4, k5, k6`: see [`Lens`](crate::lens::Lens).
pub(crate) fn distort(x: f64, y: f64, coefficients: &[f64; 8]) -> Distorted {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = *coefficients;
    let s = x * x + y * y;
    let over = 1.0 + s * (k1 + s * (k2 + s * k3));
    let under = 1.0 + s * (k4 + s * (k5 + s * k6));
    let gain = over / under;
    // By s.
    let gain_slope =
        (k1 + s * (2.0 * k2 + s * 3.0 * k3) - gain * (k4 + s * (2.0 * k5 + s * 3.0 * k6))) / under;
    let mixed = 2.0 * (gain_slope * x * y + p1 * x + p2 * y);
    Distorted {
        at: Vector2::new(
            gain * x + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            gain * y + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        ),
        slope: Matrix2::new(
            gain + 2.0 * gain_slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            gain + 2.0 * gain_slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        ),
        gain,
        under,
    }
}
