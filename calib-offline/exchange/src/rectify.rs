//! A rectified stereo pair: two ideal pinholes side by side with rows (or columns) in common, their maps, and `OpenCV`'s matrices.
//!
//! Quirks. `R1`, `R2` turn the frames of the lenses that come nearest (those of `--format opencv`) into the pair's; `P1`, `P2`, `Q` are as
//! `cv::stereoRectify` has them: `P2`'s last column is the focal length times the second camera's shift (mm), below zero where the second one stands right of the
//! first; `Q` makes mm of (u, v, disparity, 1) in the first view's frame. The principal points differ along the baseline, each view showing the middle of its
//! camera's picture, as without `CALIB_ZERO_DISPARITY`; `Q` knows. Cameras one above the other get columns in common, `P2[1][3]`.
//! Maps are those of `--format remap`. Lost: rays are exact at the distance only, where cameras are not central.

use super::NamedFile;
use super::dense::text;
use super::error::ExchangeError;
use super::projector::Projector;
use super::view::{View, ViewMap, units};
use super::yaml::matrix;
use calib_blob::rays::RaySource;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde_json::json;

/// The JSON beside the maps.
pub const INDEX: &str = "rectify.json";
/// The same matrices for `cv::FileStorage`.
pub const MATRICES: &str = "rectify.yml";
/// Rays farther off the pair's axis do not say where its middle is: the cosine of 60 degrees.
const LEAST_COSINE: f64 = 0.5;
/// Places along a side at which the middle of a picture, and what both see, are looked for.
const PLACES: u32 = 48;

/// A rectified pair.
#[derive(Debug, Clone, PartialEq)]
pub struct Rectified {
    /// Both views.
    pub maps: [ViewMap; 2],
    /// `R1` and `R2`.
    pub rotations: [Matrix3<f64>; 2],
    /// `P1` and `P2`, row by row.
    pub projections: [[f64; 12]; 2],
    /// `Q`, row by row.
    pub to_points: [f64; 16],
    /// Whether rows are in common, and not columns.
    pub is_side_by_side: bool,
}

/// Rectifies the two cameras of a rig for a plane at a distance.
///
/// # Errors
/// [`ExchangeError`]: not two cameras, or they see nothing together.
pub fn rectified(source: &dyn RaySource, distance_mm: f64) -> Result<Rectified, ExchangeError> {
    let cameras = source.cameras();
    let [first, second] = &cameras[..] else {
        return Err(ExchangeError::NoPair {
            have: cameras.len(),
        });
    };
    let no_overlap = || ExchangeError::NoOverlap {
        first: first.name.clone(),
        second: second.name.clone(),
        distance_mm,
    };
    let projectors = [
        Projector::new(source, 0, first, distance_mm)?,
        Projector::new(source, 1, second, distance_mm)?,
    ];
    let places = projectors
        .each_ref()
        .map(|camera| camera.lens.rig_from_pinhole);
    let (rig_from_pair, is_side_by_side) = pair_axes(&places).ok_or_else(no_overlap)?;
    let lenses = projectors.each_ref().map(|camera| camera.lens.lens);
    let focal_px = lenses.iter().flat_map(|lens| lens.focal_px).sum::<f64>() / 4.0;
    let middle = |camera_idx: usize| {
        middle_of(
            source,
            camera_idx,
            lenses[camera_idx].sensor,
            &rig_from_pair,
        )
    };
    let middles = [
        middle(0).ok_or_else(no_overlap)?,
        middle(1).ok_or_else(no_overlap)?,
    ];
    // Both views have one size, so that rows or columns are in common.
    let size = lenses[0].sensor;
    let center = size.center();
    let mut centers = middles.map(|at| [center.u - focal_px * at.x, center.v - focal_px * at.y]);
    let across = usize::from(is_side_by_side);
    let common = (centers[0][across] + centers[1][across]) / 2.0;
    for own in &mut centers {
        own[across] = common;
    }
    let view = |k: usize| View {
        camera: cameras[k].name.clone(),
        size,
        focal_px: [focal_px; 2],
        center_px: centers[k],
        rig_from_view: RigidTransform::new(rig_from_pair, places[k].translation_mm),
        plane_mm: distance_mm,
    };
    if !overlap([&view(0), &view(1)], [&projectors[0], &projectors[1]]) {
        return Err(no_overlap());
    }
    let shift = rig_from_pair.transpose() * (places[0].translation_mm - places[1].translation_mm);
    let along = usize::from(!is_side_by_side);
    let mut projections = centers.map(|[cx, cy]| {
        [
            focal_px, 0.0, cx, 0.0, 0.0, focal_px, cy, 0.0, 0.0, 0.0, 1.0, 0.0,
        ]
    });
    projections[1][4 * along + 3] = focal_px * shift[along];
    let ([cx, cy], apart_px) = (centers[0], centers[0][along] - centers[1][along]);
    let to_points = [
        1.0,
        0.0,
        0.0,
        -cx,
        0.0,
        1.0,
        0.0,
        -cy,
        0.0,
        0.0,
        0.0,
        focal_px,
        0.0,
        0.0,
        -1.0 / shift[along],
        apart_px / shift[along],
    ];
    Ok(Rectified {
        maps: [view(0).map(&projectors[0]), view(1).map(&projectors[1])],
        rotations: places.map(|place| rig_from_pair.transpose() * place.rotation),
        projections,
        to_points,
        is_side_by_side,
    })
}

