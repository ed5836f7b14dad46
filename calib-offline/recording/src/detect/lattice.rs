//! Places on a grid: neighbors, sides of squares, and where a missing one should be.

use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Position in a grid, counted along its two directions.
pub type Node = (i32, i32);

/// The neighbors of a node along both directions.
pub const NEIGHBORS: [Node; 4] = [(1, 0), (-1, 0), (0, 1), (0, -1)];

pub fn plus(node: Node, step: Node, times: i32) -> Node {
    (node.0 + step.0 * times, node.1 + step.1 * times)
}

pub fn extent_of<'a>(nodes: impl Iterator<Item = &'a Node>) -> (Node, Node) {
    nodes.fold(
        ((i32::MAX, i32::MAX), (i32::MIN, i32::MIN)),
        |(low, high), &(i, j)| ((low.0.min(i), low.1.min(j)), (high.0.max(i), high.1.max(j))),
    )
}

/// Whether the nodes fit on the board, lying or standing.
pub fn fits_board(nodes: &[Node], board: &BoardSpec) -> bool {
    let (low, high) = extent_of(nodes.iter());
    let (w, h) = ((high.0 - low.0 + 1) as usize, (high.1 - low.1 + 1) as usize);
    (w <= board.cols && h <= board.rows) || (w <= board.rows && h <= board.cols)
}

fn vector(from: PixelPoint, to: PixelPoint) -> Vector2<f64> {
    Vector2::new(to.u - from.u, to.v - from.v)
}

/// Shorter of the two sides of a square in the image, px.
pub fn shorter_side(px_from_square: &Matrix2<f64>) -> f64 {
    px_from_square
        .column(0)
        .norm()
        .min(px_from_square.column(1).norm())
}

/// The image of one square at a node, from its neighbors; where it has none along a direction,
/// from a neighbor's neighbors.
pub fn px_from_square(pixels: &BTreeMap<Node, PixelPoint>, node: Node) -> Option<Matrix2<f64>> {
    let along = |step: Node| {
        step_at(pixels, node, step).or_else(|| {
            NEIGHBORS
                .iter()
                .find_map(|&side| step_at(pixels, plus(node, side, 1), step))
        })
    };
    let (x, y) = (along((1, 0))?, along((0, 1))?);
    Some(Matrix2::from_columns(&[x, y]))
}

fn step_at(pixels: &BTreeMap<Node, PixelPoint>, node: Node, step: Node) -> Option<Vector2<f64>> {
    let here = pixels.get(&node)?;
    let next = pixels.get(&plus(node, step, 1));
    let before = pixels.get(&plus(node, step, -1));
    match (before, next) {
        (Some(&before), Some(&next)) => Some(vector(before, next) / 2.0),
        (None, Some(&next)) => Some(vector(*here, next)),
        (Some(&before), None) => Some(vector(before, *here)),
        (None, None) => None,
    }
}

/// Nodes without a corner next to nodes with one, in order, on grids that fit on the board.
pub fn missing_neighbors(pixels: &BTreeMap<Node, PixelPoint>, board: &BoardSpec) -> Vec<Node> {
    let nodes: Vec<Node> = pixels.keys().copied().collect();
    let mut missing: Vec<Node> = nodes
        .iter()
        .flat_map(|&node| NEIGHBORS.map(|step| plus(node, step, 1)))
        .filter(|node| !pixels.contains_key(node))
        .collect();
    missing.sort_unstable();
    missing.dedup();
    missing.retain(|&node| {
        let mut extended = nodes.clone();
        extended.push(node);
        fits_board(&extended, board)
    });
    missing
}

/// Where a missing corner should be, from lines through its neighbors, bent where there are enough of
/// them to tell, and the image of a square there. A step beyond the outermost neighbors, and the square's side along
/// it, are shortened to a part.
pub fn predicted(
    pixels: &BTreeMap<Node, PixelPoint>,
    node: Node,
    part: f64,
) -> Option<(PixelPoint, Matrix2<f64>)> {
    let mut sum = Vector2::zeros();
    let mut count = 0.0;
    let mut axes = None;
    let mut parts = [1.0; 2];
    for step in NEIGHBORS {
        let Some(&near) = pixels.get(&plus(node, step, 1)) else {
            continue;
        };
        axes = axes.or_else(|| px_from_square(pixels, plus(node, step, 1)));
        let place = |times: i32| {
            let at = pixels.get(&plus(node, step, times));
            at.map(|p| Vector2::new(p.u, p.v))
        };
        let near = Vector2::new(near.u, near.v);
        let beyond = match (place(-1), place(2), place(-2), place(3)) {
            (Some(opposite), Some(far), Some(far_opposite), _) => {
                sum += ((near + opposite) * 4.0 - far - far_opposite) / 6.0;
                count += 1.0;
                continue;
            }
            (Some(opposite), ..) => {
                sum += (near + opposite) / 2.0;
                count += 1.0;
                continue;
            }
            (None, Some(far), _, Some(farthest)) => (near - far) * 2.0 + farthest - far,
            (None, Some(far), ..) => near - far,
            _ => continue,
        };
        sum += near + beyond * part;
        count += 1.0;
        parts[usize::from(step.0 == 0)] = part;
    }
    let mean = sum / count;
    (count > 0.0).then_some(())?;
    let mut axes = axes?;
    for (axis, part) in parts.into_iter().enumerate() {
        axes.column_mut(axis).scale_mut(part);
    }
    Some((PixelPoint::new(mean.x, mean.y), axes))
}
