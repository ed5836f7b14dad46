//! Smooth maps turned around, on the branch that the middle of the image lies on.
//!
//! Newton's method from the middle may end on another branch of a model with high coefficients, where the formula gives the
//! right pixel for a ray that the lens has not. So the place is followed from the middle outwards: the wanted value moves in steps,
//! each solved to round-off, and the map must not have folded anywhere on the way.

use nalgebra::{Matrix2, Vector2};

/// The longest step, as a share of the way ...
const LONGEST_STEP: f64 = 0.25;
/// ... and the shortest: where no shorter one is taken the map folds.
const SHORTEST_STEP: f64 = 1e-4;
/// Newton's steps of one correction.
const CORRECTIONS: usize = 12;
/// Misfit below which a place is found, and up to which one that comes no nearer counts as found.
const ROUND_OFF: f64 = 1e-15;
const NEAR: f64 = 1e-11;
/// A correction longer than this share of the prediction's step is another branch.
const TRUSTED: f64 = 0.5;
/// Half a step of the differences that stand for derivatives; they decide how fast a place is found, not where.
const DIFFERENCE: f64 = 1e-6;

/// The place whose value is `wanted`, followed from `start` on; `None` where the map folds on the way or has no value.
pub(super) fn followed(
    map: impl Fn(&Vector2<f64>) -> Option<Vector2<f64>>,
    start: Vector2<f64>,
    wanted: Vector2<f64>,
) -> Option<Vector2<f64>> {
    let from = map(&start)?;
    let way = wanted - from;
    if !way.norm().is_finite() {
        return None;
    }
    let side = slope(&map, &start)?.determinant().signum();
    let (mut place, mut share, mut step) = (start, 0.0, LONGEST_STEP);
    while share < 1.0 {
        let next = f64::min(share + step, 1.0);
        match corrected(&map, place, from + way * next, side) {
            Some(found) => {
                (place, share) = (found, next);
                step = (2.0 * step).min(LONGEST_STEP);
            }
            None => step /= 2.0,
        }
        if step < SHORTEST_STEP {
            return None;
        }
    }
    Some(place)
}

/// One step of the way: predicted by the slope, then corrected.
fn corrected(
    map: &impl Fn(&Vector2<f64>) -> Option<Vector2<f64>>,
    before: Vector2<f64>,
    wanted: Vector2<f64>,
    side: f64,
) -> Option<Vector2<f64>> {
    let scale = 1.0 + wanted.norm();
    let unfolded = |place: &Vector2<f64>| {
        let slope = slope(map, place)?;
        (slope.determinant() * side > 0.0).then_some(slope)
    };
    let newton = |place: &Vector2<f64>, misfit: Vector2<f64>| -> Option<Vector2<f64>> {
        Some(unfolded(place)?.try_inverse()? * misfit)
    };
    let predicted = before + newton(&before, wanted - map(&before)?)?;
    let trusted = TRUSTED * (predicted - before).norm() + NEAR;
    let (mut place, mut best) = (predicted, f64::INFINITY);
    for _ in 0..CORRECTIONS {
        let misfit = wanted - map(&place)?;
        let off = misfit.norm();
        if off <= ROUND_OFF * scale || off >= best && best <= NEAR * scale {
            best = off.min(best);
            break;
        }
        best = off;
        place += newton(&place, misfit)?;
        if !((place - predicted).norm() <= trusted) {
            return None;
        }
    }
    (best <= NEAR * scale && unfolded(&place).is_some()).then_some(place)
}

/// The derivative by differences, columns by coordinate.
pub(super) fn slope(
    map: &impl Fn(&Vector2<f64>) -> Option<Vector2<f64>>,
    place: &Vector2<f64>,
) -> Option<Matrix2<f64>> {
    let half = DIFFERENCE * (1.0 + place.norm());
    let along = |axis: usize| {
        let step = Vector2::ith(axis, half);
        Some((map(&(place + step))? - map(&(place - step))?) / (2.0 * half))
    };
    Some(Matrix2::from_columns(&[along(0)?, along(1)?]))
}

/// The first `x` from 0 to `most` at which a rising function of one number is `wanted`, which is not negative;
/// `None` where it falls before, or is never reached. `value(0)` is 0.
pub(super) fn rising(value: impl Fn(f64) -> f64, wanted: f64, most: f64) -> Option<f64> {
    const PARTS: usize = 256;
    if wanted == 0.0 {
        return Some(0.0);
    }
    let (mut low, mut before) = (0.0, 0.0);
    for part in 1..=PARTS {
        let high = most * part as f64 / PARTS as f64;
        let reached = value(high);
        if reached >= wanted {
            return Some(bisected(&value, wanted, low, high));
        }
        // Written so that NaN ends it.
        if !(reached > before) {
            return None;
        }
        (low, before) = (high, reached);
    }
    None
}

/// Halved to the last bit.
fn bisected(value: &impl Fn(f64) -> f64, wanted: f64, mut low: f64, mut high: f64) -> f64 {
    loop {
        let middle = (low + high) / 2.0;
        if middle <= low || middle >= high {
            return if wanted - value(low) < value(high) - wanted {
                low
            } else {
                high
            };
        }
        if value(middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fold_on_the_way_is_no_answer() {
        // r - r^3 / 3 rises up to r = 1, to 2/3; beyond r = 1.7 it is negative, and so has every value once more.
        let map = |at: &Vector2<f64>| Some(at * (1.0 - at.norm_squared() / 3.0));
        let found = |x: f64| followed(map, Vector2::zeros(), Vector2::new(x, 0.0));
        for x in [0.0, 0.1, 0.5, 0.66] {
            let at = found(x).unwrap();
            assert!(
                (map(&at).unwrap().x - x).abs() < 1e-14 && at.x < 1.0,
                "{at}"
            );
        }
        assert_eq!(found(0.667), None);
        assert_eq!(found(5.0), None);
        assert_eq!(found(f64::NAN), None);
        let radius = |r: f64| r - r * r * r / 3.0;
        assert!((rising(radius, 0.5, 3.0).unwrap() - found(0.5).unwrap().x).abs() < 1e-14);
        assert_eq!(rising(radius, 0.667, 3.0), None);
        assert_eq!(rising(radius, f64::NAN, 3.0), None);
    }
}
