//! What the tables tried would cost, and what they would hold.

use super::packed::{CurvePoint, Tried};

/// Bytes of all cameras' tables against the worst error of any: for each error that some camera
/// has with some table, the smallest tables with which no camera is worse. From small to large,
/// each with a smaller error than the one before; px and mm are the worst of those tables.
pub fn curve(tried: &[&[Tried]]) -> Vec<CurvePoint> {
    let mut limits: Vec<f64> = tried
        .iter()
        .flat_map(|t| t.iter().map(|t| t.error_px))
        .collect();
    limits.sort_by(f64::total_cmp);
    limits.dedup();
    let mut pareto: Vec<CurvePoint> = Vec::new();
    // From large errors to small: a point that costs no more than a worse one replaces it.
    for limit in limits.into_iter().rev() {
        let smallest = |camera: &&[Tried]| {
            let holds = camera.iter().filter(|tried| tried.error_px <= limit);
            holds.min_by_key(|tried| tried.bytes).copied()
        };
        let Some(tables) = tried.iter().map(smallest).collect::<Option<Vec<Tried>>>() else {
            continue;
        };
        let worst = |error: fn(&Tried) -> f64| tables.iter().map(error).fold(0.0, f64::max);
        let point = CurvePoint {
            bytes: tables.iter().map(|table| table.bytes).sum(),
            error_px: worst(|table| table.error_px),
            error_mm: worst(|table| table.error_mm),
        };
        while pareto.last().is_some_and(|last| last.bytes >= point.bytes) {
            pareto.pop();
        }
        pareto.push(point);
    }
    pareto
}
