//! The nodes of a mesh: where the camera sees what the output image has there, and what a chip makes of the places between.

use super::straight::filled;
use super::view::View;
use crate::sight::{Sight, Target};
use calib_rays::geometry::PixelPoint;
use rayon::prelude::*;

/// What a chip does between nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Between {
    /// Bilinear within a cell.
    Bilinear,
    /// Through three nodes each way, a cell being two steps wide.
    Biquadratic,
}

/// Where the nodes lie, and what is made of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    /// Columns of the output image that have nodes, px; a `step` apart, only the last may be nearer.
    pub us: Vec<u32>,
    /// Rows.
    pub vs: Vec<u32>,
    pub step: u32,
    pub between: Between,
    /// Steps a pixel that the chip may round the place between nodes to: down, or to the nearest; `None` if it does not.
    pub steps_per_px: Option<f64>,
}

/// A mesh.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    pub layout: Layout,
    /// Row by row, the camera's pixel of each node.
    pub at_px: Vec<[f64; 2]>,
    /// Whether a calibrated pixel sees it; else the mesh goes straight on there.
    pub is_seen: Vec<bool>,
}

impl Layout {
    /// Nodes at every step, from 0 to the first that is no less than each of the ends.
    pub fn even([end_u, end_v]: [u32; 2], step: u32) -> Self {
        let along = |end: u32| (0..=end.div_ceil(step)).map(|k| k * step).collect();
        Self {
            us: along(end_u),
            vs: along(end_v),
            step,
            between: Between::Bilinear,
            steps_per_px: None,
        }
    }
}

impl Grid {
    /// The nodes' true places; `None` if none is seen.
    pub fn new(sight: &Sight<'_>, view: &View, layout: Layout, distance_mm: f64) -> Option<Self> {
        let from_mm = view.rig_from_view.translation_mm;
        let row = |v: &u32| -> Vec<Option<[f64; 2]>> {
            let mut before: [Option<PixelPoint>; 2] = [None; 2];
            let mut slope = None;
            let nodes = layout.us.iter().map(|u| {
                let point_mm = view.point_mm([f64::from(*u), f64::from(*v)], distance_mm);
                let near = match before {
                    [Some(last), Some(other)] => Some(PixelPoint::new(
                        2.0 * last.u - other.u,
                        2.0 * last.v - other.v,
                    )),
                    [last, _] => last,
                };
                let seen = sight.seen(&Target::new(point_mm, &from_mm), near, slope);
                before = [seen.map(|seen| seen.pixel), before[0]];
                slope = seen.map(|seen| seen.slope).or(slope);
                seen.map(|seen| [seen.pixel.u, seen.pixel.v])
            });
            nodes.collect()
        };
        let rows: Vec<_> = layout.vs.par_iter().map(row).collect();
        let rows = rows.concat();
        let at_px = filled(&rows, &layout.us, &layout.vs)?;
        Some(Self {
            layout,
            at_px,
            is_seen: rows.iter().map(Option::is_some).collect(),
        })
    }

    /// Where a chip takes a pixel of the output image from, before it rounds.
    pub fn taken_from(&self, u: u32, v: u32) -> [f64; 2] {
        let Layout { us, vs, step, .. } = &self.layout;
        match self.layout.between {
            Between::Bilinear => {
                let [(i, across), (j, down)] = [(u, us), (v, vs)].map(|(at, nodes)| {
                    let first = ((at / step) as usize).min(nodes.len() - 2);
                    let width = nodes[first + 1] - nodes[first];
                    (first, f64::from(at - nodes[first]) / f64::from(width))
                });
                self.mixed(i, j, &[1.0 - across, across], &[1.0 - down, down])
            }
            Between::Biquadratic => {
                let [(i, across), (j, down)] = [(u, us), (v, vs)].map(|(at, nodes)| {
                    let first = 2 * ((at / (2 * step)) as usize).min((nodes.len() - 3) / 2);
                    (first, f64::from(at - nodes[first]) / f64::from(*step))
                });
                self.mixed(i, j, &parabola(across), &parabola(down))
            }
        }
    }

    /// The mean of nodes from (i, j) on, by their weights.
    fn mixed(&self, i: usize, j: usize, across: &[f64], down: &[f64]) -> [f64; 2] {
        let columns = self.layout.us.len();
        let mut sum = [0.0; 2];
        for (dj, of_row) in down.iter().enumerate() {
            for (di, of_column) in across.iter().enumerate() {
                let node = self.at_px[(j + dj) * columns + i + di];
                sum[0] += of_row * of_column * node[0];
                sum[1] += of_row * of_column * node[1];
            }
        }
        sum
    }
}

/// The weights of values at 0, 1 and 2 for the parabola through them.
fn parabola(t: f64) -> [f64; 3] {
    [
        (t - 1.0) * (t - 2.0) / 2.0,
        t * (2.0 - t),
        t * (t - 1.0) / 2.0,
    ]
}
