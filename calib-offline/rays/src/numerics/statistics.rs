//! The figures by which many values are told.

/// Root mean square; `None` of nothing.
pub fn rms(values: &[f64]) -> Option<f64> {
    (!values.is_empty())
        .then(|| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt())
}
