//! Points all over the volume that a rig was calibrated in, to compare what rigs make of them.

use super::measured_board::best_placement;
use crate::field::Rig;
use crate::geometry::{PixelPoint, RigidTransform};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Camera index and pixel of two sightings of one point.
pub type Match = [(usize, PixelPoint); 2];

/// Points along the longer side of the first sensor, and per distance about the square of it. The
/// fields' uncertain modes are smoother than that.
const ALONG_LONGER_SIDE: f64 = 10.0;

/// Matches of the first camera with each other one: an even lattice of its calibrated pixels at
/// each of some distances, where the other camera is calibrated too. They are the rig's own: its
/// rays meet. More cameras get a coarser lattice, so that the number of matches stays.
pub fn matches_at(rig: &Rig, distances_mm: &[f64]) -> Vec<Match> {
    let mut matches = Vec::new();
    let Some((first, others)) = rig.cameras.split_first() else {
        return matches;
    };
    let sensor = first.field.sensor;
    let longer_px = f64::from(sensor.width.max(sensor.height));
    let step_px = longer_px / ALONG_LONGER_SIDE * (others.len().max(1) as f64).sqrt();
    let count = |extent: u32| (f64::from(extent) / step_px).round().max(1.0) as usize;
    let (count_u, count_v) = (count(sensor.width), count(sensor.height));
    let place = |k: usize, count: usize, extent: u32| {
        (k as f64 + 0.5) / count as f64 * f64::from(extent) - 0.5
    };
    for (other, camera) in others.iter().enumerate() {
        let camera_from_rig = camera.rig_from_camera.inverse();
        for distance_mm in distances_mm {
            for k in 0..count_u * count_v {
                let pixel = PixelPoint::new(
                    place(k % count_u, count_u, sensor.width),
                    place(k / count_u, count_v, sensor.height),
                );
                let seen = first.ray_in_rig(pixel).and_then(|ray| {
                    let point = ray.origin_mm + ray.direction.normalize() * *distance_mm;
                    camera.field.project(&camera_from_rig.point(&point))
                });
                if let Some(seen) = seen.filter(|seen| camera.coverage.contains(*seen)) {
                    matches.push([(0, pixel), (other + 1, seen)]);
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
