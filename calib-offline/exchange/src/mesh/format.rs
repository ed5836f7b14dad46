//! What the formats of meshes have in common.

use super::error::MeshError;
use super::grid::{Grid, Layout};
use calib_rays::geometry::SensorSize;
use serde_json::Value;

/// A camera that a mesh is made for.
pub(super) struct Camera<'a> {
    pub name: &'a str,
    pub sensor: SensorSize,
}

impl Camera<'_> {
    pub fn size(&self) -> [u32; 2] {
        [self.sensor.width, self.sensor.height]
    }
}

/// A format of meshes.
pub(super) struct Format {
    /// Its name, as `export` has it.
    pub name: &'static str,
    pub default_step: u32,
    /// Where its nodes lie.
    pub layout: fn(&Camera<'_>, u32) -> Result<Layout, MeshError>,
    /// Refuses nodes that the format cannot hold and that must not be held back.
    pub check: fn(&Camera<'_>, &Grid) -> Result<(), MeshError>,
    /// Rounds the nodes to what the format holds; how many of them lay beyond it and were held back.
    pub round: fn(&mut Grid) -> usize,
    /// The file of rounded nodes.
    pub bytes: fn(&Grid) -> Vec<u8>,
    /// Its name.
    pub file: fn(&str) -> String,
    /// What its user needs beside the file.
    pub facts: fn(&Grid) -> Value,
}

/// Refuses a step that is no power of two from 1 to 2^`most`.
pub(super) fn check_power_of_two(
    format: &'static str,
    step: u32,
    most: u32,
    steps: &'static str,
) -> Result<(), MeshError> {
    if step.is_power_of_two() && step.trailing_zeros() <= most {
        Ok(())
    } else {
        Err(MeshError::Step {
            format,
            step,
            steps,
        })
    }
}

/// Rounds a number to a step, and holds it to a range; whether it lay beyond, by more than the rounding.
pub(super) fn fixed(value: f64, steps_per_px: f64, [least, most]: [f64; 2]) -> (f64, bool) {
    let steps = (value * steps_per_px + 0.5).floor();
    let held = steps.clamp(least * steps_per_px, most * steps_per_px);
    // NaN does not get here: nodes are finite.
    (held / steps_per_px, held != steps)
}

/// Numbers of four bytes, the lowest first, `order` saying which of x and y comes first.
pub(super) fn floats(grid: &Grid, order: [usize; 2]) -> Vec<u8> {
    let numbers = grid
        .at_px
        .iter()
        .flat_map(|node| order.map(|axis| node[axis]));
    numbers
        .flat_map(|number| (number as f32).to_le_bytes())
        .collect()
}

/// Rounds nodes to f32, which holds all of them.
pub(super) fn round_to_f32(grid: &mut Grid) -> usize {
    for node in &mut grid.at_px {
        *node = node.map(|number| f64::from(number as f32));
    }
    0
}
