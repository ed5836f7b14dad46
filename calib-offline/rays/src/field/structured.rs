//! The polynomial directions a lens is expected to use, and the rest by degree.
//!
//! A free polynomial of degree 7 has 72 coefficients; few views cannot hold them all. So its space
//! is split (METHOD 2.1, 9A): what a rotationally symmetric lens does, which is free (focal length,
//! three radial terms, shift of its center); what a plain lens has besides, held by one weak prior
//! (aspect, skew, decentering, tilt of the sensor); and for each degree the remaining directions,
//! which a smoothness weight holds back as far as the evidence asks for it. All directions are orthonormal over the sensor, so a coefficient is the RMS
//! change of the half-angle vector that it makes.

use super::base_lens::BaseLens;
use super::lattice::Lattice;
use super::polynomial::{self, Polynomial};
use crate::geometry::{PixelPoint, SensorSize};
use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};
use std::ops::RangeInclusive;

/// Directions of the first kind that rotate the camera frame (two shifts of the center's
/// direction, one turn about the axis): they are held, as poses and extrinsics can do the same.
const GAUGE_DIRECTIONS: usize = 3;
const GAUGE: [fn(f64, f64) -> Vector2<f64>; GAUGE_DIRECTIONS] = [
    |_, _| Vector2::new(1.0, 0.0),
    |_, _| Vector2::new(0.0, 1.0),
    |x, _| Vector2::new(0.0, x),
];

/// Degrees of an offset field up to this share one smoothness weight.
pub const OFFSET_CORE_DEGREE: usize = 3;

/// The tag of what a pinhole with decentering has beyond a rotationally symmetric lens: aspect and
/// decentering, under one prior.
pub const PLAIN_DEGREE: usize = 1;
/// The tag of skew and tilt, which a pinhole has not, under another. Before the center of a lens is
/// known they are among those of [`PLAIN_DEGREE`], as a tilt is what its shift does.
pub const TILT_DEGREE: usize = 0;

/// Half-angle vectors of a lens whose decentering is that of its tangents are shorter than the root
/// of this: 60 degrees off axis.
const NARROW_SQUARED: f64 = 4.0 / 3.0;

/// A basis of the polynomial part of a direction field.
#[derive(Debug, Clone)]
pub struct StructuredBasis {
    /// Total degree of the underlying Legendre products.
    pub degree: usize,
    /// Columns: directions in Legendre coefficients, `2 k + component`.
    coefficients: DMatrix<f64>,
    /// Rows: the linear form that reads a direction's amount from Legendre coefficients.
    dual: DMatrix<f64>,
    /// Per direction: `None` if free, else the degree whose smoothness weight holds it.
    penalized_degree: Vec<Option<usize>>,
}

