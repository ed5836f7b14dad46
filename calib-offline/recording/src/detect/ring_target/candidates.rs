//! Where rings may be: areas with one hole, both elliptic and about the same center.

use super::components::{Area, BoxMeans, Moments, Polarity, areas, standing_out};
use crate::dataset::image::GrayImage;
use nalgebra::{Matrix2, Vector2};

/// Half sides of the windows whose mean an area must stand out from, as divisors of the image's
/// shorter side: wide enough for markers that fill the image, narrow enough for uneven light.
const WINDOW_DIVISORS: [usize; 3] = [12, 30, 5];
/// An area stands out by this part of the image's contrast at least.
const MIN_MARGIN: f64 = 0.06;
/// Fewer pixels have no shape.
const MIN_PIXELS: f64 = 24.0;
/// How far the area of an ellipse with the same covariance may be from an outline's own.
const OUTLINE_TOLERANCE: f64 = 0.12;
/// The same for the hole, which is smaller and suffers more from pixels.
const HOLE_TOLERANCE: f64 = 0.3;
/// Longest against shortest axis: a circle seen at 80 degrees.
const MAX_ELONGATION: f64 = 6.0;
/// Distance of the two centers, as a part of the outline's shorter half axis.
const MAX_ECCENTRICITY: f64 = 0.2;
/// Inner against outer radius.
const RATIO_RANGE: (f64, f64) = (0.12, 0.93);
/// Specks inside a ring, besides its hole, as a part of its own pixels.
const MAX_SPECKS: f64 = 0.1;

/// A ring, roughly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RingGuess {
    /// The middle of its outline, px.
    pub center: Vector2<f64>,
    /// Symmetric; maps the unit circle to the outline (about its middle), px.
    pub shape: Matrix2<f64>,
    /// Inner against outer radius; 0 is a disk.
    pub ratio: f64,
    /// Darker or brighter than around.
    pub polarity: Polarity,
}

impl RingGuess {
    /// Radius of the circle with the outline's area, px.
    pub fn mean_radius_px(&self) -> f64 {
        self.shape.determinant().abs().sqrt()
    }
}

/// What is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sought {
    /// Areas with a hole.
    Rings,
    /// Areas with a hole or without.
    RingsAndDisks,
}

/// What may be rings, at most `max_count` of either polarity, in the order in which they come in the
/// image. Stops looking through finer and coarser windows once `enough` of one polarity were found.
pub fn ring_candidates(image: &GrayImage, enough: usize, max_count: usize) -> Vec<RingGuess> {
    candidates(image, Sought::Rings, enough, max_count)
}

/// As [`ring_candidates`], disks included where they are sought.
pub fn candidates(
    image: &GrayImage,
    sought: Sought,
    enough: usize,
    max_count: usize,
) -> Vec<RingGuess> {
    let [dark, bright] = image.quantiles([0.005, 0.995]);
    let margin = MIN_MARGIN * f64::from(bright - dark);
    if margin <= 0.0 {
        return Vec::new();
    }
    let means = BoxMeans::new(image);
    let width = image.sensor.width as usize;
    let shorter = image.sensor.width.min(image.sensor.height) as usize;
    let mut found: [Vec<RingGuess>; 2] = [Vec::new(), Vec::new()];
    for divisor in WINDOW_DIVISORS {
        let half_window = (shorter / divisor).max(2);
        for (polarity, known) in [Polarity::Dark, Polarity::Bright]
            .into_iter()
            .zip(&mut found)
        {
            let mask = standing_out(image, &means, half_window, margin, polarity);
            for ring in rings(&areas(&mask, width), polarity, sought) {
                let is_new = known
                    .iter()
                    .all(|other| (other.center - ring.center).norm() > 0.5 * ring.mean_radius_px());
                if is_new && known.len() < max_count {
                    known.push(ring);
                }
            }
        }
        if found.iter().any(|rings| rings.len() >= enough) {
            break;
        }
    }
    found.into_iter().flatten().collect()
}

fn rings(areas: &[Area], polarity: Polarity, sought: Sought) -> Vec<RingGuess> {
    // Of each area: its largest hole, and all pixels of its holes.
    let mut holes: Vec<(Option<Moments>, Moments)> = vec![Default::default(); areas.len()];
    for area in areas.iter().filter(|area| !area.stands_out) {
        if let Some((largest, all)) = area.parent.and_then(|parent| holes.get_mut(parent)) {
            *all = all.and(&area.moments);
            if largest.is_none_or(|hole| hole.count < area.moments.count) {
                *largest = Some(area.moments);
            }
        }
    }
    areas
        .iter()
        .zip(holes)
        .filter(|(area, _)| area.stands_out && !area.at_edge)
        .filter_map(|(area, (hole, all))| {
            let as_ring = hole.and_then(|hole| ring(&area.moments, &hole, &all, polarity));
            as_ring.or_else(|| {
                let sought = sought == Sought::RingsAndDisks;
                sought
                    .then(|| disk(&area.moments, &all, polarity))
                    .flatten()
            })
        })
        .collect()
}

