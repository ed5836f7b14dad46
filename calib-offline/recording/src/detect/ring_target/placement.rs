//! Where on the target a grid of markers lies: decided by which of them are the larger ones.

use crate::dataset::TargetSpec;

/// Another place must contradict so many more markers than the best one does, so that one marker
/// misjudged cannot decide.
const MARGIN: usize = 2;
/// One contradiction is allowed for so many markers: something else that looks like one.
const MARKERS_PER_CONTRADICTION: usize = 20;

/// A marker of a grid that is still to be placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sized {
    /// Column and row, counted from any marker.
    pub cell: (i64, i64),
    /// Whether it is as large as a direction marker.
    pub is_large: bool,
}

/// A place of the grid on the target.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    /// Quarter turns that take (col, row) to (-row, col).
    quarter_turns: u8,
    /// Whether the columns are counted in opposite order first.
    mirrored: bool,
    shift: (i64, i64),
}

impl Placement {
    /// Column and row on the target, or beyond it.
    pub fn place(&self, (col, row): (i64, i64)) -> (i64, i64) {
        let col = if self.mirrored { -col } else { col };
        let (col, row) = (0..self.quarter_turns).fold((col, row), |(a, b), _| (-b, a));
        (col + self.shift.0, row + self.shift.1)
    }

    /// (row, col) of the target; `None` beyond it.
    pub fn row_col(&self, cell: (i64, i64), target: &TargetSpec) -> Option<(usize, usize)> {
        let (col, row) = self.place(cell);
        let (col, row) = (usize::try_from(col).ok()?, usize::try_from(row).ok()?);
        (row < target.rows && col < target.cols).then_some((row, col))
    }

    /// Quarter turns from the grid's columns and rows to the target's: 0 to 3.
    pub fn quarter_turns(&self) -> u8 {
        self.quarter_turns
    }
}

/// What the sizes say of a grid's place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// There is one place.
    Placed(Placement),
    /// So many places agree with the sizes about equally well.
    Ambiguous(usize),
    /// The mirror image of the target has a place, the target has none.
    Mirrored,
    /// No place agrees with the sizes; the best contradicts so many markers.
    Nowhere(usize),
}

/// Places the grid. Nothing is taken for granted of the markers that are not seen.
pub fn place(markers: &[Sized], target: &TargetSpec) -> Verdict {
    let allowed = markers.len() / MARKERS_PER_CONTRADICTION;
    let direct = best_places(markers, target, false);
    match direct.first() {
        Some(&(least, placement)) if least <= allowed => {
            let close = direct.iter().filter(|p| p.0 < least + MARGIN).count();
            if close > 1 {
                Verdict::Ambiguous(close)
            } else {
                Verdict::Placed(placement)
            }
        }
        _ => {
            let mirrored = best_places(markers, target, true);
            if mirrored.first().is_some_and(|p| p.0 <= allowed) {
                return Verdict::Mirrored;
            }
            Verdict::Nowhere(direct.first().map_or(markers.len(), |p| p.0))
        }
    }
}

/// The places with the fewest contradictions, and those hardly worse; best first.
fn best_places(markers: &[Sized], target: &TargetSpec, mirrored: bool) -> Vec<(usize, Placement)> {
    let mut places: Vec<(usize, Placement)> = Vec::new();
    let mut least = usize::MAX - MARGIN;
    for quarter_turns in 0..4 {
        let unshifted = Placement {
            quarter_turns,
            mirrored,
            shift: (0, 0),
        };
        let turned = || markers.iter().map(|marker| unshifted.place(marker.cell));
        let (Some(from_col), Some(to_col)) =
            (turned().map(|c| c.0).min(), turned().map(|c| c.0).max())
        else {
            continue;
        };
        let (Some(from_row), Some(to_row)) =
            (turned().map(|c| c.1).min(), turned().map(|c| c.1).max())
        else {
            continue;
        };
        // Every shift with which the two overlap.
        for shift_row in -to_row..target.rows as i64 - from_row {
            for shift_col in -to_col..target.cols as i64 - from_col {
                let placement = Placement {
                    shift: (shift_col, shift_row),
                    ..unshifted
                };
                let contradictions = contradictions(markers, target, &placement, least + MARGIN);
                if contradictions < least + MARGIN {
                    least = least.min(contradictions);
                    places.push((contradictions, placement));
                }
            }
        }
    }
    places.retain(|p| p.0 < least + MARGIN);
    places.sort_by_key(|p| p.0);
    places
}

