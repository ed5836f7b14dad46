//! What a change of the cameras does to points that are measured as if nothing had happened.

use crate::working_volume::{lattice, matches_at};
use calib_estimate::explain::change::{CameraSizes, Visible};
use calib_estimate::explain::effects::camera_shifts;
use calib_rays::field::{CalibratedCamera, Rig};
use calib_rays::geometry::{PixelPoint, Ray, best_placement, triangulate_pair};
use nalgebra::{Vector2, Vector3};

/// A step that is linear to three digits, of a unit that begins to matter.
const STEP: f64 = 0.01;

/// A point (rig frame, mm) and where cameras see it, the second one if there is one.
struct Probe {
    point: Vector3<f64>,
    seen: Vec<(usize, PixelPoint)>,
}

/// Points all over the volume of a rig, to try changes on.
pub struct Probes<'a> {
    rig: &'a Rig,
    points: Vec<Probe>,
    distance_mm: f64,
}

impl<'a> Probes<'a> {
    /// At some distances, least, middle and largest; `None` without any.
    pub fn new(rig: &'a Rig, distances_mm: &[f64]) -> Option<Self> {
        let distance_mm = *distances_mm.get(1)?;
        let points = if rig.cameras.len() > 1 {
            let matches = matches_at(rig, distances_mm).into_iter();
            let probe = |seen: [(usize, PixelPoint); 2]| {
                let point = rig.triangulate(&seen).ok()?.point_mm;
                Some(Probe {
                    point,
                    seen: seen.to_vec(),
                })
            };
            matches.filter_map(probe).collect()
        } else {
            let camera = rig.cameras.first()?;
            let pixels = lattice(&camera.coverage, 1.0).into_iter();
            let probe = |pixel| Probe {
                point: along(&ray(camera, pixel), distance_mm),
                seen: vec![(0, pixel)],
            };
            pixels.map(probe).collect()
        };
        Some(Self {
            rig,
            points,
            distance_mm,
        })
    }

    /// Where the old rig puts each point after a change; `None` where it has none then.
    fn after(&self, sizes: &CameraSizes) -> Vec<Option<Vector3<f64>>> {
        self.points.iter().map(|p| self.seen(p, sizes)).collect()
    }

    /// How far the old rig puts each point from where it is after a change, the best rigid motion taken
    /// out, mm; `None` if it has fewer than 3 of them.
    fn displaced(&self, after: &[Option<Vector3<f64>>]) -> Option<Vec<Vector3<f64>>> {
        let pairs = after.iter().zip(&self.points);
        let (after, before): (Vec<_>, Vec<_>) = pairs
            .filter_map(|(after, probe)| Some(((*after)?, probe.point)))
            .unzip();
        let motion = best_placement(&after, &before)?;
        let pairs = after.iter().zip(&before);
        Some(pairs.map(|(a, b)| motion.point(a) - b).collect())
    }

    /// Where the old rig has a point that it sees after a change.
    fn seen(&self, probe: &Probe, sizes: &CameraSizes) -> Option<Vector3<f64>> {
        let rays: Option<Vec<Ray>> = probe
            .seen
            .iter()
            .map(|(camera_idx, pixel)| {
                let camera = &self.rig.cameras[*camera_idx];
                let in_camera = camera.rig_from_camera.inverse().point(&probe.point);
                let shifts = camera_shifts(
                    &camera.field,
                    *pixel,
                    &camera.field.sample(*pixel),
                    &in_camera,
                )?;
                let sizes = &sizes[*camera_idx];
                let shift: Vector2<f64> = shifts.iter().zip(sizes).map(|(by, x)| by * *x).sum();
                let pixel = PixelPoint::new(pixel.u + shift.x, pixel.v + shift.y);
                Some(ray(camera, pixel))
            })
            .collect();
        match &rays?[..] {
            [a, b] => Some(triangulate_pair(a, b).ok()?.point_mm),
            [one] => Some(along(one, self.distance_mm)),
            _ => None,
        }
    }

    /// What a pixel in the middle of the first camera is at the middle distance, mm.
    pub fn mm_per_px(&self) -> f64 {
        let middle = self.rig.cameras.first().map_or(0.0, |camera| {
            let sample = camera.field.sample(camera.field.sensor.center());
            sample.ds.determinant().abs().sqrt()
        });
        middle * self.distance_mm
    }

    /// RMS error of measured points after a change, mm; `None` if the old rig measures none then.
    pub fn cost_mm(&self, sizes: &CameraSizes) -> Option<f64> {
        let apart = self.displaced(&self.after(sizes))?;
        let sum: f64 = apart.iter().map(Vector3::norm_squared).sum();
        Some((sum / apart.len() as f64).sqrt())
    }

    /// RMS error of measured points by a change of one standard deviation in every way that a kind of
    /// change has, mm.
    pub fn open_mm(&self, visible: &Visible) -> Option<f64> {
        let by_number: Option<Vec<_>> = visible
            .sizes
            .iter()
            .map(|sizes| {
                let small = sizes.iter().map(|own| own.map(|x| x * STEP)).collect();
                let after = self.after(&small);
                after.iter().all(Option::is_some).then_some(())?;
                self.displaced(&after)
            })
            .collect();
        let (by_number, mut sum) = (by_number?, 0.0);
        for (i, a) in by_number.iter().enumerate() {
            for (j, b) in by_number.iter().enumerate() {
                let both: f64 = a.iter().zip(b).map(|(a, b)| a.dot(b)).sum();
                sum += visible.covariance[(i, j)] * both / (STEP * STEP);
            }
        }
        Some((sum / self.points.len().max(1) as f64).max(0.0).sqrt())
    }
}

/// The ray of a pixel, calibrated or not: changes of a few pixels lead over the edge.
fn ray(camera: &CalibratedCamera, pixel: PixelPoint) -> Ray {
    camera.field.ray(pixel).transformed(&camera.rig_from_camera)
}

fn along(ray: &Ray, distance_mm: f64) -> Vector3<f64> {
    ray.origin_mm + ray.direction.normalize() * distance_mm
}
