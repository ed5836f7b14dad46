//! Where a ring is, to a hundredth of a pixel: its two blurred edges fitted to the image.
//!
//! The image is modelled as `(1 + g . d) (b + (r - b) S)`: b, r the brightness around and on the ring,
//! g a slope of the light over the distance d from the middle, and S how much of a pixel's
//! surroundings lies on the ring: the difference of two steps across ellipses, blurred by a Gaussian.
//! Both ellipses have one shape but for their size. Eleven unknowns (center, shape, inner against
//! outer radius, two levels, two slopes, blur) are found by least squares over all pixels near the
//! edges. The slope matters: light that changes by 0.5 % over a ring moves both of its sides
//! the same way.
//!
//! Under perspective the center of a circle's image is not the image of its center, and two
//! concentric circles have images with two centers. [`EdgeOffsets`] says by how much each edge lies
//! aside, so that the fitted center is the image of the circles' own ([`super::perspective`]). A disk is a
//! ring whose ratio is held at zero.

use super::candidates::{RingGuess, square_root};
use super::components::Polarity;
use super::ring_model::{
    AROUND, BLUR, COUNT, Edge, EdgeOffsets, PRINT, Parameters, RATIO, RingModel,
};
use crate::dataset::image::GrayImage;
use crate::detect::edge_fit::{Fitted, Limits, NormalEquations, Range, fit};
use calib_rays::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2};

/// Only pixels this near to an edge are looked at, px; a blur of a quarter of it needs more.
const BAND_PX: f64 = 8.0;
/// Standard deviations of the blur to either side of an edge that the band has at least.
const BAND_BLURS: f64 = 4.0;
/// Windows with fewer pixels do not determine eleven unknowns well.
const MIN_PIXELS: usize = 40;
/// The window follows the ring: fitted a second time if the first result lies farther away than
/// this, px, or is blurred so much that the band was too narrow.
const SAME_WINDOW_PX: f64 = 0.5;
const ROUNDS: usize = 2;
/// A step of all lengths below so many pixels ends the iteration: what is left after it is its square, far below what
/// noise does.
const LIMITS: Limits = Limits {
    iterations: 30,
    step: 1e-3,
    placing: 5,
};
/// Blur is kept between these bounds while iterating, px.
const BLUR_RANGE_PX: (f64, f64) = (0.1, 20.0);
/// And the ratio of the radii between these.
const RATIO_RANGE: (f64, f64) = (0.05, 0.97);
/// Rings whose fit leaves more than this part of their contrast (RMS) are none.
const MAX_RESIDUAL: f64 = 0.12;
/// The fit must stay this near to the guess, as a part of its radius.
const MAX_MOVE: f64 = 0.4;

/// A fitted ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedRing {
    /// The image of its center, as far as the offsets given say; without them, the middle of its
    /// edges.
    pub pixel: PixelPoint,
    /// Symmetric; maps the unit circle to the outer edge, px.
    pub shape: Matrix2<f64>,
    /// Inner against outer radius; 0 of a disk.
    pub ratio: f64,
    /// Standard deviation per axis that the residuals of this fit predict, px.
    pub sigma_px: f64,
    /// Brightness of the ring less that around it, code values: negative for dark rings.
    pub contrast: f64,
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// RMS of the residuals, code values.
    pub residual_rms: f64,
}

impl FittedRing {
    /// Radius of the circle with the outer edge's area, px.
    pub fn mean_radius_px(&self) -> f64 {
        self.shape.determinant().abs().sqrt()
    }

    /// The ring as a guess for another fit.
    pub fn as_guess(&self) -> RingGuess {
        RingGuess {
            center: Vector2::new(self.pixel.u, self.pixel.v),
            shape: self.shape,
            ratio: self.ratio,
            polarity: if self.contrast < 0.0 {
                Polarity::Dark
            } else {
                Polarity::Bright
            },
        }
    }