impl StructuredBasis {
    /// The basis over a sensor. Radial terms are about its middle, or about the center of a `lens`
    /// that is known well; then the two directions that shift the lens are free too.
    pub fn new(sensor: SensorSize, degree: usize, lens: Option<&BaseLens>) -> Self {
        let lattice = Lattice::new(sensor, degree);
        let mut builder = Builder::new(&lattice);
        // The gauge first, so that it can be cut off; then what a rotationally symmetric lens does.
        let focus: fn(f64, f64) -> Vector2<f64> = |x, y| Vector2::new(x, y);
        let sheared: [fn(f64, f64) -> Vector2<f64>; 2] =
            [|x, _| Vector2::new(x, 0.0), |_, y| Vector2::new(y, 0.0)];
        let beyond = lens.map_or(PLAIN_DEGREE, |_| TILT_DEGREE);
        let tags = [PLAIN_DEGREE, PLAIN_DEGREE, beyond, beyond];
        let half_width_px = f64::from(sensor.width) / 2.0;
        let center = lens.map_or(Vector2::zeros(), |lens| center_in_half_widths(sensor, lens));
        // A small shift in the image, seen through the lens that is there.
        let through = |x: f64, y: f64, shift: Vector2<f64>| match lens {
            Some(lens) => {
                let at = Vector2::new(x, y) * half_width_px;
                lens.evaluate(&at).1 * shift * half_width_px
            }
            None => shift,
        };
        for f in GAUGE.into_iter().chain([focus]) {
            builder.add(&lattice.project(f), None);
        }
        builder.add_radial(degree, &center);
        let decentering: [fn(f64, f64) -> Vector2<f64>; 4] = [
            |x, y| Vector2::new(3.0 * x * x + y * y, 2.0 * x * y),
            |x, y| Vector2::new(2.0 * x * y, x * x + 3.0 * y * y),
            |x, y| Vector2::new(x * x, x * y),
            |x, y| Vector2::new(x * y, y * y),
        ];
        for axis in 0..2 {
            if let Some(lens) = lens {
                builder.add(&lattice.shift(lens, half_width_px, axis), None);
            }
        }
        for (f, tag) in sheared.iter().zip([PLAIN_DEGREE, beyond]) {
            let image_side = |x: f64, y: f64| through(x, y, f(x - center.x, y - center.y));
            builder.add(&lattice.project(image_side), Some(tag));
        }
        let is_narrow = lens.is_some_and(|lens| {
            let at = |p: &Vector2<f64>| lens.evaluate(&(p * half_width_px)).0.norm_squared();
            lattice.nodes.iter().all(|p| at(p) < NARROW_SQUARED)
        });
        for (f, tag) in decentering.iter().zip(tags) {
            let undistorted = |x: f64, y: f64| match lens {
                // The tangent of the angle.
                Some(lens) if is_narrow => {
                    let s = lens.evaluate(&(Vector2::new(x, y) * half_width_px)).0;
                    s / (1.0 - s.norm_squared() / 4.0)
                }
                _ => Vector2::new(x, y) - center,
            };
            let decentered = |x: f64, y: f64| {
                let t = undistorted(x, y);
                through(x, y, f(t.x, t.y))
            };
            builder.add(&lattice.project(decentered), Some(tag));
        }
        builder.add_degrees(2..=degree, degree, |total| total);
        builder.finish(degree, GAUGE_DIRECTIONS)
    }

    /// The basis of a lens that has a few numbers and may do nothing else: `at` gives the half-angle
    /// vector of a pixel, and its derivative by each number, in the order of `tags`. What a number
    /// turns is taken back by a turn of the camera's frame, as poses and extrinsics can do the same.
    ///
    /// `None` if too little of the sensor sees anything, or if the numbers' effects are not finite.
    pub fn of_lens<const N: usize>(
        sensor: SensorSize,
        degree: usize,
        tags: [Option<usize>; N],
        at: impl Fn(PixelPoint) -> Option<(Vector2<f64>, [Vector2<f64>; N])>,
    ) -> Option<Self> {
        let (lattice, numbers) = Lattice::seen(sensor, degree, at)?;
        let sums = |values: &dyn Fn(usize) -> Vector2<f64>| -> Vector3<f64> {
            let all = lattice.nodes.iter().enumerate();
            all.map(|(n, node)| (values(n), node.x))
                .map(|(v, x)| Vector3::new(v.x, v.y, x * v.y))
                .sum()
        };
        let turned = |n: usize, axis: usize| {
            let s: Vector2<f64> = numbers[n].0;
            if axis == 2 {
                return Vector2::new(-s.y, s.x);
            }
            let mut by_turn = s * (s[axis] / 2.0);
            by_turn[axis] += 1.0 - s.norm_squared() / 4.0;
            by_turn
        };
        let by_turns = [0, 1, 2].map(|axis| sums(&|n| turned(n, axis)));
        let by_turns = Matrix3::from_columns(&by_turns).try_inverse()?;
        let mut builder = Builder::new(&lattice);
        for f in GAUGE {
            builder.add(&lattice.project(f), None);
        }
        for (k, tag) in tags.into_iter().enumerate() {
            let back = by_turns * sums(&|n| numbers[n].1[k]);
            let values: Vec<Vector2<f64>> = (0..numbers.len())
                .map(|n| {
                    let turns = (0..3).map(|axis| turned(n, axis) * back[axis]);
                    numbers[n].1[k] - turns.sum::<Vector2<f64>>()
                })
                .collect();
            builder.add(&lattice.project_values(&values), tag);
        }
        let basis = builder.finish(degree, GAUGE_DIRECTIONS);
        basis
            .coefficients
            .iter()
            .all(|c| c.is_finite())
            .then_some(basis)
    }

