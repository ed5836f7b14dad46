//! Connected areas darker or brighter than their surroundings, and which area encloses which.

use crate::dataset::image::GrayImage;
use nalgebra::{Matrix2, Vector2};

/// Whether markers are darker or brighter than what they are printed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Polarity {
    /// Dark rings on a bright plate.
    Dark,
    /// Bright rings on a dark plate.
    Bright,
}

/// A connected area and its moments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Whether it stands out from its surroundings (8-connected) or not (4-connected).
    pub stands_out: bool,
    /// Whether it reaches the edge of the image.
    pub at_edge: bool,
    /// The area around it, an index into the list; `None` for those at the edge of the image.
    pub parent: Option<usize>,
    /// Pixels and their moments.
    pub moments: Moments,
}

/// Sums over pixels: count, position, products of positions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    /// Pixels.
    pub count: f64,
    sum: Vector2<f64>,
    products: Matrix2<f64>,
}

impl Moments {
    fn add(&mut self, u: usize, v: usize) {
        let at = Vector2::new(u as f64, v as f64);
        self.count += 1.0;
        self.sum += at;
        self.products += at * at.transpose();
    }

    /// The moments of two disjoint areas together.
    pub fn and(&self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            sum: self.sum + other.sum,
            products: self.products + other.products,
        }
    }

    /// The middle, px.
    pub fn center(&self) -> Vector2<f64> {
        self.sum / self.count.max(1.0)
    }

    /// Covariance of the positions over the area (each pixel a square), px^2.
    pub fn covariance(&self) -> Matrix2<f64> {
        let center = self.center();
        let of_pixel = Matrix2::identity() / 12.0;
        self.products / self.count.max(1.0) - center * center.transpose() + of_pixel
    }
}

/// Which pixels stand out: by more than `margin` from the mean of the window around them, whose
/// side is `2 half_window + 1`. Noise is smoothed over 3 x 3 pixels first.
pub fn standing_out(
    image: &GrayImage,
    means: &BoxMeans,
    half_window: usize,
    margin: f64,
    polarity: Polarity,
) -> Vec<bool> {
    let width = image.sensor.width as usize;
    let sign = match polarity {
        Polarity::Dark => -1.0,
        Polarity::Bright => 1.0,
    };
    (0..image.values().len())
        .map(|i| {
            let (u, v) = (i % width, i / width);
            let here = means.mean(u, v, 1);
            sign * (here - means.mean(u, v, half_window)) > margin
        })
        .collect()
}

/// Means over windows of any size, in the same time.
pub struct BoxMeans {
    width: usize,
    height: usize,
    /// Sum of all values above and left of a pixel's corner, `(width + 1) * (height + 1)` of them.
    sums: Vec<f64>,
}

impl BoxMeans {
    /// Prepares the means of an image.
    pub fn new(image: &GrayImage) -> Self {
        let (width, height) = (image.sensor.width as usize, image.sensor.height as usize);
        let mut sums = vec![0.0; (width + 1) * (height + 1)];
        for v in 0..height {
            let mut row = 0.0;
            for u in 0..width {
                row += f64::from(image.value(v * width + u));
                sums[(v + 1) * (width + 1) + u + 1] = sums[v * (width + 1) + u + 1] + row;
            }
        }
        Self {
            width,
            height,
            sums,
        }
    }

    /// The mean over the pixels at most `half` away along u and along v, as far as there are any.
    pub fn mean(&self, u: usize, v: usize, half: usize) -> f64 {
        let (left, right) = (u.saturating_sub(half), (u + half + 1).min(self.width));
        let (top, bottom) = (v.saturating_sub(half), (v + half + 1).min(self.height));
        let at = |u: usize, v: usize| self.sums[v * (self.width + 1) + u];
        let sum = at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top);
        sum / ((right - left) * (bottom - top)) as f64
    }
}

/// All areas of a mask of `width` pixels per row, in the order of their first pixels.
pub fn areas(mask: &[bool], width: usize) -> Vec<Area> {
    labelled_areas(mask, width).0
}

