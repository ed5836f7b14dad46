//! Maps that undistort the pictures of each camera: `cv::remap` takes them.
//!
//! Quirks. The view has the axes, the focal lengths, the principal point and the size of the lens that comes nearest to the camera, so that it shows what
//! `cv::undistort` would. Float maps are `CV_32FC2`; in whole numbers they are the pair that `cv::convertMaps` makes. `OpenCV` 4 takes floats in
//! 32nds of a pixel too, whatever is said; 5 does not. A pixel that no ray reaches is -1 in the maps and 0 in the mask: with a constant border it becomes the border. Lost: where a
//! camera is not central, things at other distances are beside their place.

use super::NamedFile;
use super::dense::text;
use super::error::ExchangeError;
use super::projector::Projector;
use super::view::{View, ViewMap, units};
use calib_blob::rays::RaySource;
use serde_json::json;

/// The JSON beside the maps.
pub const INDEX: &str = "remap.json";

/// The undistorted view of each camera, exact for a plane at the distance.
///
/// # Errors
/// [`ExchangeError`].
pub fn maps(source: &dyn RaySource, distance_mm: f64) -> Result<Vec<ViewMap>, ExchangeError> {
    let cameras = source.cameras();
    let maps = cameras.iter().enumerate().map(|(camera_idx, camera)| {
        let projector = Projector::new(source, camera_idx, camera, distance_mm)?;
        let lens = &projector.lens.lens;
        let view = View {
            camera: camera.name.clone(),
            size: lens.sensor,
            focal_px: lens.focal_px,
            center_px: lens.center_px,
            rig_from_view: projector.lens.rig_from_pinhole,
            plane_mm: distance_mm,
        };
        Ok(view.map(&projector))
    });
    maps.collect()
}

/// The files.
///
/// # Errors
/// Those of `serde_json`.
pub fn files(maps: &[ViewMap]) -> Result<Vec<NamedFile>, serde_json::Error> {
    let mut files: Vec<NamedFile> = maps.iter().flat_map(ViewMap::files).collect();
    let index = json!({
        "schema": "calib-offline/remap/1",
        "units": units(),
        "views": maps.iter().map(ViewMap::entry).collect::<Vec<_>>(),
    });
    files.push((INDEX.to_owned(), text(&index)?));
    Ok(files)
}
