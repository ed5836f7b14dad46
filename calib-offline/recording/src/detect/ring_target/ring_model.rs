//! What the image of a ring looks like: two blurred steps across ellipses, in light with a slope.
//!
//! [`super::ring_fit`] says why it is so and fits it.

use nalgebra::{Matrix2, SVector, Vector2};
use std::f64::consts::{FRAC_2_SQRT_PI, SQRT_2};

/// Beyond this many standard deviations of the blur an edge is flat to 1e-6.
const FLAT_BEYOND: f64 = 5.0;
pub(super) const COUNT: usize = 11;
pub(super) type Parameters = SVector<f64, COUNT>;
pub(super) const SHAPE: usize = 2;
pub(super) const RATIO: usize = 5;
pub(super) const AROUND: usize = 6;
pub(super) const PRINT: usize = 7;
pub(super) const SLOPE: usize = 8;
pub(super) const BLUR: usize = 10;

/// How far the middles of the edges' ellipses lie from the image of the ring's center, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeOffsets {
    /// Of the outer edge.
    pub outer: Vector2<f64>,
    /// Of the inner edge.
    pub inner: Vector2<f64>,
}

impl EdgeOffsets {
    /// No perspective.
    pub const NONE: Self = Self {
        outer: Vector2::new(0.0, 0.0),
        inner: Vector2::new(0.0, 0.0),
    };
}

/// u, v; shape (uu, uv, vv); ratio; brightness around and on the ring; slopes of the light along u
/// and v (per outer radius); blur.
#[derive(Debug, Clone, Copy)]
pub(super) struct RingModel(pub Parameters);

impl RingModel {
    pub fn center(&self) -> Vector2<f64> {
        Vector2::new(self.0[0], self.0[1])
    }

    pub fn shape(&self) -> Matrix2<f64> {
        Matrix2::new(
            self.0[SHAPE],
            self.0[SHAPE + 1],
            self.0[SHAPE + 1],
            self.0[SHAPE + 2],
        )
    }

    pub fn edges(&self, offsets: &EdgeOffsets) -> Option<RingEdges> {
        let shape = self.shape();
        let inverse = shape.try_inverse()?;
        let ratio = self.0[RATIO];
        Some(RingEdges {
            outer: Edge {
                center: self.center() + offsets.outer,
                inverse,
            },
            inner: (ratio > 0.0).then(|| Edge {
                center: self.center() + offsets.inner,
                inverse: inverse / ratio,
            }),
            center: self.center(),
            shape,
            ratio,
            radius_px: shape.determinant().abs().sqrt(),
            around: self.0[AROUND],
            print: self.0[PRINT],
            slope: Vector2::new(self.0[SLOPE], self.0[SLOPE + 1]),
            blur: self.0[BLUR],
        })
    }
}

/// One elliptic edge.
pub(super) struct Edge {
    pub center: Vector2<f64>,
    /// Maps the ellipse to the unit circle.
    inverse: Matrix2<f64>,
}

/// A point beside an edge.
#[derive(Clone, Copy)]
pub(super) struct Beside {
    /// Distance from the edge, positive inside, to first order, px.
    pub depth: f64,
    /// Outward normal of the edge.
    normal: Vector2<f64>,
    /// Where on the unit circle.
    on_circle: Vector2<f64>,
}

impl Edge {
    pub fn beside(&self, at: &Vector2<f64>) -> Beside {
        let w = self.inverse * (at - self.center);
        let radius = w.norm().max(1e-9);
        let gradient = self.inverse.transpose() * w / radius;
        let steepness = gradient.norm().max(1e-12);
        Beside {
            depth: (1.0 - radius) / steepness,
            normal: gradient / steepness,
            on_circle: w / radius,
        }
    }
}

/// A model, ready to be evaluated at many pixels.
pub(super) struct RingEdges {
    pub outer: Edge,
    /// `None` of a disk.
    pub inner: Option<Edge>,
    pub center: Vector2<f64>,
    pub shape: Matrix2<f64>,
    ratio: f64,
    radius_px: f64,
    around: f64,
    print: f64,
    slope: Vector2<f64>,
    pub blur: f64,
}

