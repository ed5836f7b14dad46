//! What the formats in YAML share: numbers that every reader takes for numbers, and matrices.

use nalgebra::Matrix3;

/// The shortest digits that read back to the same bits, with a point and a signed exponent: readers of YAML 1.1 take
/// `1e-6` and `1.5e16` for text.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    let Some((digits, exponent)) = text.split_once('e') else {
        return text;
    };
    let point = if digits.contains('.') { "" } else { ".0" };
    let (sign, exponent) = match exponent.strip_prefix('-') {
        Some(exponent) => ('-', exponent),
        None => ('+', exponent),
    };
    format!("{digits}{point}e{sign}{exponent:0>2}")
}

/// In flow style, which every reader takes: lists with dashes in their key's column some refuse.
pub(super) fn list(values: impl IntoIterator<Item = f64>) -> String {
    let values: Vec<String> = values.into_iter().map(number).collect();
    format!("[ {} ]", values.join(", "))
}

/// A matrix with its type, row by row. `tag` is what stands behind the key.
pub(super) fn matrix(key: &str, tag: &str, shape: [usize; 2], values: &[f64]) -> String {
    let [rows, cols] = shape;
    let data = list(values.iter().copied());
    format!("{key}:{tag}\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: {data}\n")
}

/// The numbers of a matrix row by row.
pub(super) fn rows(matrix: &Matrix3<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_point_and_a_signed_exponent() {
        for (value, text) in [
            (1.0, "1.0"),
            (-0.25, "-0.25"),
            (1e-6, "1.0e-06"),
            (-1.5e-123, "-1.5e-123"),
            (1.5e16, "1.5e+16"),
        ] {
            assert_eq!(number(value), text);
            assert_eq!(text.parse::<f64>(), Ok(value));
        }
    }
}
