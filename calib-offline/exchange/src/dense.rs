//! The ray of every pixel as `NumPy` arrays, and a JSON of shapes and units. Lost: uncertainty, and what lies between pixels.

use super::NamedFile;
use calib_blob::rays::RaySource;
use calib_rays::field::ray_table::RayTable;
use serde_json::json;

/// The JSON beside the arrays.
pub const INDEX: &str = "rays.json";

/// The array's file of a camera.
pub fn array_name(camera: &str) -> String {
    format!("rays_{camera}.npy")
}

/// The files: an array a camera and [`INDEX`]. An array has the shape (height, width, 6) of little-endian f64 in C order: origin
/// (mm) and unit direction in the rig's frame, NaN where nothing is calibrated. Cost: 48 bytes a pixel, held in memory twice.
///
/// # Errors
/// Those of `serde_json`.
pub fn files(source: &dyn RaySource) -> Result<Vec<NamedFile>, serde_json::Error> {
    let mut files = Vec::new();
    let mut index = Vec::new();
    for (camera_idx, camera) in source.cameras().iter().enumerate() {
        let table = RayTable::new(camera.sensor, |pixel| source.ray(camera_idx, pixel));
        let file = array_name(&camera.name);
        let shape = [camera.sensor.height, camera.sensor.width, 6];
        index.push(json!({ "camera": camera.name, "file": file, "shape": shape, "dtype": "<f8" }));
        files.push((file, table.to_npy()));
    }
    let index = json!({
        "schema": "calib-offline/rays-npy/1",
        "frame": "rig",
        "axes": ["row v", "column u", "ox oy oz dx dy dz"],
        "units": ["mm", "mm", "mm", "unit direction", "unit direction", "unit direction"],
        "pixel_origin": "center of the top-left pixel is (0, 0)",
        "outside": "NaN",
        "arrays": index,
    });
    let mut text = serde_json::to_vec_pretty(&index)?;
    text.push(b'\n');
    files.push((INDEX.to_owned(), text));
    Ok(files)
}
