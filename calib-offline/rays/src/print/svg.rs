//! A drawing as SVG at true size.

use crate::print::artwork::{Artwork, Shape};
use std::fmt::Write as _;

/// The document; one unit is a millimeter.
pub fn document(art: &Artwork, title: &str) -> String {
    let [left, right, upper, lower] = art.plate_mm;
    let (width, height) = (right - left, lower - upper);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" viewBox=\"0 0 {0} {1}\" \
         shape-rendering=\"geometricPrecision\">\n<title>{2}</title>\n<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
        number(width),
        number(height),
        escaped(title)
    );
    for shape in &art.shapes {
        let fill = |black: bool| if black { "#000" } else { "#fff" };
        // Writing to a string does not fail.
        let _ = match *shape {
            Shape::Rect { from, to, black } => writeln!(
                text,
                "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>",
                number(from[0] - left),
                number(from[1] - upper),
                number(to[0] - from[0]),
                number(to[1] - from[1]),
                fill(black)
            ),
            Shape::Disk { at, radius, black } => writeln!(
                text,
                "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"/>",
                number(at[0] - left),
                number(at[1] - upper),
                number(radius),
                fill(black)
            ),
        };
    }
    text.push_str("</svg>\n");
    text
}

/// To a nanometer, without zeros at the end.
pub fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_unit_is_a_millimeter() {
        let art = Artwork::new(
            [-5.0, 15.5, -5.0, 10.0],
            vec![Shape::square(0.0, 0.0, 2.5, true)],
        );
        let text = document(&art, "a < b");
        assert!(text.contains("width=\"20.5mm\" height=\"15mm\" viewBox=\"0 0 20.5 15\""));
        assert!(
            text.contains("<rect x=\"5\" y=\"5\" width=\"2.5\" height=\"2.5\" fill=\"#000\"/>")
        );
        assert!(text.contains("a &lt; b"));
    }
}
