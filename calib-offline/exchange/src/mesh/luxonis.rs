//! The mesh of Luxonis' `DepthAI`: `StereoDepth.loadMeshFiles` and `loadMeshData`.
//!
//! Two f32 a node, y then x, little-endian, row by row without gaps: the camera's pixel. Nodes lie `setMeshStep` apart, 16 px by default,
//! `width / step + 1` in a row and `height / step + 1` rows.
//!
//! Quirks. A pair's meshes must rectify: a mesh takes the place of the whole rectification, not of the distortion alone. So with two
//! cameras, and none chosen with `--camera`, the output images are a rectified pair, and the JSON has its one camera matrix and the two
//! places. `Warp.setWarpMesh` takes x then y and turns them around itself: swap the columns for it. The step must divide width and
//! height (Luxonis' own example drops the rest), and the chip wants widths that 16 divides. Luxonis' example ends the mesh at the last pixel instead
//! of one beyond; here the last nodes are where they belong.
//!
//! Sources: `depthai-core`, `StereoDepth.hpp` (order, size) and `Warp.cpp`; `stereo_depth_custom_mesh.py`. That the chip interpolates bilinearly
//! is not documented. It was not run.

use super::error::MeshError;
use super::format::{Camera, Format, floats, round_to_f32};
use super::grid::{Grid, Layout};
use serde_json::{Value, json};

pub(super) const FORMAT: Format = Format {
    name: "mesh-luxonis",
    default_step: 16,
    layout,
    check: |_, _| Ok(()),
    round: round_to_f32,
    bytes: |grid| floats(grid, [1, 0]),
    file: |camera| format!("{camera}_mesh.calib"),
    facts,
};

fn layout(camera: &Camera<'_>, step: u32) -> Result<Layout, MeshError> {
    // `setMeshStep` holds 16 bits.
    if !(1..=u32::from(u16::MAX)).contains(&step) {
        return Err(MeshError::Step {
            format: FORMAT.name,
            step,
            steps: "of 1 to 65535",
        });
    }
    let size = camera.size();
    if size.iter().any(|length| !length.is_multiple_of(step)) {
        return Err(MeshError::Rest {
            format: FORMAT.name,
            camera: camera.name.to_owned(),
            sensor: size,
            step,
        });
    }
    if !size[0].is_multiple_of(16) {
        return Err(MeshError::Sensor {
            format: FORMAT.name,
            camera: camera.name.to_owned(),
            sensor: size,
            takes: "widths that 16 divides",
        });
    }
    Ok(Layout::even(size, step))
}

fn facts(grid: &Grid) -> Value {
    json!({
        "entry": "f32 y, f32 x, little-endian, camera's pixel",
        "nodes_per_row": grid.layout.us.len(),
        "node_rows": grid.layout.vs.len(),
        "mesh_step": [grid.layout.step, grid.layout.step],
    })
}
