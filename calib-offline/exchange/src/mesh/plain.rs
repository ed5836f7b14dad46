//! A mesh for whatever has no format of its own: an array of `NumPy`, and the JSON beside it.
//!
//! The array has the shape (rows, columns, 2) of little-endian f64 in C order: the camera's pixel of each node, x then y. Nodes lie a step apart, any
//! number of pixels, from pixel 0 to the first that is no less than width and height. Between them it is bilinear.

use super::error::MeshError;
use super::format::{Camera, Format};
use super::grid::{Grid, Layout};
use crate::npy;
use serde_json::{Value, json};

pub(super) const FORMAT: Format = Format {
    name: "mesh",
    default_step: 16,
    layout,
    check: |_, _| Ok(()),
    round: |_| 0,
    bytes,
    file: |camera| format!("mesh_{camera}.npy"),
    facts,
};

fn layout(camera: &Camera<'_>, step: u32) -> Result<Layout, MeshError> {
    let [width, height] = camera.size();
    if step == 0 || step > width.max(height) {
        return Err(MeshError::Step {
            format: FORMAT.name,
            step,
            steps: "of 1 to the width of the image",
        });
    }
    Ok(Layout::even(camera.size(), step))
}

fn bytes(grid: &Grid) -> Vec<u8> {
    let shape = [grid.layout.vs.len(), grid.layout.us.len(), 2];
    let numbers = grid.at_px.iter().flatten();
    let bytes: Vec<u8> = numbers.flat_map(|x| x.to_le_bytes()).collect();
    npy::file("<f8", &shape, &bytes)
}

fn facts(grid: &Grid) -> Value {
    json!({
        "entry": "f64 x, f64 y, little-endian, camera's pixel",
        "shape": [grid.layout.vs.len(), grid.layout.us.len(), 2],
        "dtype": "<f8",
    })
}