/// As [`areas`], with the index of each pixel's area.
pub fn labelled_areas(mask: &[bool], width: usize) -> (Vec<Area>, Vec<u32>) {
    const NONE: u32 = u32::MAX;
    let height = mask.len() / width.max(1);
    let mut labels = vec![NONE; mask.len()];
    let mut areas: Vec<Area> = Vec::new();
    let mut stack = Vec::new();
    for first in 0..width * height {
        if labels[first] != NONE {
            continue;
        }
        // The pixel to the left belongs to what lies around: it is of the other kind, or it would
        // be of this area, and it comes earlier, so it has its label.
        let parent = (first % width > 0).then(|| labels[first - 1] as usize);
        let label = areas.len() as u32;
        let mut area = Area {
            stands_out: mask[first],
            at_edge: false,
            parent,
            moments: Moments::default(),
        };
        labels[first] = label;
        stack.push(first);
        while let Some(i) = stack.pop() {
            let (u, v) = (i % width, i / width);
            area.moments.add(u, v);
            let (last_u, last_v) = (u + 1 == width, v + 1 == height);
            area.at_edge |= u == 0 || v == 0 || last_u || last_v;
            let mut visit = |j: usize| {
                if labels[j] == NONE && mask[j] == area.stands_out {
                    labels[j] = label;
                    stack.push(j);
                }
            };
            if u > 0 {
                visit(i - 1);
            }
            if !last_u {
                visit(i + 1);
            }
            if v > 0 {
                visit(i - width);
            }
            if !last_v {
                visit(i + width);
            }
            if area.stands_out {
                if v > 0 && u > 0 {
                    visit(i - width - 1);
                }
                if v > 0 && !last_u {
                    visit(i - width + 1);
                }
                if !last_v && u > 0 {
                    visit(i + width - 1);
                }
                if !last_v && !last_u {
                    visit(i + width + 1);
                }
            }
        }
        if area.at_edge {
            area.parent = None;
        }
        areas.push(area);
    }
    (areas, labels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::SensorSize;

    fn mask(text: &str) -> (Vec<bool>, usize) {
        let lines: Vec<&str> = text.lines().collect();
        let mask = lines.concat().chars().map(|c| c == '#').collect();
        (mask, lines[0].len())
    }

    #[test]
    fn a_hole_knows_the_ring_around_it_and_diagonals_hold_the_ring_together() {
        let (mask, width) = mask(".......\n..###..\n.#...#.\n..###..\n.......");
        let areas = areas(&mask, width);
        assert_eq!(areas.len(), 3);
        assert!(areas[0].at_edge && areas[0].parent.is_none());
        assert!(areas[1].stands_out && !areas[1].at_edge);
        assert_eq!(areas[1].parent, Some(0));
        assert_eq!(areas[2].parent, Some(1));
        assert_eq!(areas[2].moments.count, 3.0);
        assert_eq!(areas[2].moments.center(), Vector2::new(3.0, 2.0));
        // Three pixels in a row: a rectangle of 3 by 1.
        let covariance = areas[2].moments.covariance();
        assert!((covariance[(0, 0)] - 9.0 / 12.0).abs() < 1e-12);
        assert!((covariance[(1, 1)] - 1.0 / 12.0).abs() < 1e-12);
    }

    #[test]
    fn a_dark_spot_stands_out_of_uneven_light() {
        let sensor = SensorSize::new(60, 40);
        let values = (0..60 * 40)
            .map(|i| {
                let (u, v) = (i % 60, i / 60);
                let light = 40.0 + 3.0 * u as f32;
                let spot = (28..32).contains(&u) && (18..22).contains(&v);
                if spot { 0.5 * light } else { light }
            })
            .collect();
        let image = GrayImage::from_values(sensor, values, 255.0).unwrap();
        let means = BoxMeans::new(&image);
        let dark = standing_out(&image, &means, 8, 30.0, Polarity::Dark);
        assert!(dark[20 * 60 + 30] && !dark[10 * 60 + 10] && !dark[20 * 60 + 50]);
        let bright = standing_out(&image, &means, 8, 30.0, Polarity::Bright);
        assert!(!bright[20 * 60 + 30]);
    }
}