    /// Whether a lens has all that there is, and no degree of the polynomial is its own.
    pub fn is_lens_alone(&self) -> bool {
        self.penalized_degree
            .iter()
            .all(|degree| degree.is_none_or(|degree| degree <= PLAIN_DEGREE))
    }

    /// The basis of an offset field, mm, over a sensor: everything up to [`OFFSET_CORE_DEGREE`] as
    /// one; the radial terms `r^2k (x, y)` beyond it, k = 2 and 3, about the center of the lens, by
    /// which a pupil moves with the angle (tagged `None`); the rest by degree. Nothing is cut off.
    pub fn offset(sensor: SensorSize, degree: usize, lens: &BaseLens) -> Self {
        let lattice = Lattice::new(sensor, degree);
        let mut builder = Builder::new(&lattice);
        builder.add_degrees(0..=OFFSET_CORE_DEGREE.min(degree), degree, |_| {
            OFFSET_CORE_DEGREE
        });
        builder.add_radial(degree, &center_in_half_widths(sensor, lens));
        builder.add_degrees(OFFSET_CORE_DEGREE + 1..=degree, degree, |total| total);
        builder.finish(degree, 0)
    }

    /// Number of directions.
    pub fn len(&self) -> usize {
        self.penalized_degree.len()
    }

    /// Whether there is no direction at all.
    pub fn is_empty(&self) -> bool {
        self.penalized_degree.is_empty()
    }

    /// Per direction: the degree whose smoothness weight holds it, `None` if it is free.
    pub fn penalized_degrees(&self) -> &[Option<usize>] {
        &self.penalized_degree
    }

    /// Legendre coefficients (`2 k + component`, rows) per direction (columns).
    pub fn coefficients(&self) -> &DMatrix<f64> {
        &self.coefficients
    }

    /// How much of each direction a polynomial holds.
    pub fn amounts(&self, polynomial: &Polynomial) -> DVector<f64> {
        let flat = DVector::from_iterator(
            2 * polynomial.coefficients.len(),
            polynomial.coefficients.iter().flat_map(|c| [c.x, c.y]),
        );
        &self.dual * flat
    }

    /// Adds the given amount of each direction to a polynomial of the same degree.
    pub fn add_to(&self, amounts: &DVector<f64>, polynomial: &mut Polynomial) {
        let change = &self.coefficients * amounts;
        for (k, c) in polynomial.coefficients.iter_mut().enumerate() {
            c.x += change[2 * k];
            c.y += change[2 * k + 1];
        }
    }
}

fn center_in_half_widths(sensor: SensorSize, lens: &BaseLens) -> Vector2<f64> {
    Vector2::from(lens.center_px) / (f64::from(sensor.width) / 2.0)
}

/// Gram-Schmidt in coordinates where the sensor's inner product is Euclidean.
struct Builder<'a> {
    lattice: &'a Lattice,
    orthonormal: Vec<DVector<f64>>,
    penalized_degree: Vec<Option<usize>>,
}

impl<'a> Builder<'a> {
    fn new(lattice: &'a Lattice) -> Self {
        Self {
            lattice,
            orthonormal: Vec::new(),
            penalized_degree: Vec::new(),
        }
    }

