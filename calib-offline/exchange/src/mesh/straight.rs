//! Nodes of a mesh that no calibrated pixel sees. Cells at the edge of the calibrated area have them as corners, and the formats have no
//! mark for them: there the mesh goes on.
//!
//! Along its row and along its column, between seen nodes linear; outside of them, the next nodes by the parabola through the
//! last three, the others straight on through the last two. Of row and column the one that has seen nodes nearer by; the mean if they are as near.
//! Twice around the seen nodes go rows and columns with three of them, two nodes far; what they give counts as seen for the others. Then
//! they go to their ends, and those with fewer come last. So six nodes are on a parabola in all.

type Node = Option<[f64; 2]>;

/// Which lines go on, and how far.
#[derive(Clone, Copy)]
struct Pass {
    /// Seen nodes that a line has at least.
    need: usize,
    /// Nodes that it goes on for.
    reach: usize,
}

const NEAR: Pass = Pass { need: 3, reach: 2 };
const FAR: Pass = Pass {
    need: 3,
    reach: usize::MAX,
};
const ANY: Pass = Pass {
    need: 1,
    reach: usize::MAX,
};

/// All nodes, row by row; `None` if none is seen.
pub(super) fn filled(seen: &[Node], us: &[u32], vs: &[u32]) -> Option<Vec<[f64; 2]>> {
    let mut nodes = seen.to_vec();
    if nodes.iter().all(Option::is_none) {
        return None;
    }
    for pass in [NEAR, NEAR] {
        nodes = once(&nodes, us, vs, pass);
    }
    for pass in [FAR, ANY] {
        loop {
            let next = once(&nodes, us, vs, pass);
            let is_same = next == nodes;
            nodes = next;
            if is_same {
                break;
            }
        }
    }
    nodes.into_iter().collect()
}

/// What the lines of a pass give the nodes that are lacking.
fn once(nodes: &[Node], us: &[u32], vs: &[u32], pass: Pass) -> Vec<Node> {
    let columns = us.len();
    let mut next = nodes.to_vec();
    let mut distances = vec![u32::MAX; nodes.len()];
    for j in 0..vs.len() {
        let row = &nodes[j * columns..(j + 1) * columns];
        for (i, found) in line(row, us, 0, pass).into_iter().enumerate() {
            if let Some((node, distance)) = found {
                next[j * columns + i] = Some(node);
                distances[j * columns + i] = distance;
            }
        }
    }
    for i in 0..columns {
        let column: Vec<Node> = (0..vs.len()).map(|j| nodes[j * columns + i]).collect();
        for (j, found) in line(&column, vs, 1, pass).into_iter().enumerate() {
            let k = j * columns + i;
            let Some((node, distance)) = found else {
                continue;
            };
            match next[k] {
                Some(by_row) if distance == distances[k] => {
                    next[k] = Some([0, 1].map(|axis| f64::midpoint(node[axis], by_row[axis])));
                }
                Some(_) if distance > distances[k] => {}
                _ => next[k] = Some(node),
            }
        }
    }
    next
}

