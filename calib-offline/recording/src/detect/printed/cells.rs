//! Reading a coded marker: which of its cells are black.

use crate::dataset::image::GrayImage;
use crate::detect::homography::Homography;

/// Points along each axis at which a cell is sampled, about its middle, in cells.
const SAMPLES: [f64; 3] = [-0.22, 0.0, 0.22];
/// Share of the border's samples that must be darker than midway, and of the margin's brighter.
const MIN_SHARE: f64 = 0.85;
/// Black and white differ by at least this part of the range.
const MIN_CONTRAST: f64 = 0.03;

/// The cells of a marker, as they were read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Read {
    /// Row by row, the first cell is the lowest bit; black is 1.
    pub cells: u64,
}

/// A marker's place in the unit square of a map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// White on each side of the marker, as a part of the square.
    pub margin: f64,
    /// Where the white around the marker is looked at: a coordinate of the square, and as far from its other
    /// end.
    pub around: f64,
    /// Cells along the marker's side, without its border.
    pub side: usize,
    /// Cells of its border.
    pub border: usize,
}

impl Placed {
    /// A marker with a border of one cell in the middle of its square, `part` of it wide.
    pub fn centered(part: f64, side: usize) -> Self {
        let margin = (1.0 - part) / 2.0;
        Self {
            margin,
            around: margin / 2.0,
            side,
            border: 1,
        }
    }
}

/// Reads a marker; `None` where there is none: no black border with white around it.
pub fn read(image: &GrayImage, map: &Homography, placed: Placed) -> Option<Read> {
    let Placed {
        margin,
        around,
        side,
        border: border_cells,
    } = placed;
    let all = side + 2 * border_cells;
    let cell = (1.0 - 2.0 * margin) / all as f64;
    let value = |x: f64, y: f64| {
        let pixel = map.at(x, y);
        image.between(pixel.x, pixel.y)
    };
    // At the middle of the border's cells, and of the margin beside them.
    let along = |k: usize| margin + (k as f64 + 0.5) * cell;
    let (mut border, mut outside) = (Vec::new(), Vec::new());
    for k in 0..all {
        for ring in 0..border_cells {
            for end in [along(ring), along(all - 1 - ring)] {
                border.push(value(along(k), end)?);
                border.push(value(end, along(k))?);
            }
        }
        for out in [around, 1.0 - around] {
            outside.push(value(along(k), out)?);
            outside.push(value(out, along(k))?);
        }
    }
    let (black, white) = (middle(&mut border), middle(&mut outside));
    if white - black < MIN_CONTRAST * f64::from(image.white_level) {
        return None;
    }
    let midway = f64::midpoint(black, white);
    let share = |values: &[f64], is_dark: bool| {
        let right = values.iter().filter(|v| (**v < midway) == is_dark).count();
        right as f64 / values.len() as f64
    };
    if share(&border, true) < MIN_SHARE || share(&outside, false) < MIN_SHARE {
        return None;
    }
    let mut cells = 0;
    for row in 0..side {
        for col in 0..side {
            let mut sum = 0.0;
            for dy in SAMPLES {
                for dx in SAMPLES {
                    sum += value(
                        along(col + border_cells) + dx * cell,
                        along(row + border_cells) + dy * cell,
                    )?;
                }
            }
            let count = (SAMPLES.len() * SAMPLES.len()) as f64;
            cells |= u64::from(sum / count < midway) << (row * side + col);
        }
    }
    Some(Read { cells })
}

fn middle(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}