    /// Adds what a direction has beyond those already there, if anything.
    fn add(&mut self, legendre: &DVector<f64>, penalized_degree: Option<usize>) {
        let mut rest = Lattice::per_component(&self.lattice.factor, legendre);
        let original = rest.norm();
        // Twice is enough for orthogonality to round-off.
        for _ in 0..2 {
            for q in &self.orthonormal {
                let along = q.dot(&rest);
                rest.axpy(-along, q, 1.0);
            }
        }
        let length = rest.norm();
        // Below this the direction is already spanned and the rest is round-off.
        if length > 1e-7 * original {
            self.orthonormal.push(rest / length);
            self.penalized_degree.push(penalized_degree);
        }
    }

    /// The radial terms that fit into a degree, free.
    fn add_radial(&mut self, degree: usize, center: &Vector2<f64>) {
        for k in (1..=3).filter(|k| 2 * k < degree) {
            let term = self.lattice.project(|x, y| {
                let p = Vector2::new(x, y) - center;
                p * p.norm_squared().powi(k as i32)
            });
            self.add(&term, None);
        }
    }

    /// Every Legendre product of some total degrees, under the weight that `tag` names.
    fn add_degrees(
        &mut self,
        totals: RangeInclusive<usize>,
        degree: usize,
        tag: fn(usize) -> usize,
    ) {
        let terms: Vec<(usize, usize)> = polynomial::terms(degree).collect();
        for total in totals {
            let of_total = terms
                .iter()
                .enumerate()
                .filter(|(_, (i, j))| i + j == total);
            for (k, _) in of_total {
                for component in 0..2 {
                    let mut single = DVector::zeros(2 * terms.len());
                    single[2 * k + component] = 1.0;
                    self.add(&single, Some(tag(total)));
                }
            }
        }
    }

