//! Dark quadrilaterals on white: where coded markers may be.
//!
//! Pixels darker than a third of the way from the black to the white around them, joined; the outline's
//! hull reduced to four corners. A third instead of half, so that squares that touch at a corner stay
//! apart.

use crate::dataset::image::GrayImage;
use crate::detect::ring_target::components::{BoxMeans, labelled_areas};
use nalgebra::Vector2;

/// Side of the tiles whose darkest and brightest pixels are compared, px.
const TILE_PX: usize = 8;
/// Where between black and white dark ends.
const DARK: f64 = 0.33;
/// Black and white around a pixel differ by at least this part of the image's contrast.
const MIN_CONTRAST: f64 = 0.12;
/// Fewer pixels hold no marker.
const MIN_PIXELS: f64 = 60.0;
/// The four corners hold this part of the hull at least.
const MIN_FILLED: f64 = 0.85;
/// Shortest side, px.
const MIN_SIDE_PX: f64 = 8.0;
/// The outline lies so far inside the print's edge: half a pixel, and what the low threshold and a usual
/// blur take away, px.
const OUTWARD_PX: f64 = 0.9;

/// The corners of dark quadrilaterals, from any of them on, turning as u to v does.
pub fn quads(image: &GrayImage) -> Vec<[Vector2<f64>; 4]> {
    let width = image.sensor.width as usize;
    let mask = dark(image);
    let (areas, labels) = labelled_areas(&mask, width);
    let mut outlines: Vec<Vec<Vector2<f64>>> = vec![Vec::new(); areas.len()];
    for (i, &label) in labels.iter().enumerate() {
        let label = label as usize;
        let (Some(area), Some(outline)) = (areas.get(label), outlines.get_mut(label)) else {
            continue;
        };
        if !area.stands_out || area.at_edge || area.moments.count < MIN_PIXELS {
            continue;
        }
        // Areas at the image's edge were left out: every pixel has four neighbors.
        let beside = [i - 1, i + 1, i - width, i + width];
        if beside
            .iter()
            .any(|&j| Some(labels[j] as usize) == area.parent)
        {
            outline.push(Vector2::new((i % width) as f64, (i / width) as f64));
        }
    }
    outlines
        .iter()
        .filter(|outline| !outline.is_empty())
        .filter_map(|outline| quad(outline))
        .collect()
}

/// Which pixels are dark against what is around them.
fn dark(image: &GrayImage) -> Vec<bool> {
    let (width, height) = (image.sensor.width as usize, image.sensor.height as usize);
    let means = BoxMeans::new(image);
    let smooth: Vec<f32> = (0..width * height)
        .map(|i| means.mean(i % width, i / width, 1) as f32)
        .collect();
    let (columns, rows) = (width.div_ceil(TILE_PX), height.div_ceil(TILE_PX));
    let mut tiles = vec![(f32::INFINITY, f32::NEG_INFINITY); columns * rows];
    for (i, &value) in smooth.iter().enumerate() {
        let tile = &mut tiles[(i / width / TILE_PX) * columns + (i % width) / TILE_PX];
        *tile = (tile.0.min(value), tile.1.max(value));
    }
    // With the tiles beside.
    let around: Vec<(f32, f32)> = (0..columns * rows)
        .map(|k| {
            let (column, row) = (k % columns, k / columns);
            let mut range = (f32::INFINITY, f32::NEG_INFINITY);
            for r in row.saturating_sub(1)..(row + 2).min(rows) {
                for c in column.saturating_sub(1)..(column + 2).min(columns) {
                    let tile = tiles[r * columns + c];
                    range = (range.0.min(tile.0), range.1.max(tile.1));
                }
            }
            range
        })
        .collect();
    let [black, white] = image.quantiles([0.005, 0.995]);
    let least = MIN_CONTRAST as f32 * (white - black);
    smooth
        .iter()
        .enumerate()
        .map(|(i, &value)| {
            let (low, high) = around[(i / width / TILE_PX) * columns + (i % width) / TILE_PX];
            high - low > least && value < low + DARK as f32 * (high - low)
        })
        .collect()
}

