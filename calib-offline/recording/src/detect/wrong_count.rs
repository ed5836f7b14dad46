//! Whether the manifest's count of corners is that of the boards seen: partial boards would be given labels off by a
//! row where it is not.

use super::error::DetectError;
use super::grid_size::GridSize;
use super::seen_board::{SeenBoard, SeenKind};
use super::verdict::Refusal;
use calib_rays::board::BoardSpec;
use std::collections::BTreeMap;

/// Fewest images with the same other board that speak against the manifest.
const SEVERAL: usize = 2;

/// `refusals` are those of the images that are refused, `stated_count` images show the manifest's board as a whole, of
/// so many in all.
///
/// # Errors
/// [`DetectError::WrongCount`] where more images show one whole board of another size than show the manifest's.
pub(super) fn check<'a>(
    board: &BoardSpec,
    refusals: impl Iterator<Item = &'a Refusal>,
    stated_count: usize,
    of: usize,
) -> Result<(), DetectError> {
    let mut others: BTreeMap<GridSize, usize> = BTreeMap::new();
    for refusal in refusals {
        if let Refusal::WrongBoard {
            found,
            is_whole: true,
            ..
        } = refusal
        {
            *others.entry(*found).or_default() += 1;
        }
    }
    match others.into_iter().max_by_key(|(_, count)| *count) {
        Some((found, count)) if count >= SEVERAL && count > stated_count => {
            Err(DetectError::WrongCount {
                found,
                stated: GridSize::stated(board),
                count,
                stated_count,
                of,
            })
        }
        _ => Ok(()),
    }
}

/// Images that are used for each that clearly shows another target, beyond which those are another target's.
const USED_PER_OTHER: usize = 4;

/// Whether some images clearly show a target that is not the one described: parts of it in the others may have
/// been taken for parts of the one described. Where none is used, the images' own verdicts say as much.
///
/// # Errors
/// [`DetectError::WrongTarget`].
pub(super) fn check_targets<'a>(
    refusals: impl Iterator<Item = &'a Refusal>,
    used_count: usize,
) -> Result<(), DetectError> {
    let mut others: BTreeMap<String, (usize, &SeenBoard, &str)> = BTreeMap::new();
    for refusal in refusals {
        if let Refusal::OtherBoard { seen, stated } = refusal
            && !matches!(seen.kind, SeenKind::Markers { .. })
        {
            let of_kind = others
                .entry(seen.what_to_write())
                .or_insert((0, seen, stated));
            of_kind.0 += 1;
        }
    }
    match others.into_values().max_by_key(|(count, ..)| *count) {
        Some((count, seen, stated))
            if used_count > 0 && count >= SEVERAL && count * USED_PER_OTHER >= used_count =>
        {
            Err(DetectError::WrongTarget {
                seen: seen.clone(),
                stated: stated.to_owned(),
                count,
                used_count,
            })
        }
        _ => Ok(()),
    }
}
