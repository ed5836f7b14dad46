//! The warp map of NVIDIA's VPI (`VPIWarpMap`).
//!
//! Two f32 a control point, x then y, little-endian, row by row without gaps: the camera's pixel. The JSON has the numbers of the one region of
//! `VPIWarpGrid`. A program sets these, calls `vpiWarpMapAllocData`, and copies each row to its place (`pitchBytes`).
//!
//! Points. `vpiWarpMapAllocData` says itself how many there are, and does not document the rule. NVIDIA documents it for the same hardware in
//! `NvMedia`: the region rounded up to tiles of 64 x 16 px; with an interval of 1, a point for each of these pixels; with a larger one, an odd number, so many
//! that the last lies outside. So many are written. Where VPI has fewer, they are the first ones of each row, and the first rows.
//!
//! Quirks. With an interval of 1, the default here, every pixel has its point and nothing is interpolated. With a larger one VPI says
//! "bi-quadratic" and no more: taken is the parabola through three points each way, two intervals to a cell, which is what the odd
//! numbers fit; another one would lose something else. Intervals are powers of two; the region must be 64 px wide and 16 px high at least.
//! The format is that of Jetson's programs, whose memory is filled at run time: VPI itself reads no file.
//!
//! Sources: VPI's headers `WarpGrid.h` and `WarpMap.h`, its page on Remap, `NvMedia`'s `NvMediaLdcWarpMapParameters`. VPI was not run.

use super::error::MeshError;
use super::format::{Camera, Format, check_power_of_two, floats, round_to_f32};
use super::grid::{Between, Grid, Layout};
use serde_json::{Value, json};

pub(super) const FORMAT: Format = Format {
    name: "mesh-vpi",
    default_step: 1,
    layout,
    check: |_, _| Ok(()),
    round: round_to_f32,
    bytes: |grid| floats(grid, [0, 1]),
    file: |camera| format!("vpi_{camera}.f32"),
    facts,
};

/// Of the tiles that VPI works on, px.
const TILE_PX: [u32; 2] = [64, 16];
/// Sizes are `int16_t`.
const MOST_PX: u32 = 32_767;

fn layout(camera: &Camera<'_>, step: u32) -> Result<Layout, MeshError> {
    check_power_of_two(FORMAT.name, step, 6, "1, 2, 4, 8, 16, 32 or 64")?;
    let [width, height] = camera.size();
    let is_taken =
        (TILE_PX[0]..=MOST_PX).contains(&width) && (TILE_PX[1]..=MOST_PX).contains(&height);
    if !is_taken {
        return Err(MeshError::Sensor {
            format: FORMAT.name,
            camera: camera.name.to_owned(),
            sensor: camera.size(),
            takes: "64 x 16 to 32767 x 32767 px",
        });
    }
    let along = |length: u32, tile: u32| -> Vec<u32> {
        let tiled = length.next_multiple_of(tile);
        let count = if step == 1 {
            tiled
        } else {
            tiled.next_multiple_of(2 * step) / step + 1
        };
        (0..count).map(|k| k * step).collect()
    };
    Ok(Layout {
        us: along(width, TILE_PX[0]),
        vs: along(height, TILE_PX[1]),
        step,
        between: if step == 1 {
            Between::Bilinear
        } else {
            Between::Biquadratic
        },
        steps_per_px: None,
    })
}

fn facts(grid: &Grid) -> Value {
    json!({
        "entry": "f32 x, f32 y, little-endian, camera's pixel (VPIKeypointF32)",
        "points_per_row": grid.layout.us.len(),
        "point_rows": grid.layout.vs.len(),
        "numHorizRegions": 1,
        "numVertRegions": 1,
        "horizInterval": grid.layout.step,
        "vertInterval": grid.layout.step,
    })
}
