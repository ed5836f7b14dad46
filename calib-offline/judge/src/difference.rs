//! Two calibrations of the same cameras: how far they are apart after the best rigid placement, all over
//! the volume and over the sensors, and whether their uncertainties predict it.

use crate::half_data::Halves;
use crate::working_volume::{compare, lattice, matches_at};
use calib_rays::field::{CalibratedCamera, Rig};
use calib_rays::geometry::{PixelPoint, RigidTransform, best_placement};
use nalgebra::Vector3;
use serde::Serialize;

/// What the difference is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// As different as their uncertainties predict.
    AsPredicted,
    /// More different than that.
    More,
    /// Less: they share data, or both claim less than they know.
    Less,
    /// It is not known how uncertain they are.
    NotPredicted,
}

impl Judgement {
    /// In words.
    pub const fn word(self) -> &'static str {
        match self {
            Self::AsPredicted => "as different as their uncertainties predict",
            Self::More => "more different than their uncertainties predict",
            Self::Less => {
                "less different than their uncertainties predict: they share data, or both claim less than they know"
            }
            Self::NotPredicted => {
                "not predicted: not both hold the corners that say how uncertain they are"
            }
        }
    }
}

/// The difference of two rigs.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// What it is held against.
    pub judgement: Judgement,
    /// Points compared; 0 of a camera alone.
    pub points: usize,
    /// RMS distance of the points of the same pixels, mm; of a camera alone, of its rays at the working
    /// distance.
    pub rms_mm: f64,
    /// The largest, mm.
    pub max_mm: f64,
    /// What both uncertainties make of the RMS, mm.
    pub predicted_rms_mm: Option<f64>,
    /// The RMS over the predicted one.
    pub ratio: Option<f64>,
    /// Where the ratio falls by chance in 999 of 1000 cases.
    pub ratio_by_chance: Option<[f64; 2]>,
    /// Distances from the first camera, mm: of the points; the middle one is that of the maps.
    pub distances_mm: Vec<f64>,
    /// Per camera.
    pub cameras: Vec<CameraDifference>,
}

/// The difference over the sensor of one camera.
#[derive(Debug, Clone, Serialize)]
pub struct CameraDifference {
    /// The camera.
    pub name: String,
    /// RMS over the area that both are calibrated in, px.
    pub rms_px: f64,
    /// The largest, px.
    pub max_px: f64,
    /// A coarse map, row by row.
    pub map: Vec<Place>,
}

/// The difference at one pixel.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Place {
    /// The pixel.
    pub u: f64,
    /// The pixel.
    pub v: f64,
    /// How far the second rig sees what the first sees there, px.
    pub px: f64,
    /// The same at the middle distance, across the ray, mm.
    pub mm: f64,
}

/// Compares two rigs with the same cameras in the same order, at some distances from the first camera
/// (least, middle, largest, mm). `estimates`: both with their rigs, if they are there; they say how uncertain
/// the rigs are.
///
/// `None` if they have no calibrated pixels in common that see the same points.
pub fn difference(
    first: &Rig,
    second: &Rig,
    distances_mm: &[f64],
    estimates: Option<Halves>,
) -> Option<Difference> {
    let middle_mm = *distances_mm.get(1)?;
    let (first_from_second, points) = placement(first, second, distances_mm)?;
    let cameras: Vec<CameraDifference> = first
        .cameras
        .iter()
        .zip(&second.cameras)
        .map(|(a, b)| of_camera(a, b, &first_from_second, middle_mm))
        .collect::<Option<_>>()?;
    let (count, rms_mm, max_mm) = if let Some(points) = points {
        points
    } else {
        let map = &cameras.first()?.map;
        let sum: f64 = map.iter().map(|place| place.mm * place.mm).sum();
        let most = map.iter().map(|place| place.mm).fold(0.0, f64::max);
        (0, (sum / map.len() as f64).sqrt(), most)
    };
    let predicted = estimates.and_then(|mut both| both.compared(first, distances_mm).ok());
    let judged = predicted.map(|found| (rms_mm / found.predicted_rms_mm, found.ratio_by_chance));
    Some(Difference {
        judgement: match judged {
            None => Judgement::NotPredicted,
            Some((ratio, by_chance)) if ratio > by_chance[1] => Judgement::More,
            Some((ratio, by_chance)) if ratio < by_chance[0] => Judgement::Less,
            Some(_) => Judgement::AsPredicted,
        },
        points: count,
        rms_mm,
        max_mm,
        predicted_rms_mm: predicted.map(|found| found.predicted_rms_mm),
        ratio: judged.map(|(ratio, _)| ratio),
        ratio_by_chance: judged.map(|(_, by_chance)| by_chance),
        distances_mm: distances_mm.to_vec(),
        cameras,
    })
}

/// Number of points, their RMS and largest difference, mm.
type Points = (usize, f64, f64);

/// The second rig's frame in the first's, by points of the same pixels; of a camera alone, by its rays.
fn placement(
    first: &Rig,
    second: &Rig,
    distances_mm: &[f64],
) -> Option<(RigidTransform, Option<Points>)> {
    if first.cameras.len() > 1 {
        let matches = matches_at(first, distances_mm);
        let compared = compare(first, second, &matches)?;
        let found = compared.difference;
        let points = (found.points, found.rms_mm, found.max_mm);
        return Some((compared.first_from_second, Some(points)));
    }
    let (a, b) = (first.cameras.first()?, second.cameras.first()?);
    let mut pixels = lattice(&a.coverage, 1.0);
    pixels.retain(|pixel| b.coverage.contains(*pixel));
    let along = |camera: &CalibratedCamera| -> Vec<Vector3<f64>> {
        let at = |pixel: &PixelPoint| {
            let ray = camera
                .field
                .ray(*pixel)
                .transformed(&camera.rig_from_camera);
            let direction = ray.direction.normalize();
            distances_mm
                .iter()
                .map(|distance| ray.origin_mm + direction * *distance)
                .collect::<Vec<_>>()
        };
        pixels.iter().flat_map(at).collect()
    };
    Some((best_placement(&along(b), &along(a))?, None))
}

fn of_camera(
    first: &CalibratedCamera,
    second: &CalibratedCamera,
    first_from_second: &RigidTransform,
    distance_mm: f64,
) -> Option<CameraDifference> {
    let second_from_rig = (*first_from_second * second.rig_from_camera).inverse();
    let place = |pixel: PixelPoint| {
        second.coverage.contains(pixel).then_some(())?;
        let ray = first.ray_in_rig(pixel)?;
        let point = ray.origin_mm + ray.direction.normalize() * distance_mm;
        let in_second = second_from_rig.point(&point);
        let seen = second.field.project(&in_second)?;
        let other = second.field.ray(pixel);
        let direction = other.direction.normalize();
        let away = in_second - other.origin_mm;
        Some(Place {
            u: pixel.u,
            v: pixel.v,
            px: (seen.u - pixel.u).hypot(seen.v - pixel.v),
            mm: (away - direction * direction.dot(&away)).norm(),
        })
    };
    let map: Vec<Place> = lattice(&first.coverage, 1.0)
        .into_iter()
        .filter_map(place)
        .collect();
    let sum: f64 = map.iter().map(|place| place.px * place.px).sum();
    (!map.is_empty()).then(|| CameraDifference {
        name: first.name.clone(),
        rms_px: (sum / map.len() as f64).sqrt(),
        max_px: map.iter().map(|place| place.px).fold(0.0, f64::max),
        map,
    })
}