    /// Fits a ring; `None` if the guess is not wholly in the image or no such ring is there.
    ///
    /// `reach` bounds the window: pixels up to so many outer radii from the middle, which must end
    /// before the next marker begins.
    pub fn fit(
        image: &GrayImage,
        guess: &RingGuess,
        offsets: &EdgeOffsets,
        reach: f64,
    ) -> Option<Self> {
        let mut model = RingModel::start(image, guess, reach)?;
        let mut outcome = None;
        for _ in 0..ROUNDS {
            let window = Window::around(image, &model, offsets, reach)?;
            let solved = window.solve(model, offsets)?;
            let before = model.center();
            model = RingModel(solved.unknowns);
            let moved = (model.center() - before).norm();
            if (model.center() - guess.center).norm() > MAX_MOVE * guess.mean_radius_px() {
                return None;
            }
            outcome = Some(solved);
            if moved < SAME_WINDOW_PX && BAND_BLURS * model.0[BLUR] <= BAND_PX {
                break;
            }
        }
        let Fitted {
            covariance,
            residual_rms,
            ..
        } = outcome?;
        let fitted = Self {
            pixel: PixelPoint::new(model.0[0], model.0[1]),
            shape: model.shape(),
            ratio: model.0[RATIO],
            sigma_px: f64::midpoint(covariance[(0, 0)], covariance[(1, 1)]).sqrt(),
            contrast: model.0[PRINT] - model.0[AROUND],
            blur_px: model.0[BLUR],
            residual_rms,
        };
        let right_sign = (fitted.contrast < 0.0) == (guess.polarity == Polarity::Dark);
        let inside = guess.ratio == 0.0
            || (RATIO_RANGE.0 + 0.01..RATIO_RANGE.1 - 0.01).contains(&fitted.ratio);
        let is_ring = right_sign
            && inside
            && residual_rms < MAX_RESIDUAL * fitted.contrast.abs()
            && fitted.sigma_px.is_finite();
        is_ring.then_some(fitted)
    }
}

impl RingModel {
    /// The guess, with the mean levels between its edges and beside them.
    fn start(image: &GrayImage, guess: &RingGuess, reach: f64) -> Option<Self> {
        let inverse = guess.shape.try_inverse()?;
        let between = 1.0 - guess.ratio;
        // Beside the ring begins here, unless the window ends soon after.
        let beside = (1.0 + 0.25 * between).min(f64::midpoint(1.0, reach));
        let (mut print, mut around) = ((0.0, 0.0), (0.0, 0.0));
        for (at, value) in pixels_around(image, &guess.center, &guess.shape, reach)? {
            let radius = (inverse * (at - guess.center)).norm();
            let depth = (radius - guess.ratio) / between;
            if (0.25..0.75).contains(&depth) {
                print = (print.0 + value, print.1 + 1.0);
            } else if depth < -0.25 || radius >= beside {
                around = (around.0 + value, around.1 + 1.0);
            }
        }
        let mean = |(sum, count): (f64, f64)| (count > 0.0).then(|| sum / count);
        let (print, around) = (mean(print)?, mean(around)?);
        Some(Self(Parameters::from([
            guess.center.x,
            guess.center.y,
            guess.shape[(0, 0)],
            guess.shape[(0, 1)],
            guess.shape[(1, 1)],
            guess.ratio,
            around,
            print,
            0.0,
            0.0,
            1.0,
        ])))
    }
}

/// The pixels up to `reach` outer radii from the middle; `None` unless the ellipse itself lies in
/// the image.
fn pixels_around<'a>(
    image: &'a GrayImage,
    center: &Vector2<f64>,
    shape: &Matrix2<f64>,
    reach: f64,
) -> Option<impl Iterator<Item = (Vector2<f64>, f64)> + 'a> {
    let inverse = shape.try_inverse()?;
    let center = *center;
    // Half the sides of the box around the ellipse.
    let half = |row: usize| shape.row(row).norm();
    let (half_u, half_v) = (half(0), half(1));
    let corner = |sign: f64| PixelPoint::new(center.x + sign * half_u, center.y + sign * half_v);
    if !(image.sensor.contains(corner(-1.0)) && image.sensor.contains(corner(1.0))) {
        return None;
    }
    let range = |middle: f64, half: f64| {
        (middle - reach * half).floor() as i64..=(middle + reach * half).ceil() as i64
    };
    let columns = range(center.x, half_u);
    let inside = range(center.y, half_v).flat_map(move |v| {
        columns.clone().filter_map(move |u| {
            let at = Vector2::new(u as f64, v as f64);
            let near = (inverse * (at - center)).norm() <= reach;
            near.then(|| image.at(u, v))
                .flatten()
                .map(|value| (at, f64::from(value)))
        })
    });
    Some(inside)
}

/// The pixels of a fit.
struct Window {
    pixels: Vec<(Vector2<f64>, f64)>,
}

impl Window {
    fn around(
        image: &GrayImage,
        model: &RingModel,
        offsets: &EdgeOffsets,
        reach: f64,
    ) -> Option<Self> {
        let edges = model.edges(offsets)?;
        let band = BAND_PX.max(BAND_BLURS * edges.blur);
        let near = |edge: &Edge, at: &Vector2<f64>| edge.beside(at).depth.abs() <= band;
        let pixels: Vec<_> = pixels_around(image, &edges.center, &edges.shape, reach)?
            .filter(|(at, _)| {
                near(&edges.outer, at) || edges.inner.as_ref().is_some_and(|inner| near(inner, at))
            })
            .collect();
        (pixels.len() >= MIN_PIXELS).then_some(Self { pixels })
    }