    /// The basis without the first `cut` directions.
    fn finish(self, degree: usize, cut: usize) -> StructuredBasis {
        let kept = &self.orthonormal[cut..];
        let rows = 2 * polynomial::term_count(degree);
        let mut coefficients = DMatrix::zeros(rows, kept.len());
        let mut dual = DMatrix::zeros(kept.len(), rows);
        for (k, q) in kept.iter().enumerate() {
            let column = Lattice::per_component(&self.lattice.factor_inverse, q);
            coefficients.set_column(k, &column);
            let form = Lattice::per_component(&self.lattice.factor.transpose(), q);
            dual.set_row(k, &form.transpose());
        }
        StructuredBasis {
            degree,
            coefficients,
            dual,
            penalized_degree: self.penalized_degree[cut..].to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::lattice::lattice_nodes;
    use crate::field::{Projection, transport};
    use crate::geometry::so3;
    use nalgebra::Vector3;

    const SENSOR: SensorSize = SensorSize::new(640, 480);

    #[test]
    fn directions_span_everything_but_the_gauge() {
        for degree in [3, 5, 7] {
            let basis = StructuredBasis::new(SENSOR, degree, None);
            let wanted = 2 * polynomial::term_count(degree) - GAUGE_DIRECTIONS;
            assert_eq!(basis.len(), wanted, "degree {degree}");
            let free = basis
                .penalized_degrees()
                .iter()
                .filter(|d| d.is_none())
                .count();
            // The focal length, and the radial terms that fit.
            assert_eq!(free, 1 + (degree - 1) / 2, "degree {degree}");
        }
    }

    #[test]
    fn amounts_read_back_what_was_added() {
        let basis = StructuredBasis::new(SENSOR, 7, None);
        let amounts = DVector::from_fn(basis.len(), |k, _| (k as f64 * 1.3).sin());
        let mut polynomial = Polynomial::zero(7);
        basis.add_to(&amounts, &mut polynomial);
        assert!((basis.amounts(&polynomial) - amounts).norm() < 1e-11);
    }

    #[test]
    fn an_amount_is_the_rms_over_the_sensor() {
        let basis = StructuredBasis::new(SENSOR, 7, None);
        let mut amounts = DVector::zeros(basis.len());
        amounts[17] = 0.25;
        let mut polynomial = Polynomial::zero(7);
        basis.add_to(&amounts, &mut polynomial);
        let (mut sum, mut count) = (0.0, 0.0);
        for (pixel, _) in lattice_nodes(SENSOR) {
            sum += polynomial.evaluate(SENSOR, pixel).0.norm_squared();
            count += 1.0;
        }
        assert!((f64::sqrt(sum / count) - 0.25).abs() < 1e-10);
    }

    #[test]
    fn radial_distortion_costs_no_penalized_direction() {
        let basis = StructuredBasis::new(SENSOR, 7, None);
        let lattice = Lattice::new(SENSOR, 7);
        let radial = lattice.project(|x, y| {
            let r2 = x * x + y * y;
            Vector2::new(x, y) * (1.0 - 0.2 * r2 + 0.05 * r2 * r2 - 0.01 * r2 * r2 * r2)
        });
        let polynomial = Polynomial {
            degree: 7,
            coefficients: (0..36)
                .map(|k| Vector2::new(radial[2 * k], radial[2 * k + 1]))
                .collect(),
        };
        let amounts = basis.amounts(&polynomial);
        for (amount, penalized) in amounts.iter().zip(basis.penalized_degrees()) {
            assert!(penalized.is_none() || amount.abs() < 1e-12);
        }
    }

    #[test]
    fn a_shift_of_a_lens_with_its_turn_is_free_to_first_order() {
        let lens = BaseLens {
            center_px: [14.0, -8.0],
            radial: [0.1, -0.03, 0.01, 0.0],
            reach: 1.7,
            ..BaseLens::ideal(Projection::Equidistant, 450.0)
        };
        let basis = StructuredBasis::new(SENSOR, 7, Some(&lens));
        let free = basis.penalized_degrees().iter().filter(|d| d.is_none());
        assert_eq!(free.count(), 6);
        let lattice = Lattice::new(SENSOR, 7);
        for axis in 0..2 {
            let mut step = Vector2::zeros();
            step[axis] = 1e-3;
            // The frame turns about the other axis, as far as leaves no constant.
            let axis_of_turn = if axis == 0 {
                Vector3::y()
            } else {
                -Vector3::x()
            };
            let at = |x: f64, y: f64, sign: f64, turn: f64| {
                let shifted = Vector2::new(x, y) * 320.0 + step * sign;
                let direction = transport::direction(&lens.evaluate(&shifted).0);
                let turned = so3::exp(&(axis_of_turn * turn * sign)) * direction;
                transport::half_angle(&turned).unwrap()
            };
            let constant = |turn: f64| {
                let moved = |p: &Vector2<f64>| at(p.x, p.y, 1.0, turn) - at(p.x, p.y, -1.0, turn);
                lattice.nodes.iter().map(|p| moved(p)[axis]).sum::<f64>()
            };
            let (still, per_turn) = (constant(0.0), (constant(1e-6) - constant(0.0)) / 1e-6);
            let turn = -still / per_turn;
            let shift = lattice.project(|x, y| (at(x, y, 1.0, turn) - at(x, y, -1.0, turn)) * 1e3);
            let terms = polynomial::term_count(7);
            let polynomial = Polynomial {
                degree: 7,
                coefficients: (0..terms)
                    .map(|k| Vector2::new(shift[2 * k], shift[2 * k + 1]))
                    .collect(),
            };
            let amounts = basis.amounts(&polynomial);
            for (amount, penalized) in amounts.iter().zip(basis.penalized_degrees()) {
                assert!(penalized.is_none() || amount.abs() < 1e-8 * amounts.norm());
            }
        }
    }
}