impl RingEdges {
    /// The model's value at a pixel and its derivatives by the parameters, exact at the edges and
    /// to first order beside them.
    pub fn value_and_gradient(&self, at: &Vector2<f64>) -> (f64, Parameters) {
        let outer = self.outer.beside(at);
        let (in_outer, by_outer) = blurred_step(outer.depth, self.blur);
        let inner = self.inner.as_ref().map(|edge| edge.beside(at));
        let (in_inner, by_inner) = inner
            .as_ref()
            .map_or((0.0, 0.0), |inner| blurred_step(inner.depth, self.blur));
        // Without a hole its derivatives are zero, and any place will do.
        let inner = inner.unwrap_or(outer);
        let share = in_outer - in_inner;
        let aside = (at - self.center) / self.radius_px;
        let light = 1.0 + self.slope.dot(&aside);
        let value = self.around + (self.print - self.around) * share;
        let by_share = light * (self.print - self.around);
        let (by_outer, by_inner) = (by_share * by_outer, -by_share * by_inner);
        // An edge that moves outward by n . x gains as much depth.
        let by_center = outer.normal * by_outer + inner.normal * by_inner;
        let by_shape = |beside: &Beside, scale: f64| {
            let (n, w) = (beside.normal * scale, beside.on_circle);
            [n.x * w.x, n.x * w.y + n.y * w.x, n.y * w.y]
        };
        let (a, b) = (
            by_shape(&outer, by_outer),
            by_shape(&inner, by_inner * self.ratio),
        );
        let gradient = Parameters::from([
            by_center.x,
            by_center.y,
            a[0] + b[0],
            a[1] + b[1],
            a[2] + b[2],
            by_inner * inner.normal.dot(&(self.shape * inner.on_circle)),
            light * (1.0 - share),
            light * share,
            aside.x * value,
            aside.y * value,
            -(by_outer * outer.depth + by_inner * inner.depth) / self.blur,
        ]);
        (light * value, gradient)
    }
}

/// `(1 + erf(n / (s sqrt 2))) / 2` and its derivative by n.
fn blurred_step(n: f64, blur: f64) -> (f64, f64) {
    if n.abs() > FLAT_BEYOND * blur {
        return (if n > 0.0 { 1.0 } else { 0.0 }, 0.0);
    }
    let x = n / (blur * SQRT_2);
    (
        f64::midpoint(1.0, libm::erf(x)),
        0.5 * FRAC_2_SQRT_PI / (blur * SQRT_2) * (-x * x).exp(),
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn truth() -> Parameters {
        Parameters::from([
            40.37, 39.81, 17.0, 2.0, 13.0, 0.5, 190.0, 40.0, 0.02, -0.01, 0.9,
        ])
    }

    pub fn offsets() -> EdgeOffsets {
        EdgeOffsets {
            outer: Vector2::new(0.2, -0.1),
            inner: Vector2::new(0.05, -0.025),
        }
    }

    #[test]
    fn derivatives_at_the_edges_agree_with_differences() {
        let edges = RingModel(truth()).edges(&offsets()).unwrap();
        for angle in [0.3_f64, 1.9, 4.4] {
            let circle = Vector2::new(angle.cos(), angle.sin());
            for at in [
                edges.outer.center + edges.shape * circle,
                edges.inner.as_ref().unwrap().center + edges.shape * circle * 0.5,
            ] {
                let value = |p| {
                    let edges = RingModel(p).edges(&offsets()).unwrap();
                    edges.value_and_gradient(&at).0
                };
                let (_, gradient) = edges.value_and_gradient(&at);
                for k in 0..COUNT {
                    let mut step = Parameters::zeros();
                    step[k] = 1e-5;
                    let difference = (value(truth() + step) - value(truth() - step)) / 2e-5;
                    // The slopes are measured in outer radii, whose own change is left out: it is
                    // a hundredth of the light's.
                    let tolerance = if k < RATIO { 0.2 } else { 1e-5 };
                    assert!(
                        (gradient[k] - difference).abs() < tolerance,
                        "parameter {k}: {} {difference}",
                        gradient[k]
                    );
                }
            }
        }
    }
}