/// What a line of nodes makes of those that it lacks, and how far from the nearest one it has, px. `axis` is that along it.
fn line(nodes: &[Node], at: &[u32], axis: usize, pass: Pass) -> Vec<Option<([f64; 2], u32)>> {
    let known: Vec<(usize, [f64; 2])> = nodes
        .iter()
        .enumerate()
        .filter_map(|(k, node)| Some((k, (*node)?)))
        .collect();
    let mut found = vec![None; nodes.len()];
    if known.len() < pass.need {
        return found;
    }
    for pair in known.windows(2) {
        let [(a, node_a), (b, node_b)] = pair else {
            continue;
        };
        for k in a + 1..*b {
            let share = f64::from(at[k] - at[*a]) / f64::from(at[*b] - at[*a]);
            let node = [0, 1].map(|axis| node_a[axis] + share * (node_b[axis] - node_a[axis]));
            found[k] = Some((node, (at[k] - at[*a]).min(at[*b] - at[k])));
        }
    }
    let mut outward = |ends: &[(usize, [f64; 2])], missing: &mut dyn Iterator<Item = usize>| {
        let Some((last, _)) = ends.first() else {
            return;
        };
        let mut ends: Vec<(f64, [f64; 2])> = ends
            .iter()
            .map(|(k, node)| (f64::from(at[*k]), *node))
            .collect();
        for (count, k) in missing.take(pass.reach).enumerate() {
            let here = f64::from(at[k]);
            let used = if count < 2 { 3 } else { 2 };
            let node = beyond(&ends[..used.min(ends.len())], here, axis);
            found[k] = Some((node, at[k].abs_diff(at[*last])));
            ends.insert(0, (here, node));
            ends.truncate(3);
        }
    };
    let first = known.first().map_or(0, |(k, _)| *k);
    let last = known.last().map_or(0, |(k, _)| *k);
    let near: Vec<_> = known.iter().take(3).copied().collect();
    outward(&near, &mut (0..first).rev());
    let near: Vec<_> = known.iter().rev().take(3).copied().collect();
    outward(&near, &mut (last + 1..nodes.len()));
    found
}

/// The polynomial through up to three nodes; through one, a step of a pixel a pixel.
fn beyond(ends: &[(f64, [f64; 2])], here: f64, axis: usize) -> [f64; 2] {
    if let [(at, node)] = ends {
        let mut node = *node;
        node[axis] += here - at;
        return node;
    }
    let mut sum = [0.0; 2];
    for (k, (at, node)) in ends.iter().enumerate() {
        let others = ends.iter().enumerate().filter(|(other, _)| *other != k);
        let weight: f64 = others
            .map(|(_, (other, _))| (here - other) / (at - other))
            .product();
        sum[0] += weight * node[0];
        sum[1] += weight * node[1];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_goes_on_for_six_nodes_and_then_straight() {
        let us: Vec<u32> = (0..12).map(|k| 10 * k).collect();
        let f = |u: f64| [u + 0.01 * u * u, 7.0];
        let nodes: Vec<Node> = us
            .iter()
            .map(|u| (*u < 40).then(|| f(f64::from(*u))))
            .collect();
        let all = filled(&nodes, &us, &[0]).unwrap();
        // Two by each of the passes.
        for k in 4..10 {
            let truth = f(f64::from(us[k]));
            assert!((all[k][0] - truth[0]).abs() < 1e-9, "{all:?}");
        }
        for k in 10..12 {
            let straight = 2.0 * all[k - 1][0] - all[k - 2][0];
            assert!((all[k][0] - straight).abs() < 1e-9, "{all:?}");
        }
        assert!(all.iter().all(|node| (node[1] - 7.0).abs() < 1e-9));
    }

    #[test]
    fn a_full_column_goes_before_a_row_with_one_node() {
        // Of the lower row one node is seen.
        let (us, vs) = ([0, 8, 16, 24], [0, 8, 16, 24]);
        let f = |k: usize| [f64::from(us[k % 4]) * 1.5, f64::from(vs[k / 4]) * 1.5];
        let nodes: Vec<Node> = (0..16).map(|k| (k < 13).then(|| f(k))).collect();
        let all = filled(&nodes, &us, &vs).unwrap();
        for (k, node) in all.iter().enumerate() {
            assert!((node[0] - f(k)[0]).abs() + (node[1] - f(k)[1]).abs() < 1e-9);
        }
    }

    #[test]
    fn one_node_is_enough_and_none_is_not() {
        let mut nodes: Vec<Node> = vec![None; 9];
        let (us, vs) = ([0, 8, 16], [0, 8, 16]);
        assert!(filled(&nodes, &us, &vs).is_none());
        nodes[4] = Some([10.0, 20.0]);
        let all = filled(&nodes, &us, &vs).unwrap();
        assert_eq!(all[0], [2.0, 12.0]);
        assert_eq!(all[8], [18.0, 28.0]);
    }
}
