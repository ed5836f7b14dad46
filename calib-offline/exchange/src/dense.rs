//! The ray of every pixel as `NumPy` arrays, with masks, what is known of their uncertainty, and a JSON of shapes and units.
//!
//! Lost: what lies between pixels. A blob does not hand out its uncertainty: take the calibration.

use super::{NamedFile, npy};
use calib_blob::rays::{RaySource, SourceCamera};
use calib_rays::field::PairUncertainty;
use calib_rays::field::ray_table::RayTable;
use serde_json::{Value, json};

/// The JSON beside the arrays.
pub const INDEX: &str = "rays.json";
/// What a mask has where there is a ray; else 0.
pub(super) const IN_MASK: u8 = 255;

/// The array's file of a camera.
pub fn array_name(camera: &str) -> String {
    format!("rays_{camera}.npy")
}

/// The files: an array and a mask a camera, an array a pair whose uncertainty is known, and [`INDEX`].
///
/// An array has the shape (height, width, 6) of little-endian f64 in C order: origin (mm) and unit direction in the rig's frame, NaN where
/// nothing is calibrated. A mask has (height, width) of u8: 255 where there is a ray, else 0. Cost: 49 bytes a pixel, held in memory twice.
///
/// # Errors
/// Those of `serde_json`.
pub fn files(source: &dyn RaySource) -> Result<Vec<NamedFile>, serde_json::Error> {
    let mut files = Vec::new();
    let mut arrays = Vec::new();
    let mut masks = Vec::new();
    let cameras = source.cameras();
    for (camera_idx, camera) in cameras.iter().enumerate() {
        let table = RayTable::new(camera.sensor, |pixel| source.ray(camera_idx, pixel));
        let file = array_name(&camera.name);
        let (height, width) = (camera.sensor.height as usize, camera.sensor.width as usize);
        arrays.push(json!({ "camera": camera.name, "file": file, "shape": [height, width, 6], "dtype": "<f8" }));
        files.push((file, table.to_npy()));
        let file = format!("mask_{}.npy", camera.name);
        let in_mask = |ray: &Option<_>| if ray.is_some() { IN_MASK } else { 0 };
        let mask: Vec<u8> = table.rays.iter().map(in_mask).collect();
        masks.push(json!({ "camera": camera.name, "file": file, "shape": [height, width], "dtype": "|u1" }));
        files.push((file, npy::file("|u1", &[height, width], &mask)));
    }
    let mut pairs = Vec::new();
    for pair in source.uncertainty() {
        if let Some((file, entry)) = uncertainty(&pair, &cameras) {
            files.push(file);
            pairs.push(entry);
        }
    }
    let index = json!({
        "schema": "calib-offline/rays-npy/1",
        "frame": "rig",
        "axes": ["row v", "column u", "ox oy oz dx dy dz"],
        "units": ["mm", "mm", "mm", "unit direction", "unit direction", "unit direction"],
        "pixel_origin": "center of the top-left pixel is (0, 0)",
        "outside": "NaN",
        "arrays": arrays,
        "masks": masks,
        "uncertainty": pairs,
    });
    files.push((INDEX.to_owned(), text(&index)?));
    Ok(files)
}

/// A JSON file.
pub(super) fn text(value: &Value) -> Result<Vec<u8>, serde_json::Error> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    Ok(text)
}

/// The covariances of a pair on the nodes of its grid, and what the JSON says of them.
fn uncertainty(pair: &PairUncertainty, cameras: &[SourceCamera]) -> Option<(NamedFile, Value)> {
    let [first, second] = [cameras.get(pair.first)?, cameras.get(pair.second)?];
    let file = format!("uncertainty_{}_{}.npy", first.name, second.name);
    let shape = [pair.nodes_v, pair.nodes_u, 4, 4];
    let mut bytes = Vec::new();
    for packed in &pair.calibration_px2 {
        let matrix = calib_rays::field::uncertainty::unpacked(packed);
        bytes.extend(matrix.iter().flat_map(|value| value.to_le_bytes()));
    }
    let along = |nodes: usize, of: &dyn Fn(usize) -> f64| (0..nodes).map(of).collect::<Vec<_>>();
    let entry = json!({
        "first": first.name,
        "second": second.name,
        "file": file,
        "shape": shape,
        "dtype": "<f8",
        "axes": ["node along v", "node along u", "u v of first, u v of second", "the same"],
        "units": "px^2",
        "what": "covariance that the calibration leaves where both cameras see one point, by the first one's pixel; bilinear between nodes",
        "node_u_px": along(pair.nodes_u, &|i| pair.node(i, 0).u),
        "node_v_px": along(pair.nodes_v, &|j| pair.node(0, j).v),
        "noise_px2": pair.noise_px2,
    });
    Some(((file, npy::file("<f8", &shape, &bytes)), entry))
}
