//! The map of NXP's dewarper DW100 (i.MX 8M Plus).
//!
//! One word of 32 bits, little-endian, a vertex of the blocks of 16 x 16 px: the camera's pixel, y in the upper and x in the lower half, each with 12 integer
//! and 4 fraction bits and no sign (UQ12.4), rounded to the nearest 1/16 px. There are `ceil(width / 16) + 1` vertices in a row and
//! `ceil(height / 16) + 1` rows. It is what the control `V4L2_CID_DW100_DEWARPING_16x16_VERTEX_MAP` takes.
//!
//! Quirks. Where 16 does not divide the size, the last block is the remainder, so the last vertices lie at width and height. No vertex can lie left
//! of or above the camera's first pixel (nor at 4096 and beyond): those that would are held back at 0, and blocks at the edge lose by it,
//! which the loss holds. The driver takes 176 x 144 to 4096 x 3072 px in steps of 8. It does not say how the bilinear mean of
//! four vertices is rounded: the loss is the worst of not at all, down, and to the nearest 1/16 px.
//!
//! Sources: Linux, `Documentation/userspace-api/media/drivers/dw100.rst` and the driver's limits and identity map (from which it follows that vertex k lies
//! at pixel 16 k). The chip was not run.

use super::error::MeshError;
use super::format::{Camera, Format, fixed};
use super::grid::{Grid, Layout};
use serde_json::{Value, json};

pub(super) const FORMAT: Format = Format {
    name: "mesh-dw100",
    default_step: BLOCK_PX,
    layout,
    check: |_, _| Ok(()),
    round,
    bytes,
    file: |camera| format!("dw100_{camera}.bin"),
    facts,
};

const BLOCK_PX: u32 = 16;
const STEPS_PER_PX: f64 = 16.0;
const RANGE_PX: [f64; 2] = [0.0, 4095.9375];

fn layout(camera: &Camera<'_>, step: u32) -> Result<Layout, MeshError> {
    if step != BLOCK_PX {
        return Err(MeshError::Step {
            format: FORMAT.name,
            step,
            steps: "16, or leave it out",
        });
    }
    let [width, height] = camera.size();
    let is_taken = (176..=4096).contains(&width)
        && (144..=3072).contains(&height)
        && width.is_multiple_of(8)
        && height.is_multiple_of(8);
    if !is_taken {
        return Err(MeshError::Sensor {
            format: FORMAT.name,
            camera: camera.name.to_owned(),
            sensor: camera.size(),
            takes: "176 x 144 to 4096 x 3072 px in steps of 8 px",
        });
    }
    let mut layout = Layout {
        steps_per_px: Some(STEPS_PER_PX),
        ..Layout::even(camera.size(), step)
    };
    for (nodes, end) in [(&mut layout.us, width), (&mut layout.vs, height)] {
        if let Some(last) = nodes.last_mut() {
            *last = end;
        }
    }
    Ok(layout)
}

fn round(grid: &mut Grid) -> usize {
    let mut held_back = 0;
    for node in &mut grid.at_px {
        let rounded = node.map(|number| fixed(number, STEPS_PER_PX, RANGE_PX));
        held_back += usize::from(rounded.iter().any(|(_, is_beyond)| *is_beyond));
        *node = rounded.map(|(number, _)| number);
    }
    held_back
}

fn bytes(grid: &Grid) -> Vec<u8> {
    let words = grid.at_px.iter().map(|node| {
        // Whole numbers of 16 bits: they were rounded.
        let [x, y] = node.map(|number| (number * STEPS_PER_PX) as u16);
        u32::from(y) << 16 | u32::from(x)
    });
    words.flat_map(u32::to_le_bytes).collect()
}

fn facts(grid: &Grid) -> Value {
    json!({
        "entry": "u32 little-endian, y in the upper and x in the lower 16 bits, 1/16 px, camera's pixel",
        "vertices_per_row": grid.layout.us.len(),
        "vertex_rows": grid.layout.vs.len(),
        "control": "V4L2_CID_DW100_DEWARPING_16x16_VERTEX_MAP",
    })
}
