//! Points all over the volume that a rig was calibrated in, to compare what rigs make of them.

use calib_rays::field::{CoverageMask, Rig};
use calib_rays::geometry::best_placement;
use calib_rays::geometry::{PixelPoint, RigidTransform};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Camera index and pixel of two sightings of one point.
pub type Match = [(usize, PixelPoint); 2];

/// Pixels along the longer side of the calibrated area. The fields' uncertain modes are smoother
/// than that.
const ALONG_LONGER_SIDE: f64 = 10.0;

/// An even lattice of calibrated pixels, about a hundred; each `coarser` times as far apart.
pub fn lattice(coverage: &CoverageMask, coarser: f64) -> Vec<PixelPoint> {
    let (cell_u, cell_v) = coverage.cell_size_px();
    let middles = coverage.covered_middles();
    let span = |of: fn(&PixelPoint) -> f64, cell_px: f64| {
        let values = middles.iter().map(of);
        let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| {
            (least.min(x), most.max(x))
        });
        (least - cell_px / 2.0, (most - least + cell_px).max(0.0))
    };
    let (from_u, width_px) = span(|pixel| pixel.u, cell_u);
    let (from_v, height_px) = span(|pixel| pixel.v, cell_v);
    let step_px = width_px.max(height_px) / ALONG_LONGER_SIDE * coarser;
    let count = |extent_px: f64| (extent_px / step_px).round().max(1.0) as usize;
    let (count_u, count_v) = (count(width_px), count(height_px));
    (0..count_u * count_v)
        .map(|k| {
            PixelPoint::new(
                from_u + ((k % count_u) as f64 + 0.5) / count_u as f64 * width_px,
                from_v + ((k / count_u) as f64 + 0.5) / count_v as f64 * height_px,
            )
        })
        .filter(|pixel| coverage.contains(*pixel))
        .collect()
}

/// Matches of the first camera with each other one: a lattice of its calibrated pixels at each of
/// some distances, where the other camera is calibrated too. They are the rig's own: its rays
/// meet. More cameras get a coarser lattice, so that the number of matches stays.
pub fn matches_at(rig: &Rig, distances_mm: &[f64]) -> Vec<Match> {
    let mut matches = Vec::new();
    let Some((first, others)) = rig.cameras.split_first() else {
        return matches;
    };
    let pixels = lattice(&first.coverage, (others.len().max(1) as f64).sqrt());
    for (other, camera) in others.iter().enumerate() {
        let camera_from_rig = camera.rig_from_camera.inverse();
        for distance_mm in distances_mm {
            for pixel in &pixels {
                let seen = first.ray_in_rig(*pixel).and_then(|ray| {
                    let point = ray.origin_mm + ray.direction.normalize() * *distance_mm;
                    camera.field.project(&camera_from_rig.point(&point))
                });
                if let Some(seen) = seen.filter(|seen| camera.coverage.contains(*seen)) {
                    matches.push([(0, *pixel), (other + 1, seen)]);
                }
            }
        }
    }
    matches
}

/// Least, middle and largest of sorted distances; empty if there are none.
pub fn span(sorted_mm: &[f64]) -> Vec<f64> {
    match (sorted_mm.first(), sorted_mm.last()) {
        (Some(least), Some(most)) => vec![*least, sorted_mm[sorted_mm.len() / 2], *most],
        _ => Vec::new(),
    }
}

/// How two rigs disagree about the points of the same matches, a rigid motion apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PointDifference {
    /// Points that both rigs measure.
    pub points: usize,
    /// RMS distance between the two rigs' points, the best rigid motion taken out, mm.
    pub rms_mm: f64,
    /// The largest, mm.
    pub max_mm: f64,
}

/// The points of two rigs, and the motion between them.
#[derive(Debug, Clone)]
pub struct Compared {
    /// The matches that both rigs have a point for, and nothing else below.
    pub matches: Vec<Match>,
    /// The second rig's frame in the first's.
    pub first_from_second: RigidTransform,
    /// What remains.
    pub difference: PointDifference,
}

/// Triangulates matches with two rigs; `None` if they share fewer than 3 points.
pub fn compare(first: &Rig, second: &Rig, matches: &[Match]) -> Option<Compared> {
    let both = |sightings: &Match| {
        Some((
            *sightings,
            first.triangulate(sightings).ok()?.point_mm,
            second.triangulate(sightings).ok()?.point_mm,
        ))
    };
    let found: Vec<(Match, Vector3<f64>, Vector3<f64>)> = matches.iter().filter_map(both).collect();
    let in_first: Vec<_> = found.iter().map(|(_, point, _)| *point).collect();
    let in_second: Vec<_> = found.iter().map(|(_, _, point)| *point).collect();
    let first_from_second = best_placement(&in_second, &in_first)?;
    let squared = in_first
        .iter()
        .zip(&in_second)
        .map(|(a, b)| (a - first_from_second.point(b)).norm_squared());
    let (sum, most) = squared.fold((0.0, 0.0_f64), |(sum, most), s| (sum + s, most.max(s)));
    Some(Compared {
        first_from_second,
        difference: PointDifference {
            points: found.len(),
            rms_mm: (sum / found.len() as f64).sqrt(),
            max_mm: most.sqrt(),
        },
        matches: found
            .into_iter()
            .map(|(sightings, _, _)| sightings)
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_rays::geometry::SensorSize;

    #[test]
    fn a_small_calibrated_area_has_as_many_pixels_as_a_large_one() {
        let sensor = SensorSize::new(960, 960);
        let square = |size: f64| {
            let corners = [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)];
            let pixels = corners.map(|(u, v)| PixelPoint::new(100.0 + u, 100.0 + v));
            CoverageMask::from_corners(sensor, pixels.into_iter())
        };
        for size in [100.0, 800.0] {
            assert_eq!(lattice(&square(size), 1.0).len(), 100);
            assert_eq!(lattice(&square(size), 2.0).len(), 25);
        }
        assert_eq!(lattice(&CoverageMask::uniform(sensor, false), 1.0), []);
    }
}
