//! The table that suits best among those that hold the bound.

use super::PackError;
use super::quantized::Number;
use super::settings::Prefer;
use super::sizes::{knot_count, own_grids, sizes};
use super::trials::{Plan, TableKey, Trials};

/// Errors below this may be round-off; measured are 0.0001 px with 1280 px and 0.0006 px with 6000.
const ROUND_OFF_PX: f64 = 0.002;
/// Tried in this order for the fewest bytes: polynomials alone; knots of i16, for which the cubic is as
/// good as any, since their range is not what limits them; then knots of i8, half as large, which want
/// little left to hold.
const SMALL_PLANS: [Plan; 8] = [
    quantized(3, Number::None),
    quantized(5, Number::None),
    quantized(7, Number::None),
    quantized(9, Number::None),
    quantized(3, Number::Two),
    quantized(7, Number::One),
    quantized(5, Number::One),
    quantized(3, Number::One),
];

const fn quantized(degree: u8, number: Number) -> Plan {
    Plan::Quantized { degree, number }
}

/// Searches a table within `bound_px` on a sample of the pixels: of the form that is looked up
/// fastest or takes the fewest bytes, and of that form the smallest. Where there is no more to spend, the
/// smallest of those tried. `wanted_px` is what an error says was asked for.
///
/// # Errors
/// [`PackError::BoundNotReached`] and what fitting and opening give.
pub fn choose(
    trials: &mut Trials<'_>,
    prefer: Prefer,
    bound_px: f64,
    wanted_px: f64,
) -> Result<TableKey, PackError> {
    trials.set_bound(bound_px);
    let mut search = Search {
        sizes: sizes(trials.camera),
        trials,
        bound_px,
    };
    let mut best: Option<(TableKey, usize)> = None;
    let plans: &[Plan] = match prefer {
        Prefer::Speed => &[Plan::Patches],
        Prefer::Size => &SMALL_PLANS,
    };
    for plan in plans {
        let below = best.map_or(usize::MAX, |(_, bytes)| bytes);
        if let Some(cells) = search.smallest(*plan, below)? {
            let found = search.trials.key(*plan, cells);
            best = Some((found, search.trials.byte_count(*plan, cells)));
        }
    }
    let best = best.map(|(key, _)| key);
    let found = if trials.work.is_spent {
        trials.smallest_within(bound_px).or(best)
    } else {
        best
    };
    found.ok_or_else(|| {
        let best = trials.best_tried();
        PackError::BoundNotReached {
            camera: trials.camera.name.clone(),
            wanted_px,
            best_px: best.map_or(f64::INFINITY, |(_, tried)| tried.error_px),
            cells: best.map_or([0, 0], |(_, tried)| tried.cells),
        }
    })
}

/// One search on one camera.
struct Search<'s, 'a> {
    trials: &'s mut Trials<'a>,
    sizes: Vec<[u32; 2]>,
    bound_px: f64,
}

