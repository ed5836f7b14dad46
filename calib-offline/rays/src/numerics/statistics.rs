//! The figures by which many values are told.

/// Root mean square; `None` of nothing.
pub fn rms(values: &[f64]) -> Option<f64> {
    (!values.is_empty())
        .then(|| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt())
}

/// The middle one by size, the upper of two; `None` of nothing. NaN counts as larger than anything.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    (middle < values.len()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upper_of_two_middle_values_is_the_median() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(median([f64::INFINITY]), Some(f64::INFINITY));
        assert_eq!(median([]), None);
    }

    #[test]
    fn rms_is_of_the_values_as_they_are() {
        assert_eq!(rms(&[3.0, -4.0, 0.0, 0.0]), Some(2.5));
        assert_eq!(rms(&[]), None);
    }
}