/// A disk, with no more than specks in it.
fn disk(own: &Moments, holes: &Moments, polarity: Polarity) -> Option<RingGuess> {
    let filled = own.and(holes);
    if filled.count < MIN_PIXELS || holes.count > MAX_SPECKS * own.count {
        return None;
    }
    let shape = ellipse(&filled, OUTLINE_TOLERANCE)?;
    let axes = shape.symmetric_eigenvalues();
    (axes.max() <= MAX_ELONGATION * axes.min()).then_some(RingGuess {
        center: filled.center(),
        shape,
        ratio: 0.0,
        polarity,
    })
}

fn ring(own: &Moments, hole: &Moments, holes: &Moments, polarity: Polarity) -> Option<RingGuess> {
    let filled = own.and(holes);
    if filled.count < MIN_PIXELS || holes.count - hole.count > MAX_SPECKS * own.count {
        return None;
    }
    let shape = ellipse(&filled, OUTLINE_TOLERANCE)?;
    ellipse(hole, HOLE_TOLERANCE)?;
    let axes = shape.symmetric_eigenvalues();
    let ratio = (hole.count / filled.count).sqrt();
    let apart = (hole.center() - filled.center()).norm();
    let is_ring = axes.max() <= MAX_ELONGATION * axes.min()
        && apart <= MAX_ECCENTRICITY * axes.min()
        && (RATIO_RANGE.0..=RATIO_RANGE.1).contains(&ratio);
    is_ring.then_some(RingGuess {
        center: filled.center(),
        shape,
        ratio,
        polarity,
    })
}

/// The ellipse with these moments, if they are those of an ellipse: a full ellipse of area A has
/// the covariance whose determinant is `(A / 4 pi)^2`.
fn ellipse(moments: &Moments, tolerance: f64) -> Option<Matrix2<f64>> {
    let covariance = moments.covariance();
    let determinant = covariance.determinant();
    if !(determinant > 0.0) {
        return None;
    }
    let expected = 2.0 * std::f64::consts::TAU * determinant.sqrt();
    if (moments.count / expected - 1.0).abs() > tolerance {
        return None;
    }
    Some(2.0 * square_root(&covariance))
}

/// The symmetric square root of a symmetric positive definite matrix.
pub(super) fn square_root(matrix: &Matrix2<f64>) -> Matrix2<f64> {
    let det_root = matrix.determinant().max(0.0).sqrt();
    let scale = (matrix.trace() + 2.0 * det_root)
        .max(f64::MIN_POSITIVE)
        .sqrt();
    (matrix + Matrix2::identity() * det_root) / scale
}

#[cfg(test)]
mod tests {
    use super::super::ring_fit::FittedRing;
    use super::super::ring_model::EdgeOffsets;
    use super::*;
    use calib_rays::geometry::SensorSize;

    fn image(value: impl Fn(f64, f64) -> f32) -> GrayImage {
        let values = (0..120 * 100)
            .map(|i| value(f64::from(i % 120), f64::from(i / 120)))
            .collect();
        GrayImage::from_values(SensorSize::new(120, 100), values, 255.0).unwrap()
    }

    #[test]
    fn a_ring_among_other_shapes_is_found_in_either_polarity() {
        let radius = |u: f64, v: f64, u0: f64| (u - u0).hypot((v - 50.0) / 0.7);
        for (polarity, print, plate) in [
            (Polarity::Dark, 30.0, 200.0),
            (Polarity::Bright, 200.0, 30.0),
        ] {
            let image = image(|u, v| {
                let ring = (8.0..16.0).contains(&radius(u, v, 30.4));
                let disk = radius(u, v, 70.0) < 14.0;
                let square = (100.0..112.0).contains(&u) && (44.0..56.0).contains(&v);
                let hole = (103.0..109.0).contains(&u) && (47.0..53.0).contains(&v);
                if ring || disk || (square && !hole) {
                    print
                } else {
                    plate
                }
            });
            let rings = ring_candidates(&image, 63, 100);
            let rings: Vec<_> = rings.iter().filter(|r| r.polarity == polarity).collect();
            // Others may follow: a disk wider than the window it is compared with seems to have a hole.
            let ring = rings[0];
            assert!(FittedRing::fit(&image, ring, &EdgeOffsets::NONE, 1.2).is_some());
            assert!((ring.center - Vector2::new(30.4, 50.0)).norm() < 0.3);
            assert!((ring.shape[(0, 0)] - 16.0).abs() < 0.5);
            assert!((ring.shape[(1, 1)] - 11.2).abs() < 0.5);
            assert!((ring.ratio - 0.5).abs() < 0.05);
        }
    }

    #[test]
    fn a_flat_image_has_none() {
        assert!(ring_candidates(&image(|_, _| 80.0), 63, 100).is_empty());
    }

    #[test]
    fn the_square_root_squares_to_the_matrix() {
        let matrix = Matrix2::new(5.0, 1.5, 1.5, 2.0);
        let root = square_root(&matrix);
        assert!((root * root - matrix).amax() < 1e-14);
    }
}
