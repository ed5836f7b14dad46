//! Which marker is whose neighbor, and from that rows and columns that are still to be placed.
//!
//! The outline of a marker says how the target is seen there (up to a turn): in coordinates in which
//! the outline is a circle of its known radius, the next marker along a row or a column is a pitch
//! away, and the next diagonal one 1.4 pitches. So neighbors are found without knowing the
//! lens, and steps from neighbor to neighbor follow any distortion.

use nalgebra::{Matrix2, Vector2};
use std::collections::{BTreeMap, VecDeque};

/// Farther than the nearest neighbor by this factor is no neighbor along a row or a column.
const SAME_STEP: f64 = 1.2;
/// A step may be this much shorter or longer than the pitch.
const STEP_TOLERANCE: f64 = 0.25;
/// A step along a column may deviate from a column's by this part of a pitch.
const DIRECTION_TOLERANCE: f64 = 0.3;
/// Cosine between two steps that count as along a row and along a column.
const MAX_COSINE: f64 = 0.5;

/// Column and row (in this order) of nodes, by their index.
pub type Cells = BTreeMap<usize, (i64, i64)>;

/// A marker as the grid sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Its middle, px.
    pub center: Vector2<f64>,
    /// Maps the unit circle to its outline, px.
    pub shape: Matrix2<f64>,
}

/// Column and row (in this order), counted from any marker, of the largest connected part of the
/// grid; by index of the node. Columns and rows turn in the image as u and v do.
///
/// `radii` are the outer radii of ordinary and of direction markers in pitches.
pub fn largest_grid(nodes: &[Node], radii: (f64, f64)) -> Cells {
    let neighbors = neighbors(nodes, radii);
    let mut best = Cells::new();
    let mut visited = vec![false; nodes.len()];
    let mut seeds: Vec<usize> = (0..nodes.len()).collect();
    // The best connected first; of equals, the first.
    seeds.sort_by_key(|&i| std::cmp::Reverse(neighbors[i].len()));
    for seed in seeds {
        if visited[seed] {
            continue;
        }
        let Some(axes) = seed_axes(nodes, &neighbors[seed], seed) else {
            continue;
        };
        let cells = grown(nodes, &neighbors, seed, axes);
        for &i in cells.keys() {
            visited[i] = true;
        }
        if cells.len() > best.len() {
            best = cells;
        }
    }
    best
}

/// For each node the nodes that may be next to it along a row or a column, mutually.
fn neighbors(nodes: &[Node], radii: (f64, f64)) -> Vec<Vec<usize>> {
    let inverses: Vec<Matrix2<f64>> = nodes
        .iter()
        .map(|node| node.shape.try_inverse().unwrap_or_else(Matrix2::zeros))
        .collect();
    let (ordinary, direction) = radii;
    let shortest = (1.0 - STEP_TOLERANCE) / direction;
    let longest = (1.0 + STEP_TOLERANCE) / ordinary;
    let one_sided: Vec<Vec<usize>> = (0..nodes.len())
        .map(|i| {
            let steps: Vec<(usize, f64)> = (0..nodes.len())
                .filter(|&j| j != i)
                .map(|j| {
                    (
                        j,
                        (inverses[i] * (nodes[j].center - nodes[i].center)).norm(),
                    )
                })
                .filter(|(_, step)| (shortest..=longest).contains(step))
                .collect();
            let nearest = steps.iter().map(|s| s.1).fold(f64::INFINITY, f64::min);
            let same = steps.iter().filter(|s| s.1 <= SAME_STEP * nearest);
            same.map(|s| s.0).collect()
        })
        .collect();
    (0..nodes.len())
        .map(|i| {
            let mutual = |&&j: &&usize| one_sided[j].contains(&i);
            one_sided[i].iter().filter(mutual).copied().collect()
        })
        .collect()
}

/// Steps to the next column and the next row at a node, if it has neighbors in both directions.
fn seed_axes(nodes: &[Node], neighbors: &[usize], seed: usize) -> Option<Matrix2<f64>> {
    let inverse = nodes[seed].shape.try_inverse()?;
    let steps = || {
        neighbors
            .iter()
            .map(|&j| nodes[j].center - nodes[seed].center)
    };
    let first = steps().next()?;
    let across = |step: &Vector2<f64>| {
        let (a, b) = (inverse * first, inverse * step);
        a.dot(&b).abs() < MAX_COSINE * a.norm() * b.norm()
    };
    let second = steps().find(across)?;
    let turns_as_u_to_v = first.perp(&second) > 0.0;
    let second = if turns_as_u_to_v { second } else { -second };
    Some(Matrix2::from_columns(&[first, second]))
}