impl Search<'_, '_> {
    /// The smallest table of a plan that holds the bound and has fewer bytes than `below`: its cells.
    fn smallest(&mut self, plan: Plan, below: usize) -> Result<Option<[u32; 2]>, PackError> {
        if let Plan::Quantized {
            number: Number::None,
            ..
        } = plan
        {
            let error_px = self.attempt(plan, [1, 1])?;
            let holds = error_px.is_some_and(|error_px| error_px <= self.bound_px)
                && self.trials.byte_count(plan, [1, 1]) < below;
            return Ok(holds.then_some([1, 1]));
        }
        let sizes = self.sizes.clone();
        let affordable =
            sizes.partition_point(|cells| self.trials.byte_count(plan, *cells) < below);
        let sizes = &sizes[..affordable];
        let is_own = |[u, v]: [u32; 2]| {
            let (u, v) = (u as usize, v as usize);
            own_grids(self.trials.camera)
                .any(|own| u.is_multiple_of(own.cells_u) && v == u / own.cells_u * own.cells_v)
        };

        // Upwards in steps that the error asks for, never past a size that is likely to be exact.
        let mut errors: Vec<([u32; 2], f64)> = Vec::new();
        let mut idx = 1.min(sizes.len().saturating_sub(1));
        let mut failed_below = 0;
        let mut found = loop {
            let Some(&cells) = sizes.get(idx) else {
                return Ok(None);
            };
            let Some(error_px) = self.attempt(plan, cells)? else {
                return Ok(None);
            };
            errors.push((cells, error_px));
            if error_px <= self.bound_px {
                break cells;
            }
            if has_stalled(&errors) || !self.can_still_hold(plan, &errors) {
                return Ok(None);
            }
            failed_below = idx + 1;
            let goal = f64::from(knot_count(cells)) * growth(error_px, self.bound_px);
            let is_stop = |k: &usize| f64::from(knot_count(sizes[*k])) >= goal || is_own(sizes[*k]);
            let last = sizes.len() - 1;
            idx = match (idx + 1..sizes.len()).find(is_stop) {
                Some(next) => next,
                None if idx < last => last,
                None => return Ok(None),
            };
        };
        // Downwards by halving; the error falls with the size but for small ripples.
        let (mut low, mut high) = (failed_below, idx);
        while low < high {
            let middle = usize::midpoint(low, high);
            let Some(error_px) = self.attempt(plan, sizes[middle])? else {
                break;
            };
            if error_px <= self.bound_px {
                high = middle;
                found = sizes[middle];
            } else {
                low = middle + 1;
            }
        }
        Ok(Some(found))
    }

    fn attempt(&mut self, plan: Plan, cells: [u32; 2]) -> Result<Option<f64>, PackError> {
        let key = self.trials.key(plan, cells);
        self.trials.error_px(key, self.bound_px)
    }

    /// Whether finer grids may get there. Quantized to i8, the error ends at half a step however many knots
    /// there are; knots of i16 end at the round-off, but may have to become as fine as what they are to follow.
    fn can_still_hold(&self, plan: Plan, errors: &[([u32; 2], f64)]) -> bool {
        let Some(((last, last_px), before)) = errors.split_last() else {
            return true;
        };
        let is_no_better = |times: u32, (cells, error_px): &([u32; 2], f64)| {
            knot_count(*last) >= times * knot_count(*cells) && *last_px >= 0.8 * error_px
        };
        let is_hopeless = match plan {
            Plan::Quantized {
                number: Number::Two,
                ..
            } => before.iter().any(|known| is_no_better(4, known)),
            _ => before.last().is_some_and(|known| is_no_better(2, known)),
        };
        !is_hopeless || *last_px > MOST_HOPELESS * self.bound_px
    }
}

/// Errors that stay as they are with twice as many knots are hopeless, unless they are larger than
/// this many bounds: local bumps may stay until a grid is fine enough for them.
const MOST_HOPELESS: f64 = 20.0;

/// By how much the number of knots should grow: the error of a cubic spline falls with the fourth
/// power of the spacing, so with the square of the number of knots. A little less is tried, and
/// at most four times as many.
fn growth(error_px: f64, wanted_px: f64) -> f64 {
    ((error_px / wanted_px).sqrt() * 0.9).clamp(1.05, 4.0)
}

/// Whether finer grids no longer help: the error is as small as the round-off of f32 makes
/// it, and twice as many knots did not lower it. (A large error that stays may be that of
/// local bumps that no grid so far was fine enough for.)
fn has_stalled(errors: &[([u32; 2], f64)]) -> bool {
    let Some(((last, last_px), before)) = errors.split_last() else {
        return false;
    };
    let no_better = |(cells, error_px): &([u32; 2], f64)| {
        knot_count(*last) >= 2 * knot_count(*cells) && *last_px > 0.8 * error_px
    };
    *last_px < ROUND_OFF_PX && before.iter().any(no_better)
}
