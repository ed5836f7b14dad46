//! The calibrated area of a camera as a polygon, for formats that have no masks.

use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, SensorSize};
use std::ops::RangeInclusive;

/// Rows that are looked at, at most.
const ROWS: u32 = 97;

/// A closed polygon, its first vertex again at its end, within the calibrated area but for what lies between the rows looked at:
/// each row's longest run of pixels with rays. Empty if there are no two such rows.
pub(super) fn valid_polygon(
    source: &dyn RaySource,
    camera_idx: usize,
    sensor: SensorSize,
) -> Vec<PixelPoint> {
    let rows = ROWS.min(sensor.height).max(2);
    let runs: Vec<Option<(f64, RangeInclusive<u32>)>> = (0..rows)
        .map(|k| {
            let v = (u64::from(k) * u64::from(sensor.height - 1) / u64::from(rows - 1)) as u32;
            let run = longest_run(sensor.width, |u| {
                let pixel = PixelPoint::new(f64::from(u), f64::from(v));
                source.ray(camera_idx, pixel).is_some()
            })?;
            Some((f64::from(v), run))
        })
        .collect();
    // The most rows in turn: a polygon has one piece.
    let mut pieces: Vec<Vec<(f64, RangeInclusive<u32>)>> = vec![Vec::new()];
    for run in runs {
        match (run, pieces.last_mut()) {
            (Some(run), Some(piece)) => piece.push(run),
            _ => pieces.push(Vec::new()),
        }
    }
    let Some(piece) = pieces
        .into_iter()
        .max_by_key(Vec::len)
        .filter(|piece| piece.len() >= 2)
    else {
        return Vec::new();
    };
    let left = |(v, run): &(f64, RangeInclusive<u32>)| PixelPoint::new(f64::from(*run.start()), *v);
    let right = |(v, run): &(f64, RangeInclusive<u32>)| PixelPoint::new(f64::from(*run.end()), *v);
    let mut outline: Vec<PixelPoint> = Vec::new();
    let around = piece.iter().map(right).chain(piece.iter().rev().map(left));
    for pixel in around {
        // A vertex between two others of its column says nothing.
        if let [.., before, last] = outline[..]
            && before.u == last.u
            && last.u == pixel.u
        {
            outline.pop();
        }
        outline.push(pixel);
    }
    outline.extend(outline.first().copied());
    outline
}

/// The longest run of columns for which there is a ray; the first of several.
fn longest_run(width: u32, has_ray: impl Fn(u32) -> bool) -> Option<RangeInclusive<u32>> {
    let mut best: Option<RangeInclusive<u32>> = None;
    let mut start = None;
    for u in 0..=width {
        match (u < width && has_ray(u), start) {
            (true, None) => start = Some(u),
            (false, Some(first)) => {
                let is_longer = best
                    .as_ref()
                    .is_none_or(|best| u - 1 - first > best.end() - best.start());
                if is_longer {
                    best = Some(first..=u - 1);
                }
                start = None;
            }
            _ => {}
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib_blob::rays::SourceCamera;
    use calib_rays::geometry::{Ray, RigidTransform};
    use nalgebra::Vector3;

    const SENSOR: SensorSize = SensorSize::new(40, 30);

    struct Area(fn(PixelPoint) -> bool);

    impl RaySource for Area {
        fn cameras(&self) -> Vec<SourceCamera> {
            vec![SourceCamera {
                name: "only".to_owned(),
                sensor: SENSOR,
                rig_from_camera: RigidTransform::identity(),
            }]
        }

        fn ray(&self, _: usize, pixel: PixelPoint) -> Option<Ray> {
            (self.0)(pixel).then(|| Ray {
                origin_mm: Vector3::zeros(),
                direction: Vector3::z(),
            })
        }
    }

    #[test]
    fn a_whole_sensor_has_four_corners_and_the_first_again() {
        let found = valid_polygon(&Area(|_| true), 0, SENSOR);
        let corners = [
            (39.0, 0.0),
            (39.0, 29.0),
            (0.0, 29.0),
            (0.0, 0.0),
            (39.0, 0.0),
        ];
        assert_eq!(found, corners.map(|(u, v)| PixelPoint::new(u, v)));
    }

    #[test]
    fn islands_and_holes_are_left_out() {
        // A disk, a spot beside it, and a hole that cuts its rows.
        let found = valid_polygon(
            &Area(|p| {
                let disk = p.distance_px(PixelPoint::new(20.0, 15.0)) < 12.0;
                let spot = p.u < 3.0 && p.v < 2.0;
                let hole = p.distance_px(PixelPoint::new(25.0, 15.0)) < 2.0;
                (disk || spot) && !hole
            }),
            0,
            SENSOR,
        );
        assert_eq!(found.first(), found.last());
        assert!(found.len() > 8);
        let in_disk = |p: &PixelPoint| p.distance_px(PixelPoint::new(20.0, 15.0)) < 12.0;
        assert!(found.iter().all(in_disk), "{found:?}");
        assert!(found.iter().all(|p| p.v != 15.0 || p.u < 24.0));
        assert!(valid_polygon(&Area(|_| false), 0, SENSOR).is_empty());
    }
}