/// The quadrilateral that an outline is, moved outward to the print's edge.
fn quad(outline: &[Vector2<f64>]) -> Option<[Vector2<f64>; 4]> {
    let hull = hull(outline);
    if hull.len() < 4 {
        return None;
    }
    let count = hull.len();
    let far_from = |from: &Vector2<f64>| {
        let away = |k: &usize| (hull[*k] - from).norm_squared();
        (0..count).max_by(|a, b| away(a).total_cmp(&away(b)))
    };
    // Two opposite corners: the farthest from the middle, and the farthest from that.
    let middle = hull.iter().sum::<Vector2<f64>>() / count as f64;
    let a = far_from(&middle)?;
    let c = far_from(&hull[a])?;
    let beside = |from: usize, to: usize| {
        let line = hull[to] - hull[from];
        let off = |k: &usize| line.perp(&(hull[*k] - hull[from])).abs();
        let between = (1..count)
            .map(|k| (from + k) % count)
            .take_while(|k| *k != to);
        between.max_by(|x, y| off(x).total_cmp(&off(y)))
    };
    let mut corners = [a, beside(a, c)?, c, beside(c, a)?];
    // Each corner where it makes the most of the area, the others held.
    for _ in 0..3 {
        for k in 0..4 {
            let (before, after) = (corners[(k + 3) % 4], corners[(k + 1) % 4]);
            corners[k] = beside(before, after)?;
        }
    }
    let quad = corners.map(|k| hull[k]);
    let area = |polygon: &[Vector2<f64>]| {
        let sides = (0..polygon.len()).map(|k| polygon[k].perp(&polygon[(k + 1) % polygon.len()]));
        sides.sum::<f64>() / 2.0
    };
    let side = |k: usize| (quad[(k + 1) % 4] - quad[k]).norm();
    let least = (0..4).map(side).fold(f64::INFINITY, f64::min);
    if area(&quad) < MIN_FILLED * area(&hull) || least < MIN_SIDE_PX {
        return None;
    }
    outward(&quad)
}

/// The quadrilateral with every side moved outward.
fn outward(quad: &[Vector2<f64>; 4]) -> Option<[Vector2<f64>; 4]> {
    let line = |k: usize| {
        let along = (quad[(k + 1) % 4] - quad[k]).normalize();
        // Turning as u to v does, the outside lies to the left: (y, -x).
        let normal = Vector2::new(along.y, -along.x);
        (quad[k] + normal * OUTWARD_PX, along)
    };
    let mut moved = *quad;
    for (k, corner) in moved.iter_mut().enumerate() {
        let ((p, d), (q, e)) = (line((k + 3) % 4), line(k));
        let turn = d.perp(&e);
        if turn < 0.1 {
            return None;
        }
        *corner = p + d * ((q - p).perp(&e) / turn);
    }
    Some(moved)
}

/// The convex hull, turning as u to v does (Andrew's monotone chain).
fn hull(points: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = &Vector2<f64>>| {
        let mut chain: Vec<Vector2<f64>> = Vec::new();
        for &point in points {
            while let [.., a, b] = chain.as_slice()
                && (b - a).perp(&(point - b)) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter());
    hull.extend(half(&mut sorted.iter().rev()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::SensorSize;

    #[test]
    fn a_turned_square_is_found_by_its_corners() {
        let (s, c) = 0.3_f64.sin_cos();
        let values = (0..120 * 100)
            .map(|i| {
                let (u, v) = (f64::from(i % 120) - 60.0, f64::from(i / 120) - 50.0);
                let (x, y) = (c * u + s * v, c * v - s * u);
                if x.abs().max(y.abs()) < 20.0 {
                    30.0
                } else {
                    200.0
                }
            })
            .collect();
        let image = GrayImage::from_values(SensorSize::new(120, 100), values, 255.0).unwrap();
        let found = quads(&image);
        assert_eq!(found.len(), 1);
        for (x, y) in [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)] {
            let corner = Vector2::new(60.0 + c * x - s * y, 50.0 + s * x + c * y);
            let nearest = found[0].iter().map(|p| (p - corner).norm());
            assert!(nearest.fold(f64::INFINITY, f64::min) < 1.5);
        }
        let turn = (found[0][1] - found[0][0]).perp(&(found[0][2] - found[0][1]));
        assert!(turn > 0.0);
    }
}