/// Markers beyond the target or of the wrong size; counting ends at `limit`.
fn contradictions(
    markers: &[Sized],
    target: &TargetSpec,
    placement: &Placement,
    limit: usize,
) -> usize {
    markers
        .iter()
        .filter(|marker| {
            placement
                .row_col(marker.cell, target)
                .is_none_or(|(row, col)| target.is_direction(row, col) != marker.is_large)
        })
        .take(limit)
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target() -> TargetSpec {
        TargetSpec {
            rows: 7,
            cols: 9,
            pitch_mm: 12.0,
            outer_radius_mm: 4.0,
            direction_outer_radius_mm: 5.0,
            direction: vec![(3, 4), (3, 5), (3, 6), (4, 4), (1, 2)],
            images: Vec::new(),
        }
    }

    /// The markers that `keep` keeps, seen turned, mirrored and shifted.
    fn seen(
        quarters: usize,
        mirrored: bool,
        keep: impl Fn(usize, usize) -> bool,
    ) -> (Vec<Sized>, Vec<(usize, usize)>) {
        let target = target();
        (0..63)
            .map(|k| (k / 9, k % 9))
            .filter(|&(row, col)| keep(row, col))
            .map(|(row, col)| {
                let x = if mirrored { -(col as i64) } else { col as i64 };
                let cell = (0..quarters).fold((x, row as i64), |(a, b), _| (-b, a));
                let marker = Sized {
                    cell: (cell.0 - 3, cell.1 + 11),
                    is_large: target.is_direction(row, col),
                };
                (marker, (row, col))
            })
            .unzip()
    }

    fn assert_placed(markers: &[Sized], labels: &[(usize, usize)]) {
        let Verdict::Placed(placement) = place(markers, &target()) else {
            panic!("{:?}", place(markers, &target()));
        };
        for (marker, label) in markers.iter().zip(labels) {
            if let Some(found) = placement.row_col(marker.cell, &target()) {
                assert_eq!(found, *label);
            }
        }
    }

    #[test]
    fn every_turn_is_found_and_a_mirror_image_is_named() {
        for quarters in 0..4 {
            let (markers, labels) = seen(quarters, false, |_, _| true);
            assert_placed(&markers, &labels);
            let (mirrored, _) = seen(quarters, true, |_, _| true);
            assert_eq!(place(&mirrored, &target()), Verdict::Mirrored);
        }
    }

    #[test]
    fn a_part_is_placed_where_its_direction_markers_allow_one_place_only() {
        // Without the two left columns and the row at the bottom.
        let (markers, labels) = seen(1, false, |row, col| col > 1 && row < 6);
        assert_placed(&markers, &labels);
        // No large marker in view: anywhere.
        let (markers, _) = seen(0, false, |row, _| row > 4);
        assert!(matches!(place(&markers, &target()), Verdict::Ambiguous(n) if n > 2));
        // One large marker and no border.
        let (markers, _) = seen(0, false, |row, col| row < 3 && (1..5).contains(&col));
        assert!(matches!(place(&markers, &target()), Verdict::Ambiguous(_)));
    }

    #[test]
    fn one_stray_marker_among_many_does_no_harm_and_a_wrong_target_has_no_place() {
        let (mut markers, mut labels) = seen(2, false, |_, _| true);
        markers.push(Sized {
            cell: (markers[0].cell.0 + 1, markers[0].cell.1),
            is_large: false,
        });
        labels.push((99, 99));
        assert_placed(&markers, &labels);
        let (mut markers, _) = seen(0, false, |_, _| true);
        for marker in markers.iter_mut().take(30) {
            marker.is_large = !marker.is_large;
        }
        assert!(matches!(place(&markers, &target()), Verdict::Nowhere(n) if n > 3));
        assert_eq!(place(&[], &target()), Verdict::Nowhere(0));
    }
}
