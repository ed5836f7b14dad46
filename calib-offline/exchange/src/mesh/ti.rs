//! The mesh of TI's LDC (lens distortion correction in the VPAC of TDA4, `AM6xA`).
//!
//! A table of offsets, one entry of 32 bits a node: 16 bits dy, then 16 bits dx, little-endian, so that dx is the upper half of the word. An offset is
//! the camera's pixel less the output pixel, two's complement with three fraction bits (1/8 px), rounded to the nearest.
//!
//! Nodes lie 2^m px apart, m = 0 to 7, from pixel 0 to the first that is no less than width and height. A row of the table is filled up
//! with zeros to a multiple of 16 entries.
//!
//! Quirks. Readers of the table reckon `frame / 2^m + 1` nodes and drop the rest, so a frame that 2^m does not divide would lack its last
//! node: `mesh_frame_width` and `mesh_frame_height` are the size rounded up, and are to be told to the chip. How it rounds the
//! bilinear mean of four offsets is not documented: the loss is the worst of not at all, down, and to the nearest 1/8 px. The table of TI's
//! tuning tool, a text of two columns, has dx first; the binary has dy first.
//!
//! Sources: technical reference manual SPRUJ28 (LDC, offset table and back mapping); TI's `vision_apps` and `edgeai-tiovx-modules` (size of the table),
//! the read-me of its stereo application for ROS (order, rounding, filling). The chip was not run.

use super::error::MeshError;
use super::format::{Camera, Format, check_power_of_two, fixed};
use super::grid::{Grid, Layout};
use serde_json::{Value, json};

pub(super) const FORMAT: Format = Format {
    name: "mesh-ti",
    default_step: 16,
    layout,
    check,
    round,
    bytes,
    file: |camera| format!("ldc_{camera}.bin"),
    facts,
};

const STEPS_PER_PX: f64 = 8.0;
/// Of 16 bits, px.
const RANGE_PX: [f64; 2] = [-4096.0, 4095.875];
/// A row has a multiple of so many entries.
const ENTRIES: usize = 16;

fn layout(camera: &Camera<'_>, step: u32) -> Result<Layout, MeshError> {
    check_power_of_two(FORMAT.name, step, 7, "1, 2, 4, 8, 16, 32, 64 or 128")?;
    Ok(Layout {
        steps_per_px: Some(STEPS_PER_PX),
        ..Layout::even(camera.size(), step)
    })
}

/// By how much a node's place is off the output pixel, px.
fn offset_px(grid: &Grid, k: usize) -> [f64; 2] {
    let Layout { us, vs, .. } = &grid.layout;
    let node = grid.at_px[k];
    [
        node[0] - f64::from(us[k % us.len()]),
        node[1] - f64::from(vs[k / us.len()]),
    ]
}

/// Nodes that nothing calibrated sees may be held back: they are made up.
fn check(camera: &Camera<'_>, grid: &Grid) -> Result<(), MeshError> {
    let seen = (0..grid.at_px.len()).filter(|k| grid.is_seen[*k]);
    let mut offsets = seen.flat_map(|k| offset_px(grid, k));
    match offsets.find(|offset| fixed(*offset, STEPS_PER_PX, RANGE_PX).1) {
        Some(offset_px) => Err(MeshError::Range {
            format: FORMAT.name,
            camera: camera.name.to_owned(),
            offset_px,
            least_px: RANGE_PX[0],
            most_px: RANGE_PX[1],
        }),
        None => Ok(()),
    }
}

fn round(grid: &mut Grid) -> usize {
    let mut held_back = 0;
    for k in 0..grid.at_px.len() {
        let offset = offset_px(grid, k);
        let rounded = offset.map(|offset| fixed(offset, STEPS_PER_PX, RANGE_PX));
        held_back += usize::from(rounded.iter().any(|(_, is_beyond)| *is_beyond));
        let columns = grid.layout.us.len();
        let at = [grid.layout.us[k % columns], grid.layout.vs[k / columns]];
        grid.at_px[k] = [0, 1].map(|axis| f64::from(at[axis]) + rounded[axis].0);
    }
    held_back
}

fn bytes(grid: &Grid) -> Vec<u8> {
    let Layout { us, vs, .. } = &grid.layout;
    let filling = vec![0; 4 * (us.len().next_multiple_of(ENTRIES) - us.len())];
    let mut bytes = Vec::new();
    for (v, row) in vs.iter().zip(grid.at_px.chunks(us.len())) {
        for (u, node) in us.iter().zip(row) {
            // Whole numbers of 16 bits: they were rounded.
            let [dx, dy] = [node[0] - f64::from(*u), node[1] - f64::from(*v)]
                .map(|offset| (offset * STEPS_PER_PX) as i16);
            bytes.extend(dy.to_le_bytes());
            bytes.extend(dx.to_le_bytes());
        }
        bytes.extend(&filling);
    }
    bytes
}

fn facts(grid: &Grid) -> Value {
    let Layout { us, vs, step, .. } = &grid.layout;
    let entries = us.len().next_multiple_of(ENTRIES);
    json!({
        "entry": "i16 dy, i16 dx, little-endian, 1/8 px, camera's pixel less output pixel",
        "table_entries_per_row": entries,
        "table_bytes_per_row": 4 * entries,
        "table_rows": vs.len(),
        "subsample_factor": step.trailing_zeros(),
        "mesh_frame_width": us.last(),
        "mesh_frame_height": vs.last(),
    })
}