/// The axes of a pair in the rig's frame, and whether its cameras stand side by side and not one above the other. `None` where they look apart or along
/// the line between them.
pub(super) fn pair_axes(places: &[RigidTransform; 2]) -> Option<(Matrix3<f64>, bool)> {
    let mean = |axis: usize| places[0].rotation.column(axis) + places[1].rotation.column(axis);
    let between = places[1].translation_mm - places[0].translation_mm;
    let is_side_by_side = between.dot(&mean(0)).abs() >= between.dot(&mean(1)).abs();
    let sideways = mean(usize::from(!is_side_by_side));
    let along = between.try_normalize(0.0)?;
    let along = if along.dot(&sideways) < 0.0 {
        -along
    } else {
        along
    };
    let forwards = mean(2).try_normalize(0.1)?;
    let forwards = (forwards - along * along.dot(&forwards)).try_normalize(0.1)?;
    let axes = if is_side_by_side {
        [along, forwards.cross(&along), forwards]
    } else {
        [along.cross(&forwards), along, forwards]
    };
    Some((Matrix3::from_columns(&axes), is_side_by_side))
}

/// The mean place of a camera's rays in an ideal picture of the pair.
fn middle_of(
    source: &dyn RaySource,
    camera_idx: usize,
    sensor: SensorSize,
    rig_from_pair: &Matrix3<f64>,
) -> Option<Vector2<f64>> {
    let (mut sum, mut count) = (Vector2::zeros(), 0.0);
    for pixel in places(sensor) {
        let Some(ray) = source.ray(camera_idx, pixel) else {
            continue;
        };
        let direction: Vector3<f64> = rig_from_pair.transpose() * ray.direction;
        if direction.z >= LEAST_COSINE {
            sum += direction.xy() / direction.z;
            count += 1.0;
        }
    }
    (count > 0.0).then(|| sum / count)
}

/// Pixels of a coarse lattice.
fn places(size: SensorSize) -> impl Iterator<Item = PixelPoint> {
    let at = |k: u32, length: u32| f64::from(k) / f64::from(PLACES) * f64::from(length - 1);
    (0..=PLACES).flat_map(move |j| {
        (0..=PLACES).map(move |i| PixelPoint::new(at(i, size.width), at(j, size.height)))
    })
}

/// Whether both cameras see a point of the plane that the first view shows.
fn overlap(views: [&View; 2], cameras: [&Projector<'_>; 2]) -> bool {
    places(views[0].size).any(|pixel| {
        let point = views[0]
            .rig_from_view
            .point(&views[0].point(pixel, views[0].plane_mm));
        cameras.iter().all(|camera| camera.pixel(&point).is_some())
    })
}

impl Rectified {
    /// The files.
    ///
    /// # Errors
    /// Those of `serde_json`.
    pub fn files(&self) -> Result<Vec<NamedFile>, serde_json::Error> {
        let mut files: Vec<NamedFile> = self.maps.iter().flat_map(ViewMap::files).collect();
        let turns = self
            .rotations
            .map(|turn| turn.transpose().as_slice().to_vec());
        let size = self.maps[0].view.size;
        let index = json!({
            "schema": "calib-offline/rectify/1",
            "image_size": [size.width, size.height],
            "side_by_side": self.is_side_by_side,
            "R1": turns[0],
            "R2": turns[1],
            "P1": self.projections[0],
            "P2": self.projections[1],
            "Q": self.to_points,
            "matrices": "row by row; R 3 x 3 from the camera's frame (--format opencv), P 3 x 4 (px, px mm), Q 4 x 4 (mm)",
            "units": units(),
            "views": self.maps.iter().map(ViewMap::entry).collect::<Vec<_>>(),
        });
        files.push((INDEX.to_owned(), text(&index)?));
        let mut storage = format!(
            "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n",
            size.width, size.height
        );
        let tag = " !!opencv-matrix";
        for (k, key) in ["1", "2"].into_iter().enumerate() {
            storage += &matrix(&format!("R{key}"), tag, [3, 3], &turns[k]);
            storage += &matrix(&format!("P{key}"), tag, [3, 4], &self.projections[k]);
        }
        storage += &matrix("Q", tag, [4, 4], &self.to_points);
        files.push((MATRICES.to_owned(), storage.into_bytes()));
        Ok(files)
    }
}
