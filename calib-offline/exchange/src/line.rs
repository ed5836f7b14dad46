//! The line nearest to places: how a focal length and a principal point are started.

/// Slope and start of the line that comes nearest to places (x, y), by the sum of squares along y; `None` if it does not rise.
pub(super) fn rising(places: impl Iterator<Item = (f64, f64)> + Clone) -> Option<(f64, f64)> {
    let count = places.clone().count() as f64;
    let (sum_x, sum_y) = places
        .clone()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let (mut square, mut product) = (0.0, 0.0);
    for (x, y) in places {
        square += (x - mean_x).powi(2);
        product += (x - mean_x) * (y - mean_y);
    }
    let slope = product / square;
    (slope > 0.0 && slope.is_finite()).then_some((slope, mean_y - slope * mean_x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_if_it_rises() {
        let line = |slope: f64| (0..9).map(move |k| (f64::from(k), 3.0 + slope * f64::from(k)));
        let (slope, start) = rising(line(0.5)).unwrap();
        assert!((slope - 0.5).abs() < 1e-14 && (start - 3.0).abs() < 1e-14);
        assert_eq!(rising(line(-0.5)), None);
        // No place, one place.
        assert_eq!(rising(line(1.0).take(0)), None);
        assert_eq!(rising(line(1.0).take(1)), None);
    }
}