    /// `None` where the equations determine no ring.
    fn solve(&self, start: RingModel, offsets: &EdgeOffsets) -> Option<Fitted<COUNT>> {
        let range = |unknown, (least, most)| Range {
            unknown,
            least,
            most,
            shrink: 0.0,
        };
        // A disk has no second radius: one more equation holds its ratio at zero.
        let is_disk = start.0[RATIO] == 0.0;
        let ratio_range = if is_disk { (0.0, 0.0) } else { RATIO_RANGE };
        let ranges = [range(BLUR, BLUR_RANGE_PX), range(RATIO, ratio_range)];
        let mut of_ratio = Parameters::zeros();
        of_ratio[RATIO] = 1.0;
        let held = is_disk.then_some((0.0, (0.0, of_ratio)));
        let fitted = fit(start.0, &LIMITS, &ranges, |unknowns| {
            let edges = RingModel(*unknowns).edges(offsets)?;
            let pixels = self.pixels.iter();
            let of_pixels = pixels.map(|(at, value)| (*value, edges.value_and_gradient(at)));
            Some(NormalEquations::of(of_pixels.chain(held)))
        })?;
        // The shape is kept positive definite: a fit that turned it over found something else.
        let shape = RingModel(fitted.unknowns).shape();
        (shape.trace() > 0.0 && shape.determinant() > 0.0).then_some(fitted)
    }
}

/// The shape of a circle's image: `radius` in the units that `px_from_plane` maps to pixels.
pub(super) fn shape_of_circle(px_from_plane: &Matrix2<f64>, radius: f64) -> Matrix2<f64> {
    square_root(&(px_from_plane * px_from_plane.transpose())) * radius
}

#[cfg(test)]
mod tests {
    use super::super::ring_model::tests::{offsets, truth};
    use super::*;
    use calib_rays::geometry::SensorSize;

    fn image_of(model: Parameters, offsets: &EdgeOffsets) -> GrayImage {
        let edges = RingModel(model).edges(offsets).unwrap();
        let values = (0..81 * 81)
            .map(|i| {
                let at = Vector2::new(f64::from(i % 81), f64::from(i / 81));
                edges.value_and_gradient(&at).0 as f32
            })
            .collect();
        GrayImage::from_values(SensorSize::new(81, 81), values, 255.0).unwrap()
    }

    fn guess(polarity: Polarity) -> RingGuess {
        RingGuess {
            center: Vector2::new(41.0, 39.0),
            shape: Matrix2::new(16.0, 1.0, 1.0, 14.0),
            ratio: 0.45,
            polarity,
        }
    }

    #[test]
    fn an_image_made_by_the_model_gives_the_center_to_round_off() {
        for polarity in [Polarity::Dark, Polarity::Bright] {
            let mut truth = truth();
            if polarity == Polarity::Bright {
                truth.swap_rows(AROUND, PRINT);
            }
            let image = image_of(truth, &offsets());
            let fitted = FittedRing::fit(&image, &guess(polarity), &offsets(), 1.3).unwrap();
            // The image is stored in f32: 1e-5 of a code value.
            assert!((fitted.pixel.u - 40.37).abs() < 1e-4);
            assert!((fitted.pixel.v - 39.81).abs() < 1e-4);
            assert!((fitted.ratio - 0.5).abs() < 1e-4);
            assert!((fitted.blur_px - 0.9).abs() < 1e-3);
            // Told of no offset, the fit lies between the two edges' middles.
            let middle =
                FittedRing::fit(&image, &guess(polarity), &EdgeOffsets::NONE, 1.3).unwrap();
            let aside = middle.pixel.u - 40.37;
            assert!(aside > 0.05 && aside < 0.2, "{aside}");
        }
    }

    #[test]
    fn what_is_no_ring_of_that_kind_is_refused() {
        let image = image_of(truth(), &EdgeOffsets::NONE);
        let fit = |guess: &RingGuess| FittedRing::fit(&image, guess, &EdgeOffsets::NONE, 1.3);
        assert!(fit(&guess(Polarity::Dark)).is_some());
        assert_eq!(fit(&guess(Polarity::Bright)), None);
        let beyond = RingGuess {
            center: Vector2::new(70.0, 40.0),
            ..guess(Polarity::Dark)
        };
        assert_eq!(fit(&beyond), None);
        let flat = GrayImage::from_values(SensorSize::new(81, 81), vec![80.0; 81 * 81], 255.0);
        let flat = flat.unwrap();
        let none = FittedRing::fit(&flat, &guess(Polarity::Dark), &EdgeOffsets::NONE, 1.3);
        assert_eq!(none, None);
    }
}