/// Everything that can be reached from the seed, step by step.
fn grown(nodes: &[Node], neighbors: &[Vec<usize>], seed: usize, axes: Matrix2<f64>) -> Cells {
    let mut cells = BTreeMap::from([(seed, (0, 0))]);
    let mut taken = BTreeMap::from([((0, 0), seed)]);
    let mut queue = VecDeque::from([(seed, axes)]);
    while let Some((i, inherited)) = queue.pop_front() {
        let Some(&(col, row)) = cells.get(&i) else {
            continue;
        };
        let axes = local_axes(nodes, &neighbors[i], &cells, i, inherited);
        let Some(inverse) = axes.try_inverse() else {
            continue;
        };
        for &j in &neighbors[i] {
            if cells.contains_key(&j) {
                continue;
            }
            let step = inverse * (nodes[j].center - nodes[i].center);
            let whole = step.map(f64::round);
            let off = (step - whole).amax();
            if off > DIRECTION_TOLERANCE || whole.norm_squared() != 1.0 {
                continue;
            }
            let cell = (col + whole.x as i64, row + whole.y as i64);
            // Two markers for one place: the first one keeps it; the map shows who was wrong.
            if let std::collections::btree_map::Entry::Vacant(free) = taken.entry(cell) {
                free.insert(j);
                cells.insert(j, cell);
                queue.push_back((j, axes));
            }
        }
    }
    cells
}

/// The steps at a node: the means over its neighbors that have their place, along each direction; as
/// inherited where there is none.
fn local_axes(
    nodes: &[Node],
    neighbors: &[usize],
    cells: &Cells,
    i: usize,
    inherited: Matrix2<f64>,
) -> Matrix2<f64> {
    let mut sums = [(Vector2::zeros(), 0.0); 2];
    let Some(&(col, row)) = cells.get(&i) else {
        return inherited;
    };
    for j in neighbors {
        let Some(&(other_col, other_row)) = cells.get(j) else {
            continue;
        };
        let step = nodes[*j].center - nodes[i].center;
        match (other_col - col, other_row - row) {
            (sign @ (1 | -1), 0) => sums[0] = (sums[0].0 + step * sign as f64, sums[0].1 + 1.0),
            (0, sign @ (1 | -1)) => sums[1] = (sums[1].0 + step * sign as f64, sums[1].1 + 1.0),
            _ => {}
        }
    }
    let axis = |k: usize| match sums[k] {
        (_, 0.0) => inherited.column(k).into_owned(),
        (sum, count) => sum / count,
    };
    Matrix2::from_columns(&[axis(0), axis(1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid through strong barrel distortion, turned by an angle.
    fn seen(col: f64, row: f64, turn_rad: f64) -> Vector2<f64> {
        let p = Vector2::new(col - 4.0, row - 3.0) * 40.0;
        let (s, c) = turn_rad.sin_cos();
        let p = Vector2::new(c * p.x - s * p.y, s * p.x + c * p.y);
        p / (1.0 + p.norm_squared() / (500.0 * 500.0))
    }

    fn node(col: usize, row: usize, turn_rad: f64) -> Node {
        let (x, y) = (col as f64, row as f64);
        let radius = if (row, col) == (3, 4) {
            5.0 / 12.0
        } else {
            4.0 / 12.0
        };
        let along = |dx: f64, dy: f64| seen(x + dx, y + dy, turn_rad) - seen(x, y, turn_rad);
        let px = Matrix2::from_columns(&[along(0.01, 0.0) * 100.0, along(0.0, 0.01) * 100.0]);
        Node {
            center: seen(x, y, turn_rad),
            shape: super::super::ring_fit::shape_of_circle(&px, radius),
        }
    }

    #[test]
    fn rows_and_columns_follow_the_distortion_at_any_turn_and_around_holes() {
        for turn in [0.0, 0.6, 1.57, 3.0, 4.5] {
            let places: Vec<(usize, usize)> = (0..63)
                .map(|k| (k % 9, k / 9))
                .filter(|&(col, row)| (col * 2 + row * 3) % 7 != 0)
                .collect();
            let nodes: Vec<Node> = places.iter().map(|&(c, r)| node(c, r, turn)).collect();
            let cells = largest_grid(&nodes, (4.0 / 12.0, 5.0 / 12.0));
            assert!(cells.len() + 2 >= nodes.len(), "{} at {turn}", cells.len());
            // One turn and shift explains all cells, and no mirror does.
            let turned = |(a, b): (i64, i64), k: usize| (0..k).fold((a, b), |(a, b), _| (-b, a));
            let agrees = |k: usize| {
                let shift: Vec<(i64, i64)> = cells
                    .iter()
                    .map(|(&i, &cell)| {
                        let (a, b) = turned(cell, k);
                        (places[i].0 as i64 - a, places[i].1 as i64 - b)
                    })
                    .collect();
                shift.windows(2).all(|pair| pair[0] == pair[1])
            };
            assert!((0..4).any(agrees), "at {turn}");
        }
    }

    #[test]
    fn markers_that_have_no_neighbor_have_no_grid() {
        let lone = [node(0, 0, 0.0), node(5, 5, 0.0)];
        assert!(largest_grid(&lone, (4.0 / 12.0, 5.0 / 12.0)).is_empty());
        assert!(largest_grid(&[], (0.3, 0.4)).is_empty());
    }
}
