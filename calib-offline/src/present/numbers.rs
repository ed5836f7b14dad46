//! Numbers as people read them.

/// Three significant digits without an exponent where that stays short.
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor() as i32;
    if (-4..6).contains(&magnitude) {
        let decimals = (2 - magnitude).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.2e}")
    }
}

/// What a cell for people says, also where there is nothing to say.
pub fn or_dash(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

/// What a cell for programs says, also where there is nothing to say.
pub fn or_empty(value: Option<impl ToString>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_shown_at_any_size() {
        let cases = [
            (0.0, "0"),
            (0.05, "0.0500"),
            (1.2345, "1.23"),
            (123.456, "123"),
            (98765.4, "98765"),
            (0.00012345, "0.000123"),
            (1.5e-9, "1.50e-9"),
            (2.5e9, "2.50e9"),
            (f64::NAN, "NaN"),
        ];
        for (value, expected) in cases {
            assert_eq!(short(value), expected);
        }
    }
}
